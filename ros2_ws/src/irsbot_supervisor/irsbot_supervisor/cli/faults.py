"""`faults`: the fault campaign, each kind of fault tried many times against the supervision."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.progress import BarColumn, MofNCompleteColumn, TimeElapsedColumn
from rich.table import Table

from irsbot_supervisor.cli.cluster import SchedulerOption, cluster_of
from irsbot_supervisor.cli.common import Failed, out, print_json, refuse
from irsbot_supervisor.cli.progress import Bars
from irsbot_supervisor.validation.harness.rows import FALSE_STOPS, RECOVERY_S, TO_STOP_S, Entry, Row

if TYPE_CHECKING:
    from irsbot_supervisor.validation.runner import Order

MUST = "must"
HEADINGS = ("row", "amount", "unsafe", "failed", "false stops", "to STOP [s]", "recovery [s]", MUST, "met")


def faults(
    only: Annotated[list[str] | None, typer.Option(help="run this row alone; may be repeated")] = None,
    robot: Annotated[list[str] | None, typer.Option(help="of rows over all robots, these alone")] = None,
    quick: Annotated[bool, typer.Option("--quick", help="a small share of every row: a minute")] = False,
    cases: Annotated[
        int | None, typer.Option(help="of every row, all robots together; a full campaign if left out", min=1)
    ] = None,
    seed: Annotated[int, typer.Option(help="of all random numbers", min=0)] = 1,
    scheduler: SchedulerOption = None,
    workers: Annotated[
        int | None, typer.Option(help="rows that run at the same time on this machine; one if left out", min=1)
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="write the table here, as Markdown, after every row")
    ] = None,
) -> None:
    """Try faults against the supervision and count wrong reactions. Exit code 1 if a row is not met.

    A case is unsafe if motion was allowed although an oracle outside the supervisor required a stop.

    Example: irsbot faults --quick --only approach --robot irsbot2.
    """
    from irsbot_supervisor.validation.harness.oracle import supervised
    from irsbot_supervisor.validation.registry import ENTRIES  # builds robots
    from irsbot_supervisor.validation.runner import run_rows, run_rows_on

    cluster = cluster_of(scheduler, workers)
    known = {entry.name: entry for entry in ENTRIES}
    if unknown := sorted(set(only or ()) - set(known)):
        refuse(f"no row '{unknown[0]}'; there are {', '.join(known)}")
    if unknown := sorted(set(robot or ()) - set(supervised())):
        refuse(f"no settings are shipped for robot '{unknown[0]}'; there are some for {', '.join(supervised())}")
    entries = [entry for entry in ENTRIES if not only or entry.name in only]
    if quick and cases is not None:
        refuse("--quick and --cases both say how many cases to try: leave one of them out")
    orders = _orders(entries, quick, cases, seed, tuple(robot or ()), len(supervised()))
    with Bars(BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), transient=False) as bars:
        tasks = {order.entry.name: bars.add_task(order.entry.name, total=order.amount) for order in orders}
        rows: list[Row] = []
        ready = (
            run_rows(orders, workers or 1, lambda name, cases: bars.advance(tasks[name], cases))
            if scheduler is None
            else run_rows_on(orders, cluster)
        )
        for row in ready:
            bars.update(tasks[row.name], total=max(row.amount, 1), completed=max(row.amount, 1))
            rows.append(row)
            rows.sort(key=lambda row: list(known).index(row.name))
            if output is not None:  # after every row: all of them take hours
                output.write_text(_markdown(rows, known), encoding="utf-8")
    if as_json:
        print_json({"seed": seed, "quick": quick, "rows": [{**row._asdict(), "met": row.ok} for row in rows]})
    else:
        out.print(_table(rows, known))
    if broken := [row for row in rows if not row.ok]:
        raise Failed(f"not met: {'; '.join(f'{row.name} ({row.note})' for row in broken)}")


def _orders(
    entries: Sequence[Entry], quick: bool, cases: int | None, seed: int, robots: tuple[str, ...], all_robots: int
) -> list[Order]:
    """The orders to run; a row over all robots takes its share for the selected robots, unless the number of cases is
    given."""
    from irsbot_supervisor.validation.runner import Order

    orders = []
    for entry in entries:
        amount = cases or (entry.quick if quick else entry.full)
        if cases is None and entry.over_robots and robots:
            amount = max(amount * len(robots) // all_robots, 1)
        orders.append(Order(entry, amount, seed, robots if entry.over_robots else ()))
    return orders


def _cells(row: Row, must: str) -> tuple[str, ...]:
    """Cells of the table for a row, in the order of HEADINGS."""
    figures = [
        _short(row.figures[name]) if name in row.figures else "" for name in (FALSE_STOPS, TO_STOP_S, RECOVERY_S)
    ]
    return (row.name, str(row.amount), str(row.unsafe), str(row.failed), *figures, must, "yes" if row.ok else "NO")


def _more(row: Row) -> str:
    """The figures of a row without a column, and its note."""
    others = {name: value for name, value in row.figures.items() if name not in (FALSE_STOPS, TO_STOP_S, RECOVERY_S)}
    stated = [f"{name} {_short(value)}" for name, value in others.items()]
    return f"{row.name}: {'; '.join([*stated, *filter(None, (row.note,))]) or 'nothing more'}"


def _short(value: float) -> str:
    return f"{value:.0f}" if isfinite(value) and value == round(value) else f"{value:.3g}"


def _table(rows: Sequence[Row], known: dict[str, Entry]) -> Table:
    """The table, with the conditions and the figures without a column below it."""
    stated = "\n".join(f"{_more(row)}\n  must: {known[row.name].must}" for row in rows)
    table = Table(title="fault campaign", caption=stated, caption_justify="left")
    for heading in HEADINGS:
        if heading != MUST:
            table.add_column(heading, overflow="fold")
    for row in rows:
        cells = dict(zip(HEADINGS, _cells(row, known[row.name].must), strict=True))
        table.add_row(*(cell for heading, cell in cells.items() if heading != MUST))
    return table


def _markdown(rows: Sequence[Row], known: dict[str, Entry]) -> str:
    lines = [f"| {' | '.join(HEADINGS)} |", f"|{' --- |' * len(HEADINGS)}"]
    lines += [f"| {' | '.join(_cells(row, known[row.name].must))} |" for row in rows]
    return "\n".join([*lines, "", *(f"- {_more(row)}" for row in rows)]) + "\n"
