"""`replay`: judges a recorded run again from its bag; for CI with an expectation file and a JUnit report."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics import BadInput
from irsbot_msgs_py.records import cause_names
from irsbot_supervisor.cli import fleet
from irsbot_supervisor.cli.cluster import SchedulerOption, WorkersOption, cluster_of
from irsbot_supervisor.cli.common import BAD_INPUT, Failed, err, folding_table, out, print_json
from irsbot_supervisor.cli.junit import Suite, write_junit
from irsbot_supervisor.cli.progress import progress_bar
from irsbot_supervisor.fleet.records import BagCheck
from irsbot_supervisor.fleet.search import bags_in
from irsbot_supervisor.replay.expectation import write_draft
from irsbot_supervisor.replay.judgement import BagJudgement, judge_bag

SHOWN_EVERY = 1000
"""Samples between two steps of the progress bar, at least."""

RobotOption = Annotated[str | None, typer.Option(help="for bags of joint states alone: preset or YAML file")]
SettingsOption = Annotated[
    Path | None,
    typer.Option(
        "--settings",
        "--params",
        help="for bags of joint states alone: YAML file with other settings than the shipped ones",
    ),
]
MechanismOption = Annotated[
    list[Path] | None,
    typer.Option(
        help="file of your own mechanism, if not at its recorded place or beside the bag; its hash must match"
    ),
]
TopicOption = Annotated[str | None, typer.Option(help="joint states to judge, in a bag with several topics of them")]
BagsArgument = Annotated[
    list[Path],
    typer.Argument(
        metavar="BAG...",
        help="bags, and folders with bags: a bag is a folder or one file, .mcap, .db3, .bag, also .zstd",
    ),
]
NamespaceOption = Annotated[str | None, typer.Option(help="namespace of the robot, in a bag of several robots")]


def replay(
    bags: BagsArgument,
    expect: Annotated[Path | None, typer.Option(help="expectation file; expected.json beside the bag if there")] = None,
    write_expect: Annotated[
        Path | None, typer.Option(help="write a draft of an expectation file, to be edited")
    ] = None,
    junit: Annotated[Path | None, typer.Option(help="write a JUnit report here")] = None,
    dataset: Annotated[
        Path | None,
        typer.Option(
            "-o",
            "--output",
            help="folder that keeps the samples of every bag; a bag that is there is not judged again",
        ),
    ] = None,
    robot: RobotOption = None,
    settings: SettingsOption = None,
    namespace: NamespaceOption = None,
    topic: TopicOption = None,
    mechanism: MechanismOption = None,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Judge recorded runs again, from the bags alone. Exit code 1 and the first difference if a verdict differs.

    Example: irsbot replay bags/type2 --junit report.xml

    Several bags, or a folder of them, give one line a bag: irsbot replay bags -o runs/fleet
    """
    try:
        found = bags_in(bags)
        if len(found) == 1 and dataset is None and scheduler is None:
            alone = judged_with_progress(found[0], robot, settings, expect, namespace, topic, mechanism)
            suites = [Suite(str(found[0]), [BagCheck(name, len(faults), faults) for name, faults in alone.checks])]
        elif expect is not None or write_expect is not None:
            raise BadInput("--expect and --write-expect are for one bag; several keep expected.json beside each bag")
        else:
            alone, options = None, fleet.options_of(robot, settings, namespace, topic, mechanism)
            rows = fleet.judged(found, options, cluster_of(scheduler, workers), dataset)
            suites = [Suite(row.bag, row.checks, row.error) for row in rows]
    except (*BAD_INPUT, OSError) as error:
        if junit is not None:
            write_junit(junit, [Suite(" ".join(map(str, bags)), [], str(error))])
        raise
    if junit is not None:
        write_junit(junit, suites)
    if alone is None:
        fleet.show(rows, dataset, as_json)
        fleet.raise_if_failed(rows)
    else:
        _tell(alone, as_json)
        if write_expect is not None:
            _write_draft(alone, write_expect, namespace, topic)
        if broken := [check for check in alone.checks if check.faults]:
            raise Failed(f"{broken[0].name}: {len(broken[0].faults)} difference(s), the first: {broken[0].faults[0]}")


def _write_draft(found: BagJudgement, target: Path, namespace: str | None, topic: str | None) -> None:
    if found.expectation is not None:
        namespace, topic = namespace or found.expectation.namespace, topic or found.expectation.topic
    write_draft(found.recording, found.judged, target, found.assumption, namespace, topic)
    err.print(f'draft written to {target}: it counts when a person has read it and deleted its line "draft"')


def judged_with_progress(
    bag: Path,
    robot: str | None,
    settings: Path | None,
    expect: Path | None,
    namespace: str | None,
    topic: str | None,
    mechanism: list[Path] | None,
) -> BagJudgement:
    """Judge the bag again, with a progress bar for long bags."""
    with progress_bar() as bar:
        task, shown = bar.add_task("judging again", total=None), 0

        def progress(done: int, samples: int) -> None:
            nonlocal shown
            if done - shown >= SHOWN_EVERY:
                shown = done
                bar.update(task, completed=done, total=samples)

        return judge_bag(
            bag,
            robot,
            settings,
            expect=expect,
            namespace=namespace,
            topic=topic,
            mechanisms=mechanism,
            progress=progress,
        )


def _tell(found: BagJudgement, as_json: bool) -> None:
    """One bag in full."""
    if as_json:
        print_json(found.as_json())
        return
    recording, judged = found.recording, found.judged
    table = folding_table("time [s]", "level", "causes", "finding")
    for interval in found.levels:
        table.add_row(f"{interval.time_s:.3f}", interval.level.name, cause_names(interval.causes), interval.text)
    out.print(f"robot: {found.robot}")
    out.print("times count from the first joint state of the bag")
    out.print(table)
    if recording.loss:
        out.print(f"the bag is damaged: {recording.loss}")
    counts = f"{len(judged.levels)} samples judged again"
    if len(judged.parts) > 1:
        counts += f" by {len(judged.parts)} supervisors one after another"
    if judged.between:
        counts += f", {judged.between} of them at times between those of their neighbours"
    if judged.unseen:
        counts += f", {judged.unseen} in the bag never reached a supervisor"
    if judged.missing:
        counts += f", {judged.missing} that it saw are not in the bag"
    out.print(counts)
    if judged.errors:
        out.print(
            f"{len(judged.errors)} error(s) inside, each judged UNKNOWN; the first: {judged.errors[0]}", markup=False
        )
    out.print(", ".join(f"{name} {value:.4g}" for name, value in found.measures.items() if value == value))
    for check in found.checks:
        out.print(f"{check.name}: {'same' if not check.faults else f'{len(check.faults)} difference(s)'}")
