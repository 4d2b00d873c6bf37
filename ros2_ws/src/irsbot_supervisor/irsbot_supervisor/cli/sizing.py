"""`design size`: tubes of least mass under a deflection limit."""

from __future__ import annotations

from math import inf
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from irsbot_kinematics import BadInput, stiffness
from irsbot_kinematics.stiffness import Structure, Task
from irsbot_supervisor.cli.common import existing, measure, out, print_json
from irsbot_supervisor.cli.progress import progress_bar
from irsbot_supervisor.cli.stiffness import changes


def size(
    name: Annotated[str, typer.Argument(metavar="ROBOT", help="elastic design or YAML file to start from")],
    largest: Annotated[float, typer.Option(help="m: limit of the largest deflection along y0 under 100 N")],
    mean: Annotated[float, typer.Option(help="m: limit of the mean deflection")] = inf,
    robot: Annotated[str | None, typer.Option(help="robot that gives the lengths, preset or YAML file")] = None,
    set_: Annotated[list[str] | None, typer.Option("--set", help="replace a length, such as spacing=0.4")] = None,
    rigid: Annotated[list[str] | None, typer.Option(help="kind of tube that does not deform")] = None,
    outer: Annotated[str, typer.Option(help="range of the outer diameters, low:high in m")] = "0.02:0.12",
    wall: Annotated[str, typer.Option(help="range of the walls, low:high in m")] = "0.001:0.01",
    tube: Annotated[list[str] | None, typer.Option(help="kind of tube to size; all if left out")] = None,
    vary: Annotated[list[str] | None, typer.Option(help="length to vary as well, name=low:high")] = None,
    box: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="LOW HIGH LOW HIGH", help="ranges of x and z, m: 5 x 4 poses; the paper's if left out"),
    ] = None,
    seed: Annotated[int, typer.Option(help="of the search")] = 0,
    generations: Annotated[int, typer.Option(help="of the search")] = Task.generations,
    population: Annotated[int, typer.Option(help="candidates per variable and generation")] = Task.population,
    output: Annotated[Path | None, typer.Option("-o", "--output", help="write the design as a YAML file")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Tubes of least mass under a deflection limit over 20 poses, after (22) of the paper; exit code 1 if there are
    none.

    Example: irsbot design size irsbot2_table2 --largest 0.001227 --mean 0.001135 --wall 0.002:0.01 -o sized.yaml.
    """
    start = stiffness.load(name, robot=robot, **changes(set_, rigid))
    if not isinstance(start, Structure):
        raise BadInput(f"'{name}' has chains of its own; tubes are sized for the families irsbot2 and five_bar")
    if output:
        existing(output.parent, "the folder")
    lengths = {}
    for entry in vary or []:
        key, equals, ends = entry.partition("=")
        if not equals:
            raise BadInput(f"--vary must be name=low:high, got '{entry}'")
        lengths[key] = _range(key, ends)
    ranges: dict[str, Any] = {"outer": _range("outer", outer), "wall": _range("wall", wall), "lengths": lengths}
    search: dict[str, Any] = {"seed": seed, "generations": generations, "population": population}
    if box is not None:
        x, z = np.meshgrid(np.linspace(box[0], box[1], 5), np.linspace(box[2], box[3], 4))
        ranges["poses"] = np.column_stack([x.ravel(), z.ravel()])
    task = Task(start, largest, mean, tubes=tuple(tube or ()), **ranges, **search)
    with progress_bar() as progress:
        bar = progress.add_task("generation", total=generations)
        found = stiffness.size(task, lambda at, best: progress.update(bar, completed=at, description=f"{best:.4g} kg"))
    if output:
        output.write_text(stiffness.text_of(found.design), encoding="utf-8")
    if as_json:
        print_json(_facts(found) | {"seed": seed, "output": output})
        return
    _print(found)
    if output:
        out.print(f"written: {output}")


def _range(name: str, text: str) -> tuple[float, float]:
    ends = text.split(":")
    if len(ends) != 2:
        raise BadInput(f"a range is low:high, got '{text}' for {name}")
    return measure(name, ends[0]), measure(name, ends[1])


def _facts(found: stiffness.Sized) -> dict[str, Any]:
    return {
        "statistics": found.statistics._asdict(),
        "before": found.before and found.before._asdict(),
        "sections": {kind: {"outer_m": s.outer, "inner_m": s.inner} for kind, s in found.design.sections.items()},
        "geometry": vars(found.design.mechanism.geometry),
        "active": [active._asdict() for active in found.active],
        "evaluations": found.evaluations,
    }


def _print(found: stiffness.Sized) -> None:
    table = Table("tube", "outer [mm]", "inner [mm]", "wall [mm]", "mass [kg]")
    for kind, part in found.design.parts().items():
        tube = part.tube
        sizes = (tube.outer, tube.inner, 0.5 * (tube.outer - tube.inner))
        table.add_row(kind, *[f"{1e3 * value:.4g}" for value in sizes], f"{part.number * tube.mass:.4g}")
    out.print(table)
    table = Table("100 N along y0, 20 poses", "found", "before")
    for name in found.statistics._fields:
        before = "-" if found.before is None else f"{getattr(found.before, name):.4g}"
        table.add_row(name.replace("_", " "), f"{getattr(found.statistics, name):.4g}", before)
    out.print(table)
    table = Table("active: constraints that limit the design", "value", "limit")
    for active in found.active:
        table.add_row(active.name, f"{active.value:.6g}", f"{active.limit:.6g}")
    out.print(table)
