"""The line that says what goes wrong.

Faults are separated by ";"; each is a name, or a name and its settings:

    nan:count=10,at=2.0; loss:share=0.05,lasting=5

Every fault takes `at` (s after the line was given), `lasting` (s), `count` (samples) and `every` (only each n-th
sample); `describe` lists the faults with what else they can be told.
"""

from __future__ import annotations

from dataclasses import MISSING, Field, fields
from math import nan
from typing import Any

from irsbot_supervisor.sim.errors import BadFault
from irsbot_supervisor.sim.faults import content, delivery
from irsbot_supervisor.sim.faults.base import Fault, Setting

FAULTS: dict[str, type[Fault]] = {
    "drop": delivery.Drop,
    "loss": delivery.Loss,
    "reorder": delivery.Reorder,
    "latency": delivery.Latency,
    "flood": delivery.Flood,
    "second_publisher": delivery.SecondPublisher,
    "nan": content.Nan,
    "inf": content.Inf,
    "huge": content.Huge,
    "denormal": content.Denormal,
    "missing_name": content.MissingName,
    "wrong_name": content.WrongName,
    "duplicate_name": content.DuplicateName,
    "extra_name": content.ExtraName,
    "permuted": content.Permuted,
    "miswired": content.Miswired,
    "wrong_length": content.WrongLength,
    "stamp_shift": delivery.StampShift,
    "stamp_zero": delivery.StampZero,
    "stamp_repeated": delivery.StampRepeated,
    "stamp_swapped": delivery.StampSwapped,
    "freeze": content.Freeze,
    "glitch": content.Glitch,
    "drift": content.Drift,
    "noise": content.Noise,
    "sign": content.Sign,
    "degrees": content.Degrees,
    "mode_flip": content.ModeFlip,
}
"""Every fault by the name it has in a fault line."""


def parse_faults(line: str) -> tuple[Fault, ...]:
    """The faults of a line; none for an empty one. Raises BadFault."""
    return tuple(_fault(part.strip()) for part in line.split(";") if part.strip())


def describe() -> str:
    """All faults, one line each, with their own settings and defaults."""
    common = {entry.name for entry in fields(Fault)}
    lines = []
    for name, kind in sorted(FAULTS.items()):
        own = [
            f"{entry.name}={_default(entry)} ({_stated(entry)})"
            for entry in _settings(kind)
            if entry.name not in common
        ]
        lines.append(f"{name}: {_first_line(kind)}" + (f" Settings: {', '.join(own)}." if own else ""))
    return "\n".join(lines)


def _fault(part: str) -> Fault:
    name, _, rest = part.partition(":")
    name = name.strip()
    if name not in FAULTS:
        raise BadFault(f"no fault '{name}'; known are {', '.join(sorted(FAULTS))}")
    entries = {entry.name: entry for entry in _settings(FAULTS[name])}
    values: dict[str, Any] = {}
    for pair in filter(None, map(str.strip, rest.split(","))):
        key, equals, text = (piece.strip() for piece in pair.partition("="))
        if not equals:
            raise BadFault(f"'{pair}' of fault '{name}' must look like {next(iter(entries))}=VALUE")
        if key not in entries:
            raise BadFault(f"fault '{name}' has no '{key}'; it has {', '.join(entries)}")
        values[key] = _value(name, entries[key], text)
    return FAULTS[name](**values)


def _value(name: str, entry: Field[Any], text: str) -> Any:
    rule: Setting = entry.metadata["setting"]
    if rule.words:
        if text not in rule.words:
            raise BadFault(f"{entry.name} of fault '{name}' is one of {', '.join(rule.words)}, got '{text}'")
        return text
    try:
        value: float = int(text) if rule.whole else float(text)
    except ValueError:
        value = nan
    if not rule.low <= value <= rule.high:
        kind = "a whole number" if rule.whole else "a number"
        raise BadFault(f"{entry.name} of fault '{name}' is {kind} in {rule.low:g}..{rule.high:g}, got '{text}'")
    return value


def _settings(kind: type[Fault]) -> list[Field[Any]]:
    return [entry for entry in fields(kind) if "setting" in entry.metadata]


def _default(entry: Field[Any]) -> Any:
    assert entry.default is not MISSING, "every setting has a default"
    return entry.default


def _stated(entry: Field[Any]) -> str:
    rule: Setting = entry.metadata["setting"]
    return rule.text + (f": {' | '.join(rule.words)}" if rule.words else "")


def _first_line(kind: type[Fault]) -> str:
    return (kind.__doc__ or "").strip().splitlines()[0]
