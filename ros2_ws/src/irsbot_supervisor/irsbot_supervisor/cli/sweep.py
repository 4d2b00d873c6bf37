"""`design sweep`: many designs judged, in one file or in a folder that a later run goes on with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics import BadInput
from irsbot_kinematics.design import PARAMETERS, Plan, Range
from irsbot_supervisor.cli.cluster import SchedulerOption, WorkersOption, cluster_of
from irsbot_supervisor.cli.common import measure, numbers, out, print_json
from irsbot_supervisor.cli.design import Set, Vary, design_named, pairs
from irsbot_supervisor.cli.progress import progress_bar
from irsbot_supervisor.cli.tables import design as tables

SUFFIXES = (".parquet", ".csv")
"""Of tables in one file."""


def sweep(
    dataset: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help="table to write: .parquet or .csv; without a suffix a folder of Parquet files, which a later run "
            "goes on with",
        ),
    ],
    vary: Vary = None,
    robot: Annotated[str, typer.Argument(help="design that gives the numbers that are not varied")] = "irsbot2",
    samples: Annotated[int | None, typer.Option(help="random designs in Latin hypercubes; a grid if left out")] = None,
    seed: Annotated[int, typer.Option(help="of the random designs", min=0)] = 0,
    set_: Set = None,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Judge many designs: a grid, or Latin hypercubes, over ranges of the parameters. One row per design.

    Example: irsbot design sweep --vary l1=0.1:0.5 --vary beta=5deg:60deg --samples 100000 -o designs.parquet
    """
    cluster = cluster_of(scheduler, workers)
    plan = _plan(robot, set_ or [], vary or [], samples, seed)
    if dataset.suffix and dataset.suffix not in SUFFIXES:
        raise BadInput(f"cannot write '{dataset}': the suffix must be .csv or .parquet, or none for a folder")
    from irsbot_supervisor.fleet.sweeping import sweep_to_file, sweep_to_folder  # polars takes its time to load

    with progress_bar() as bar:
        task = bar.add_task("designs", total=len(plan))
        judge = sweep_to_file if dataset.suffix else sweep_to_folder
        sums = judge(plan, dataset, cluster, lambda done, _all: bar.update(task, completed=done))
    summary = {**sums, "output": dataset}
    if as_json:
        print_json(summary)
    else:
        out.print(tables.sweep_table(summary))


def _plan(robot: str, replaced: list[str], vary: list[str], samples: int | None, seed: int) -> Plan:
    """Raises BadInput."""
    _, g = design_named(robot, replaced)
    ranges = {name: Range(getattr(g, name), getattr(g, name)) for name in PARAMETERS}
    if not vary:
        raise BadInput("nothing to vary; give --vary name=low:high, or name=low:high:steps for a grid")
    taken = {name: "--set" for name, _value in pairs(replaced)}
    for name, entries in pairs(vary):
        if name in taken:
            raise BadInput(f"--vary {name}: it has a {taken[name]} already")
        taken[name] = "--vary"
        bounds = entries.split(":")
        if len(bounds) not in (2, 3) or (samples is None and len(bounds) == 2):
            wanted = "low:high" if samples is not None else "low:high:steps"
            raise BadInput(f"--vary {name} must be {wanted}, got '{entries}'")
        steps = numbers([bounds[2]], "steps", 1)[0] if len(bounds) == 3 else 1.0
        if not steps.is_integer():
            raise BadInput(f"steps must be a whole number, got {bounds[2]}")
        if len(bounds) == 3 and steps == 1.0 and bounds[0] != bounds[1]:
            raise BadInput(f"--vary {name}: one step has no room for {bounds[0]} and {bounds[1]}, give 2 or more")
        ranges[name] = Range(measure(name, bounds[0]), measure(name, bounds[1]), int(steps))
    return Plan(ranges, samples, seed)
