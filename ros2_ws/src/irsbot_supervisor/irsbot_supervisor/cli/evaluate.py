"""`evaluate`: margins of many joint samples, of one table or of many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from irsbot_kinematics import BadInput
from irsbot_supervisor.cli.cluster import SchedulerOption, WorkersOption, cluster_of, everywhere
from irsbot_supervisor.cli.common import err, existing, out, print_json, without_shared_folder
from irsbot_supervisor.cli.kinematics import AsJson, RobotName
from irsbot_supervisor.cli.progress import progress_bar
from irsbot_supervisor.fleet.search import bags_in

if TYPE_CHECKING:
    from irsbot_supervisor.fleet.evaluating import InputRow


def evaluate(
    robot: RobotName,
    dataset: Annotated[
        Path,
        typer.Option(
            "-o", "--output", help="CSV or Parquet file to write; for several inputs a folder, without a suffix"
        ),
    ],
    inputs: Annotated[
        list[Path] | None,
        typer.Argument(metavar="INPUT...", help="CSV files with one column per joint, bags, and folders with bags"),
    ] = None,
    source: Annotated[list[Path] | None, typer.Option("--input", help="the same; may be repeated")] = None,
    assembly: Annotated[int | None, typer.Option(help="assembly mode; the usual one if left out")] = None,
    load: Annotated[float | None, typer.Option(help="N of any direction: largest leg forces as well")] = None,
    moment: Annotated[float, typer.Option(help="N m of either sign, with --load")] = 0.0,
    topic: Annotated[
        str | None, typer.Option(help="joint states to take, in a bag with several topics of them")
    ] = None,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    as_json: AsJson = False,
) -> None:
    """Margins of many joint samples at once.

    Example: irsbot evaluate irsbot2 --input joints.csv --output margins.csv

    Several inputs give a Parquet file each: irsbot evaluate irsbot2 bags/*/ -o runs/margins
    """
    from irsbot_supervisor.bag.column_stream import write_chunks  # polars takes its time to load
    from irsbot_supervisor.fleet.evaluating import InputJob, Question, evaluate_inputs, evaluated_columns

    cluster = cluster_of(scheduler, workers)
    if not (places := [*(inputs or ()), *(source or ())]):
        raise BadInput("there is no input; give CSV files or bags")
    question = Question(everywhere(robot), assembly, load, moment, topic)
    jobs = [InputJob(str(place), str(place.resolve()), question) for place in _inputs(places)]
    if dataset.suffix:
        if len(jobs) > 1:
            raise BadInput(f"cannot write '{dataset}': {len(jobs)} inputs need a folder, without a suffix")
        if scheduler is not None:
            raise BadInput("--scheduler is for a folder of tables, without a suffix; one table is made here")
        row, columns = evaluated_columns(InputJob(jobs[0].name, jobs[0].name, question))
        for warning in row.warnings:
            err.print(f"irsbot: {warning}")
        write_chunks(dataset, [columns])
        if as_json:
            print_json({"samples": row.samples, "assembled": row.assembled, "file": dataset})
        else:
            out.print(f"{row.samples} samples, {row.assembled} assembled, written to {dataset}")
        return
    with progress_bar() as bar:
        task = bar.add_task("evaluating inputs", total=len(jobs))
        rows = evaluate_inputs(jobs, dataset, cluster, lambda done, _all: bar.update(task, completed=done))
    _show(rows, dataset, as_json)
    if broken := [row for row in rows if row.error]:
        raise BadInput(f"{len(broken)} of {len(rows)} inputs could not be evaluated, the first: {broken[0].error}")


def _inputs(places: Sequence[Path]) -> list[Path]:
    """Files as they are, and the bags of folders; each once. Raises BadInput, BagError."""
    found: dict[Path, Path] = {}
    for place in places:
        for one in bags_in([place]) if existing(place, "the input").is_dir() else [place]:
            found.setdefault(one.resolve(), one)
    return list(found.values())


def _show(rows: Sequence[InputRow], folder: Path, as_json: bool) -> None:
    total = {
        "inputs": len(rows),
        "not_evaluated": sum(bool(row.error) for row in rows),
        "samples": sum(row.samples for row in rows),
        "assembled": sum(row.assembled for row in rows),
    }
    if as_json:
        print_json({"inputs": [asdict(row) for row in rows], "total": total, "folder": folder})
        return
    shared, names = without_shared_folder([row.input for row in rows])
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("input", overflow="fold")
    for heading in ("samples", "assembled", "Type 2", "constraint"):
        table.add_column(heading, no_wrap=True, justify="right")
    for name, row in zip(names, rows, strict=True):
        figures = ["" if value is None else f"{value:.4f}" for value in (row.type2, row.constraint)]
        counts = ["", "not evaluated"] if row.error else [str(row.samples), str(row.assembled)]
        table.add_row(name, *counts, *figures)
    if shared:
        out.print(f"inputs in {shared}")
    out.print(table)
    for row in rows:
        for text in filter(None, (row.error, *row.warnings)):
            out.print(f"{row.input}: {text}")
    out.print(
        f"{total['inputs']} inputs, {total['not_evaluated']} not evaluated; {total['samples']} samples, "
        f"{total['assembled']} assembled; smallest margins are shown"
    )
    if folder.exists():
        out.print(f"written to {folder}")
