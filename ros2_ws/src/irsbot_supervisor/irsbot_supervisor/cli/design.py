"""`design`: the design space of the IRSBot-2 from the shell."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import degrees
from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from irsbot_kinematics import BadInput, arguments
from irsbot_kinematics import design as space
from irsbot_kinematics.description.robot_file import read_robot
from irsbot_kinematics.design import PARAMETERS, ZONES, Limits
from irsbot_kinematics.design.search import RANGES, VARIABLES, Found, NoDesign, Task, judge, search
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_supervisor.cli.cluster import SchedulerOption, WorkersOption, cluster_of
from irsbot_supervisor.cli.common import (
    Failed,
    existing,
    measure,
    out,
    print_json,
    sign_text,
)
from irsbot_supervisor.cli.progress import progress_bar
from irsbot_supervisor.cli.tables import design as tables
from irsbot_supervisor.cli.tables import design_facts as facts
from irsbot_supervisor.fleet.cluster import short_mapping

app = typer.Typer(
    help="Design space of the IRSBot-2: singularities of given lengths, and designs without them.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

FEW_DESIGNS = 10_000
"""Designs of a search of which the start of processes and the way of the calls take longer than the judging."""

RobotName = Annotated[str, typer.Argument(help="preset name (see `irsbot robots`) or YAML file of an irsbot2")]
Set = Annotated[list[str] | None, typer.Option("--set", help="replace a number, such as b=0.2 or beta=30deg")]
Vary = Annotated[list[str] | None, typer.Option("--vary", help="parameter=low:high[:steps], beta also in deg")]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON")]
Picture = Annotated[Path | None, typer.Option("-o", "--output", help="draw it: .png, .svg or .pdf")]
Zone = Annotated[str, typer.Option(help=f"zone to judge by: {', '.join(ZONES)}")]


@app.command()
def check(
    robot: RobotName,
    zone: Zone = "strict",
    mode: Annotated[str | None, typer.Option(help="judge one working mode alone, such as +-")] = None,
    below: Annotated[bool, typer.Option("--below", help="with --mode: only below the line through the motors")] = False,
    set_: Set = None,
    as_json: AsJson = False,
) -> None:
    """Check whether a design is free of singularities. Print their kinds, reasons and remedies; exit code 1 if there
    are any.

    Example: irsbot design check irsbot2 --mode +- --below.
    """
    name, g = design_named(robot, set_)
    if below and mode is None:
        raise BadInput("--below needs --mode: it judges one working mode")
    verdict, nearest = space.check(g, zone), space.moves(g, zone)
    working_mode = arguments.signs(mode) if mode is not None else None
    if working_mode is not None and working_mode not in facts.MODES:
        raise BadInput(f"modes are {', '.join(map(sign_text, facts.MODES))}, got '{mode}'")
    free = verdict.free if working_mode is None else verdict.free_in(working_mode, True if below else None)
    asked = tables.asked_for(zone, working_mode, below)
    if as_json:
        print_json({"robot": name, "asked": asked, "free": free, **facts.verdict_facts(g, verdict, nearest)})
    else:
        out.print(f"{name}: {'free' if free else 'NOT free'} ({asked})")
        for table in tables.verdict_tables(verdict, nearest):
            out.print(table)
    if not free:
        failed = ", ".join(finding.name for finding in verdict.failed())
        raise Failed(f"{name} is not free ({asked})" + (f": {failed}" if working_mode is None else ""))


@app.command()
def cells(robot: RobotName, set_: Set = None, output: Picture = None, as_json: AsJson = False) -> None:
    """Tables 1 to 3: the cells of p and l2eq around a design, and the singular postures in each.

    Example: irsbot design cells irsbot2 --set p=0.01 -o cells.png
    """
    name, g = design_named(robot, set_)
    found = space.cells(g)
    if output:
        from irsbot_supervisor.plots.design import draw_cells

        draw_cells(g, _picture(output))
    if as_json:
        print_json({"robot": name, "geometry": asdict(g), **facts.cells_facts(found)})
        return
    for table in tables.cells_tables(found):
        out.print(table)
    _tell(output)


@app.command()
def zones(robot: RobotName, set_: Set = None, output: Picture = None, as_json: AsJson = False) -> None:
    """Zones of the {l1, b} plane for the distal lengths of a design: exact bounds, printed bounds, and a picture.

    Example: irsbot design zones irsbot2_csc -o zones.png.
    """
    name, g = design_named(robot, set_)
    if output:
        from irsbot_supervisor.plots.design import draw_zones

        draw_zones(g, _picture(output))
    if as_json:
        print_json({"robot": name, "geometry": asdict(g), **facts.zones_facts(g)})
        return
    for table in tables.zones_tables(g):
        out.print(table)
    _tell(output)


@app.command()
def postures(robot: RobotName, set_: Set = None, output: Picture = None, as_json: AsJson = False) -> None:
    """All constraint-singular postures of a design: angles, gained motion, and the arm positions.

    Example: irsbot design postures irsbot2_csc -o postures.png.
    """
    name, g = design_named(robot, set_)
    found = space.singular_postures(g)
    if output:
        if not found:
            raise Failed(f"{name} has no constraint-singular posture: nothing to draw")
        from irsbot_supervisor.plots.design import draw_postures

        draw_postures(g, found, _picture(output))
    if as_json:
        print_json({"robot": name, "geometry": asdict(g), "postures": [facts.posture_facts(g, one) for one in found]})
        return
    out.print(tables.postures_table(g, found))
    _tell(output)


@app.command("search")
def search_(
    size: Annotated[float, typer.Option(help="m: l1 + l2eq, kept fixed")] = 1.0,
    slack: Annotated[float, typer.Option(help="m by which every inequality of the zone has to hold")] = Task.slack,
    zone: Zone = "strict",
    type1: Annotated[float, typer.Option(help="smallest Type 1 margin of a useful pose")] = Limits().type1,
    type2: Annotated[float, typer.Option(help="smallest Type 2 margin of a useful pose")] = Limits().type2,
    constraint: Annotated[
        float, typer.Option(help="smallest constraint margin of a useful pose")
    ] = Limits().constraint,
    vary: Annotated[list[str] | None, typer.Option(help="parameter=low:high, lengths as parts of the size")] = None,
    compare: Annotated[str, typer.Option(help="design to compare with, scaled to the size")] = "irsbot2_strict",
    seed: Annotated[int, typer.Option(help="of the search")] = 0,
    generations: Annotated[int, typer.Option(help="of the search")] = Task.generations,
    population: Annotated[int, typer.Option(help="designs per parameter and generation")] = Task.population,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the design as a robot file")] = None,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    as_json: AsJson = False,
) -> None:
    """Search for the design in a zone with the largest useful rectangle, symmetric and below the base, usual mode.

    Example: irsbot design search --slack 0.02 -o free.yaml
    """
    cluster = cluster_of(scheduler, workers)
    ranges = dict(RANGES)
    for name, entries in pairs(vary or []):
        bounds = entries.split(":")
        if name not in RANGES or len(bounds) != 2:
            raise BadInput(f"--vary must be {'|'.join(RANGES)}=low:high, got '{name}={entries}'")
        ranges[name] = (measure(name, bounds[0]), measure(name, bounds[1]))
    limits = Limits(type1, type2, constraint)
    task = Task(size, slack, zone, limits, ranges, seed, population, generations)
    other_name, other = design_named(compare, None)
    try:
        designs = generations * population * len(VARIABLES)
        with progress_bar() as progress, short_mapping(cluster, designs <= FEW_DESIGNS) as spread:
            bar = progress.add_task("generation", total=generations)

            def told(at: int, best: float) -> None:
                progress.update(bar, completed=at, description=f"{best:.4f} m2")

            found = search(task, told, spread)
    except NoDesign as error:
        raise Failed(str(error)) from None
    reference = judge(_scaled(other, size / (other.l1 + other.l2eq)), task)
    if output:
        output.write_text(_robot_text(found, task), encoding="utf-8")
    if as_json:
        print_json(
            {"found": facts.found_facts(found), other_name: facts.found_facts(reference), "limits": limits._asdict()}
        )
        return
    out.print(tables.found_table({"found": found, f"{other_name}, scaled": reference}))
    _tell(output)


def design_named(robot: str, replaced: list[str] | None) -> tuple[str, Irsbot2Geometry]:
    """Name and geometry of an irsbot2. Raises BadInput for another mechanism."""
    read = read_robot(robot, {name: measure(name, value) for name, value in pairs(replaced or [])})
    g = read.mechanism.geometry
    if not isinstance(g, Irsbot2Geometry):
        raise BadInput(f"the design space is that of the irsbot2; '{robot}' is a {read.mechanism.kind}")
    return read.name, g


def pairs(entries: list[str]) -> Iterator[tuple[str, str]]:
    """Names of parameters and what stands behind the equals signs. Raises BadInput."""
    for entry in entries:
        name, equals, value = entry.partition("=")
        if not equals or name not in (*PARAMETERS, "e"):
            raise BadInput(f"'{entry}' must be name=value with a name of {', '.join((*PARAMETERS, 'e'))}")
        yield name, value


def _picture(path: Path) -> Path:
    if path.suffix not in (".png", ".svg", ".pdf"):
        raise BadInput(f"cannot draw '{path}': the suffix must be .png, .svg or .pdf")
    existing(path.parent, "the folder")
    return path


def _tell(path: Path | None) -> None:
    if path:
        out.print(f"written: {path}", markup=False)


def _scaled(g: Irsbot2Geometry, factor: float) -> Irsbot2Geometry:
    return Irsbot2Geometry(**{name: value if name == "beta" else value * factor for name, value in asdict(g).items()})


def _robot_text(found: Found, task: Task) -> str:
    source = f"ours: irsbot design search, zone {task.zone}, slack {task.slack:g} m, seed {task.seed}"
    stated: dict[str, Any] = {
        "mechanism": "irsbot2",
        "description": f"found by search in zone {task.zone}, beta {degrees(found.geometry.beta):.4g} deg",
        "geometry": {name: {"value": value, "source": source} for name, value in asdict(found.geometry).items()},
        "usual": {"working_mode": [1, -1], "assembly_mode": -1},
    }
    return yaml.safe_dump(stated, sort_keys=False)
