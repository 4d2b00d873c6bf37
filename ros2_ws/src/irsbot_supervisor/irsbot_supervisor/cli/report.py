"""`report`: a recorded run as one self-contained page."""

from __future__ import annotations

import base64
import tempfile
from dataclasses import fields
from html import escape
from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics import BadInput
from irsbot_supervisor.cli.common import existing, out, print_json
from irsbot_supervisor.cli.replay import (
    MechanismOption,
    NamespaceOption,
    RobotOption,
    SettingsOption,
    assumption,
    files_of,
    story_of,
)
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.journal import Configuration
from irsbot_supervisor.outcome import Outcome, outcome
from irsbot_supervisor.replay import Judged, Recording, cause_names, judge_again, read_recording
from irsbot_supervisor.sim.scenarios import Expectation
from irsbot_supervisor.verify import against_recording

STYLE = """body{font:15px sans-serif;margin:2em auto;max-width:70em}table{border-collapse:collapse}
td,th{border:1px solid #bbb;padding:.3em .6em;text-align:left;vertical-align:top}img{max-width:100%}
.STOP{background:#f7b2a5}.WARN{background:#fee8a8}.UNKNOWN{background:#d8c9e6}.OK{background:#d9f0d3}"""


def report(
    bag: Annotated[Path, typer.Argument(help="MCAP file, or a folder with one")],
    target: Annotated[Path, typer.Option("-o", "--output", help="page to write, .html")],
    robot: RobotOption = None,
    settings: SettingsOption = None,
    namespace: NamespaceOption = None,
    mechanism: MechanismOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Write one self-contained page about a run: picture, chapters, smallest margins, settings, replay.

    Example: irsbot report runs/demo/bag -o run.html
    """
    if target.suffix != ".html":
        raise BadInput(f"cannot write '{target}': the suffix must be .html")
    story = story_of(existing(bag, "the bag"))
    recording = read_recording(bag, namespace or (story.namespace if story else None))
    judged = judge_again(recording, assumption(robot, settings, story), files_of(mechanism))
    found = outcome(recording, Expectation(stop=False))
    target.write_text(_page(bag, recording, judged, found), encoding="utf-8")
    if as_json:
        print_json({"bag": bag, "robot": judged.robot, "file": target})
    else:
        out.print(f"written to {target}")


def _page(bag: Path, recording: Recording, judged: Judged, found: Outcome) -> str:
    chapters = "".join(
        f'<tr class="{chapter.level.name}"><td>{(chapter.since_ns - recording.begin_ns) / S:.3f}</td>'
        f"<td>{chapter.level.name}</td><td>{escape(cause_names(chapter.causes))}</td>"
        f"<td>{escape(chapter.text)}</td></tr>"
        for chapter in judged.chapters
    )
    nearest = "".join(f"<li>smallest {escape(str(one))}</li>" for one in found.nearest)
    checks = "".join(
        f"<li>{escape(check.name)}: {escape(check.faults[0]) if check.faults else 'same'}</li>"
        for check in against_recording(recording, judged)
    )
    entry = next((entry for entry in recording.journal if isinstance(entry, Configuration)), None)
    settings = entry.values if entry else {}
    units = {known.name: str(known.metadata["unit"]) for known in fields(Settings)}
    rows = "".join(
        f"<tr><td>{escape(name)}</td><td>{escape(str(value))}</td><td>{escape(units.get(name, ''))}</td></tr>"
        for name, value in settings.items()
    )
    return (
        f"<!doctype html><meta charset='utf-8'><title>{escape(bag.name)}</title><style>{STYLE}</style>"
        f"<h1>{escape(str(bag))}</h1><p>{len(recording.samples)} joint states, {len(recording.states)} judged. "
        f"Robot: {escape(judged.robot)}. "
        f"Times count from the first joint state of the bag. {escape(recording.loss)}</p>"
        f"{_picture(recording, found)}<h2>Verdicts</h2><table>"
        f"<tr><th>time [s]</th><th>level</th><th>causes</th><th>finding</th></tr>{chapters}</table>"
        f"<h2>Margins</h2><ul>{nearest}</ul>"
        f"<h2>Judged again</h2><ul>{checks or '<li>no supervisor in the bag to compare with</li>'}</ul>"
        f"<h2>Settings</h2><table><tr><th>setting</th><th>value</th><th>unit</th></tr>{rows}</table>"
    )


def _picture(recording: Recording, found: Outcome) -> str:
    from irsbot_supervisor.pictures.run import draw_run  # matplotlib takes a second to load

    with tempfile.TemporaryDirectory() as folder:
        target = Path(folder) / "run.png"
        draw_run(recording, found, target)
        if not target.is_file():
            return ""
        data = base64.b64encode(target.read_bytes()).decode()
    return f'<img alt="margins and verdict over time" src="data:image/png;base64,{data}">'
