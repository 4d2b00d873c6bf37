"""`replay`: a recorded run judged again from its bag; for CI with an expectation file and a JUnit report."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Annotated, NamedTuple

import typer
from rich.table import Table

from irsbot_supervisor.cli.common import BAD_INPUT, Failed, err, existing, out, print_json
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.replay import Assumption, Judged, Recording, cause_names, judge_again, read_recording
from irsbot_supervisor.settings_file import read_values
from irsbot_supervisor.story import Story, measures_of, read_story, write_draft
from irsbot_supervisor.verify import Check, against_recording, against_story

RobotOption = Annotated[str | None, typer.Option(help="for bags of joint states alone: preset or YAML file")]
SettingsOption = Annotated[
    Path | None,
    typer.Option(help="for bags of joint states alone: YAML file with other settings than the shipped ones"),
]
MechanismOption = Annotated[
    list[Path] | None,
    typer.Option(help="file of a mechanism of your own, if neither where it was nor beside the bag; known by its hash"),
]
NamespaceOption = Annotated[str | None, typer.Option(help="whose run, in a bag of several robots")]


def replay(
    bag: Annotated[Path, typer.Argument(help="MCAP file, or a folder with one")],
    expect: Annotated[Path | None, typer.Option(help="expectation file; expected.json beside the bag if there")] = None,
    write_expect: Annotated[
        Path | None, typer.Option(help="write a draft of an expectation file, to be edited")
    ] = None,
    junit: Annotated[Path | None, typer.Option(help="write a JUnit report here")] = None,
    robot: RobotOption = None,
    settings: SettingsOption = None,
    namespace: NamespaceOption = None,
    mechanism: MechanismOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Judge a recorded run again, from the bag alone. Exit code 1 and the first difference if a verdict differs.

    Example: irsbot replay bags/type2 --junit report.xml
    """
    try:
        found = _judge(bag, expect, robot, settings, namespace, mechanism)
    except (*BAD_INPUT, OSError) as error:
        if junit is not None:
            write_junit(junit, str(bag), [], str(error))
        raise
    if junit is not None:
        write_junit(junit, str(bag), found.checks)
    recording, judged, checks, story = found.recording, found.judged, found.checks, found.story
    measures = measures_of(recording, judged, story)
    if as_json:
        print_json(
            {
                "bag": bag,
                "robot": judged.robot,
                "chapters": _rows(recording, judged),
                "measures": measures,
                "errors": judged.errors,
                "checks": [c._asdict() for c in checks],
            }
        )
    else:
        _print(recording, judged, checks, measures)
    if write_expect is not None:
        write_draft(recording, judged, write_expect, found.told, found.namespace)
        err.print(f'draft written to {write_expect}: it counts when a person has read it and deleted its line "draft"')
    if broken := [check for check in checks if check.faults]:
        raise Failed(f"{broken[0].name}: {len(broken[0].faults)} difference(s), the first: {broken[0].faults[0]}")


class _Found(NamedTuple):
    """A run judged again, and what it was compared with."""

    recording: Recording
    judged: Judged
    checks: list[Check]
    story: Story | None
    told: Assumption | None
    namespace: str | None


def _judge(
    bag: Path,
    expect: Path | None,
    robot: str | None,
    settings: Path | None,
    namespace: str | None,
    mechanism: list[Path] | None,
) -> _Found:
    story = story_of(existing(bag, "the bag"), expect)
    namespace = namespace or (story.namespace if story else None)
    recording = read_recording(bag, namespace)
    told = assumption(robot, settings, story)
    judged = judge_again(recording, told, files_of(mechanism))
    checks = against_recording(recording, judged)
    if story is not None:
        checks += against_story(recording, judged, story)
    return _Found(recording, judged, checks, story, told, namespace)


def files_of(mechanism: list[Path] | None) -> list[Path] | None:
    """Files that were named. Raises BadInput."""
    return [existing(file, "the mechanism file") for file in mechanism] if mechanism else None


def story_of(bag: Path, expect: Path | None = None) -> Story | None:
    """The expectations of a bag: those given, or those beside it if there are any. Raises BagError."""
    beside = bag / "expected.json" if bag.is_dir() else bag.with_name("expected.json")
    file = expect or (beside if beside.is_file() else None)
    return read_story(file) if file is not None else None


def assumption(robot: str | None, settings: Path | None, story: Story | None) -> Assumption | None:
    """What is told of a bag that does not say it: on the command line, or else in its expectations. Raises BadInput,
    InvalidSettings."""
    told = story.told if story is not None else None
    if robot is not None:
        told = Assumption(robot)
    if settings is not None:
        changes = read_values(existing(settings, "the settings file"))
        told = Assumption(told.robot if told else None, changes)
    return told


def write_junit(path: Path, name: str, checks: list[Check], error: str = "") -> None:
    """One test case per check, as CI systems read them. error: why there was nothing to check."""
    failures, errors = sum(bool(check.faults) for check in checks), int(bool(error))
    count = len(checks) + errors
    suite = ElementTree.Element("testsuite", name=name, tests=str(count), failures=str(failures), errors=str(errors))
    for check in checks:
        case = ElementTree.SubElement(suite, "testcase", classname="irsbot.replay", name=check.name)
        if check.faults:
            ElementTree.SubElement(case, "failure", message=check.faults[0]).text = "\n".join(check.faults)
    if error:
        case = ElementTree.SubElement(suite, "testcase", classname="irsbot.replay", name="replay")
        ElementTree.SubElement(case, "error", message=error)
    ElementTree.ElementTree(suite).write(path, encoding="unicode", xml_declaration=True)


def _rows(recording: Recording, judged: Judged) -> list[dict[str, object]]:
    return [
        {
            "time_s": (chapter.since_ns - recording.begin_ns) / S,
            "level": chapter.level.name,
            "causes": cause_names(chapter.causes),
            "latched": chapter.latched,
            "event": chapter.event,
            "text": chapter.text,
        }
        for chapter in judged.chapters
    ]


def _print(recording: Recording, judged: Judged, checks: list[Check], measures: dict[str, float]) -> None:
    table = Table("time [s]", "level", "causes", "finding")
    for row in _rows(recording, judged):
        table.add_row(f"{row['time_s']:.3f}", str(row["level"]), str(row["causes"]), str(row["text"]))
    out.print(f"robot: {judged.robot}")
    out.print("times count from the first joint state of the bag")
    out.print(table)
    if recording.loss:
        out.print(f"the bag is damaged: {recording.loss}")
    counts = f"{len(judged.levels)} samples judged again"
    if len(judged.parts) > 1:
        counts += f" by {len(judged.parts)} supervisors one after another"
    if judged.unseen:
        counts += f", {judged.unseen} in the bag never reached a supervisor"
    if judged.missing:
        counts += f", {judged.missing} that it saw are not in the bag"
    out.print(counts)
    if judged.errors:
        out.print(
            f"{len(judged.errors)} error(s) inside, each judged UNKNOWN; the first: {judged.errors[0]}", markup=False
        )
    out.print(", ".join(f"{name} {value:.4g}" for name, value in measures.items() if value == value))
    for check in checks:
        out.print(f"{check.name}: {'same' if not check.faults else f'{len(check.faults)} difference(s)'}")
