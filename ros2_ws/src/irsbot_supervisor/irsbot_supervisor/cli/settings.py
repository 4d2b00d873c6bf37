"""`settings`: every setting of the supervision with its value for a robot, unit, range and meaning."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Column, Table

from irsbot_supervisor.cli.common import existing, out, print_json
from irsbot_supervisor.configuration.loading import read_settings, read_values
from irsbot_supervisor.core.settings import Settings

WIDE = 130
"""Width of the terminal, in columns, from which unit and range have their own columns."""


def settings(
    robot: Annotated[
        str | None, typer.Argument(help="preset name or YAML file; if left out, that of the file, or irsbot2")
    ] = None,
    file: Annotated[Path | None, typer.Option(help="YAML file of yours; it is checked as the supervisor would")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """List the settings of the supervision for a robot, or check a file of settings.

    Example: irsbot settings irsbot2 --file mine.yaml
    """
    changes = read_values(existing(file, "the settings file")) if file is not None else {}
    found, _robot = read_settings(robot or str(changes.get("robot", Settings.robot)), changes, file or "")
    rows = [_row(found, entry.name, entry.metadata) for entry in fields(Settings)]
    if as_json:
        print_json({"config_hash": found.config_hash, "settings": rows})
        return
    # Names are copied from here: where there is little room others fold.
    longest = max(len(row["name"]) for row in rows)
    wide = out.width >= WIDE
    names = ("value", "unit", "range", "meaning") if wide else ("value", "meaning, unit, range")
    others = (Column(name, overflow="fold") for name in names)
    table = Table(Column("setting", min_width=longest, no_wrap=True), *others)
    for row in rows:
        limits = f"{row['range']} {row['unit'] if row['unit'] != '1' else ''}".strip()
        told = f"{row['meaning']}; {limits}" if limits else row["meaning"]
        cells = (row["unit"], row["range"], row["meaning"]) if wide else (told,)
        table.add_row(row["name"], _told(row["value"]), *cells)
    out.print(table)
    out.print(f"configuration {found.config_hash}")


def _told(value: Any) -> str:
    """A value as text; a value that all joints share is printed once."""
    if not isinstance(value, tuple):
        return f"{value:g}" if isinstance(value, float) else str(value)
    each = [_told(one) for one in value]
    return f"{each[0]} each" if len(each) > 1 and len(set(each)) == 1 else ", ".join(each)


def _row(found: Settings, name: str, metadata: Any) -> dict[str, Any]:
    words, low = metadata.get("words"), metadata.get("low")
    span = ", ".join(words) if words else "" if low is None else f"{low:g}..{metadata['high']:g}"
    meaning = metadata["text"] + (" (only at start)" if metadata.get("read_only") else "")
    return {"name": name, "value": getattr(found, name), "unit": metadata["unit"], "range": span, "meaning": meaning}
