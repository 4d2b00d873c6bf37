"""Parts of the commands that take many bags: options, judging with a progress bar, the table of the fleet."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from rich.table import Table

from irsbot_kinematics import BadInput
from irsbot_supervisor.cli.cluster import everywhere
from irsbot_supervisor.cli.common import Failed, out, print_json, without_shared_folder
from irsbot_supervisor.cli.progress import progress_bar
from irsbot_supervisor.fleet.cluster import Cluster
from irsbot_supervisor.fleet.records import BagJob, BagRow, Fleet, Options


def options_of(
    robot: str | None,
    settings: Path | None,
    namespace: str | None,
    topic: str | None,
    mechanism: Sequence[Path] | None,
) -> Options:
    """Options for workers, whose folder is another one: files by absolute paths."""
    machine = everywhere(robot) if robot is not None else None
    files = None if mechanism is None else tuple(str(file.resolve()) for file in mechanism)
    return Options(machine, str(settings.resolve()) if settings is not None else None, namespace, topic, files)


def judged(
    bags: Sequence[Path], options: Options, cluster: Cluster, folder: Path | None, page: bool = False
) -> list[BagRow]:
    """Judge bags with a progress bar. folder: where samples, and pages if wanted, are kept.

    Raises BadInput, OSError.
    """
    from irsbot_supervisor.fleet.bags import judge_fleet  # polars, and for the page jinja2
    from irsbot_supervisor.fleet.dataset import Dataset

    keep = folder is not None
    jobs = [BagJob(str(bag), str(bag.resolve()), options, samples=keep, page=page) for bag in bags]
    with progress_bar() as bar:
        task = bar.add_task("judging bags", total=len(jobs))
        return judge_fleet(
            jobs,
            cluster,
            Dataset(folder) if folder is not None else None,
            lambda done, total: bar.update(task, completed=done, total=total),
        )


def show(rows: Sequence[BagRow], folder: Path | None, as_json: bool) -> None:
    """The table, or the same as JSON. folder: where results were kept."""
    total = Fleet(tuple(rows)).as_json()
    if as_json:
        print_json({"bags": [row.as_json() for row in rows], "total": total, "folder": folder})
        return
    shared, names = without_shared_folder([row.bag for row in rows])
    table = Table(box=None, pad_edge=False, padding=(0, 2, 0, 0))
    table.add_column("bag", overflow="fold")
    for heading in ("margin", "value", "limit", "stops", "false", "lost", "s", "result"):
        table.add_column(heading, no_wrap=True, justify="left" if heading in ("margin", "result") else "right")
    for name, row in zip(names, rows, strict=True):
        table.add_row(name, *_cells(row))
    if shared:
        out.print(f"bags in {shared}")
    out.print(table)
    for row in rows:
        if row.error:
            out.print(f"{row.bag}: {row.error}")
        for check in row.checks:
            if check.count:
                out.print(f"{row.bag}: {check.name}: {check.count} difference(s), the first: {check.faults[0]}")
        if row.damage:
            out.print(f"{row.bag}: the bag is damaged: {row.damage}")
    out.print(
        f"{total['bags']} bags: {total['same']} same, {total['differ']} differ, {total['not_judged']} not judged; "
        f"{total['stops']} stops, {total['false_stops']} false; {total['lost']} samples lost"
    )
    if folder is not None and folder.exists():
        out.print(f"written to {folder}")


def _cells(row: BagRow) -> tuple[str, ...]:
    """The line of a bag, less its name."""
    if row.error:
        return "", "", "", "", "", "", "", row.result
    value = "" if row.value is None else f"{row.value:.3f}"
    limit = "" if row.stop_limit is None else f"{row.stop_limit:.3f}"
    false = "" if row.false_stops is None else str(row.false_stops)
    margin = row.margin.removesuffix(" margin")
    return margin, value, limit, str(row.stops), false, str(row.lost), f"{row.seconds:.1f}", row.result


def raise_if_not_judged(rows: Sequence[BagRow]) -> None:
    """Raises BadInput if a bag could not be judged."""
    if broken := [row for row in rows if row.error]:
        raise BadInput(f"{len(broken)} of {len(rows)} bags could not be judged, the first: {broken[0].error}")


def raise_if_failed(rows: Sequence[BagRow]) -> None:
    """Raises BadInput for a bag that could not be judged, else Failed for one that differs."""
    raise_if_not_judged(rows)
    if broken := [row for row in rows if row.differences]:
        first = next(check for check in broken[0].checks if check.count)
        raise Failed(f"{len(broken)} of {len(rows)} bags differ, the first: {broken[0].bag}: {first.faults[0]}")
