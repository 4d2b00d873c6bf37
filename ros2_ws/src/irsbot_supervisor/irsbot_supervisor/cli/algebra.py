"""`algebra`: singular curves, cusps, cells, configurations and loops from the shell."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, TimeElapsedColumn
from rich.table import Table

from irsbot_kinematics import BadInput, certify_loop
from irsbot_kinematics import algebra as al
from irsbot_kinematics.analysis.loops import circle
from irsbot_kinematics.robot import robots
from irsbot_supervisor.cli.algebra_inputs import (
    AsJson,
    Box,
    Fix,
    Kind,
    Lengths,
    Name,
    Plot,
    Space,
    boxes_in,
    fixed_in,
    picture_named,
    system_of,
)
from irsbot_supervisor.cli.algebra_pictures import cusps_of, draw_singular
from irsbot_supervisor.cli.common import NUMBERS, Failed, numbers, out, print_json
from irsbot_supervisor.cli.progress import Bars

app = typer.Typer(
    help="Algebraic analysis of manipulators, exact: singular curves, cusps, cells. Needs python-flint.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

WIDE = 400
"""Columns of the terminal that a table may use."""


@app.command("names")
def list_names(as_json: AsJson = False) -> None:
    """The predefined manipulators and the shipped robots.

    Example: irsbot algebra names
    """
    rows: list[dict[str, Any]] = [
        {"name": n, "joints": s.joints, "pose": s.pose, "description": s.description}
        for n, s in ((n, al.predefined(n)) for n in al.names())
    ]
    if as_json:
        print_json(rows)
        return
    table = Table("name", "joints", "pose", "description")
    for row in rows:
        table.add_row(row["name"], " ".join(row["joints"]), " ".join(row["pose"]), row["description"])
    _print(table)


@app.command()
def singular(
    name: Name, kind: Kind = "parallel", space: Space = "joint", fix: Fix = None, box: Box = None, set_: Lengths = None,
    plot: Plot = None, as_json: AsJson = False,
) -> None:  # fmt: skip
    """Singularities projected to joint or pose space: irreducible polynomials, drawn over a box of two or three names.

    Example: irsbot algebra singular orthoglide --space pose --box x=-2:2 --box y=-2:6 --box z=-2:6 --plot surface.html
    """
    target = picture_named(plot, page=True) if plot else None
    system, ranges = system_of(name, set_), boxes_in(box)
    found = al.project(system, kind, space, fixed_in(fix))
    rows: list[dict[str, Any]] = [
        {"polynomial": str(p), "degree": p.degree, "degrees": p.degrees, "terms": p.terms, "height_bits": p.height_bits}
        for p in found
    ]
    if as_json:
        whole = {
            "degree": found.degree,
            "degrees": found.degrees,
            "terms": found.terms,
            "height_bits": found.height_bits,
        }
        print_json({"name": system.name, "kind": kind, "space": space, "factors": rows, "generator": whole})
    else:
        table = Table("factor", "degree", "partial degrees", "terms", "bits", "polynomial")
        for i, row in enumerate(rows, 1):
            text = row["polynomial"] if len(row["polynomial"]) < 90 else row["polynomial"][:87] + "..."
            cells = (row["degree"], list(row["degrees"]), row["terms"], row["height_bits"], text)
            table.add_row(str(i), *map(str, cells))
        _print(table)
        if not rows:
            out.print(f"{system.name}: no {kind} singularity projects to a hypersurface")
    if target:
        draw_singular(system, found, ranges, fixed_in(fix), target, f"{system.name}: {kind} singularities")
        out.print(f"written to {plot}") if not as_json else None


@app.command()
def cusps(name: Name, space: Space = "joint", fix: Fix = None, set_: Lengths = None, as_json: AsJson = False) -> None:
    """Cusps of a slice with two free parameters: triple direct (joint) or inverse (pose) solutions.

    Example: irsbot algebra cusps 3rpr --fix rho1=17
    """
    system = system_of(name, set_)
    found = al.cusps(system, fixed_in(fix) or None, space)
    if as_json:
        rows = [{"joints": c.joints, "pose": c.pose, "radius": c.radius} for c in found]
        print_json({"name": system.name, "status": found.status, "complex": found.complex_count, "cusps": rows})
        return
    table = Table(*[f"{n} [{system.units.get(n, 'length')}]" for n in (*system.joints, *system.pose)])
    for cusp in found:
        table.add_row(*[f"{value:.9f}" for value in (*cusp.joints.values(), *cusp.pose.values())])
    _print(table)
    known = f" of {found.complex_count} over the complex numbers" if found.complex_count else ""
    out.print(f"{len(found)} real cusps{known}; {found.status}")


@app.command()
def cells(
    name: Name, box: Box = None, fix: Fix = None, set_: Lengths = None, plot: Plot = None, as_json: AsJson = False
) -> None:
    """Decompose a slice of joint or pose space into cells with constant numbers of solutions.

    Example: irsbot algebra cells 3rpr --fix rho1=17 --box rho2=0.1:45 --box rho3=0.1:45 --plot cells.png
    """
    system = system_of(name, set_)
    ranges = boxes_in(box)
    if len(ranges) != 2:
        raise BadInput(f"give --box twice, such as --box {system.joints[0]}=0:1, got {len(ranges)} of them")
    target = picture_named(plot) if plot else None
    with _progress() as stated:
        found = al.decompose(system, tuple(ranges), tuple(ranges.values()), fixed_in(fix), progress=stated)
    counts, areas = found.counts(), found.areas()
    if as_json:
        print_json(
            {
                "name": system.name,
                "space": found.space,
                "columns": found.columns,
                "cells": len(found.cells),
                "rounded": {key: str(value) for key, value in found.rounded.items()},
                "by_count": {n: {"cells": c, "regions": r, "area": areas[n]} for n, (c, r) in counts.items()},
                "regions": [
                    {"count": r.count, "area": r.area, "sample": [str(v) for v in r.sample], "cells": len(r.cells)}
                    for r in found.regions
                ],
                "walls": [str(wall) for wall in found.walls],
            }
        )
    else:
        table = Table("solutions", "cells", "regions", "area")
        for n, (number, regions) in counts.items():
            table.add_row(str(n), str(number), str(regions), f"{areas[n]:.8f}")
        _print(table)
        if found.rounded:
            out.print(
                f"rounded for the decomposition: {', '.join(f'{k} = {float(v):g}' for k, v in found.rounded.items())}"
            )
    if target:
        from irsbot_supervisor.plots.algebra.slices import draw_cells

        points = cusps_of(system, found, fixed_in(fix))
        draw_cells(found, system, target, points)
        out.print(f"written to {target}") if not as_json else None


@app.command(context_settings=NUMBERS)
def configurations(
    name: Name, fix: Fix = None, set_: Lengths = None, plot: Plot = None,
    all_: Annotated[bool, typer.Option("--all", help="ignore the inequalities")] = False, as_json: AsJson = False,
) -> None:  # fmt: skip
    """All real configurations with given joints or a given pose. Certified: none is lost.

    Example: irsbot algebra configurations 3rpr --fix rho1=14.98 --fix rho2=15.38 --fix rho3=12 --plot six.png
    """
    target = picture_named(plot) if plot else None
    system = system_of(name, set_)
    found = al.configurations(system, fixed_in(fix), constraints=not all_)
    if as_json:
        rows = [{"pose": c.pose, "joints": c.joints, "passive": c.passive, "radius": c.radius} for c in found]
        print_json({"name": system.name, "configurations": rows})
    else:
        names = (*system.pose, *system.joints, *system.passive)
        table = Table("", *[f"{n} [{system.units.get(n, 'length')}]" for n in names])
        for i, configuration in enumerate(found, 1):
            table.add_row(str(i), *[f"{configuration.values[n]:.9f}" for n in names])
        _print(table)
    if not found:
        raise Failed(f"{system.name}: no real configuration there")
    if target:
        if not system.drawing.points:
            raise BadInput(f"{system.name} has no description for drawing")
        from irsbot_supervisor.plots.algebra.configurations import draw_configurations

        draw_configurations(system, found, target)
        out.print(f"written to {plot}") if not as_json else None


@app.command(context_settings=NUMBERS)
def loop(
    name: Name,
    centre: Annotated[str, typer.Option(help="joint positions, separated by commas")],
    radius: Annotated[float, typer.Option(help="of the circle, rad or length")],
    joints: Annotated[str, typer.Option(help="the two joints that move, counted from 1")] = "2,3",
    start: Annotated[float, typer.Option(help="angle of the start on the circle, rad")] = 0.0,
    pose: Annotated[str | None, typer.Option(help="pose near which the branch starts, separated by commas")] = None,
    samples: Annotated[int, typer.Option(help="points of the circle", min=8, max=100_000)] = 721,
    set_: Lengths = None,
    plot: Plot = None,
    as_json: AsJson = False,
) -> None:
    """Follow a branch along a circle in two joints, with a proof for every step. Shows whether the platform returns.

    Exit code 1 if the branch could not be followed.

    Example: irsbot algebra loop rrr3_base --centre -0.750995,3.180521,-0.321021 --radius 0.1 --start 5.235988 --pose
    0.08076,0.03511,1.22907.
    """
    target = picture_named(plot) if plot else None
    system = system_of(name, set_)
    middle = numbers(centre.split(","), "--centre", len(system.joints))
    pair = tuple(int(v) for v in numbers(joints.split(","), "--joints", 2))
    if not all(1 <= j <= len(system.joints) for j in pair) or pair[0] == pair[1]:
        raise BadInput(f"--joints must be two different numbers from 1 to {len(system.joints)}, got {joints}")
    at = numbers(pose.split(","), "--pose", len(system.pose)) if pose else None
    path = circle(middle, (pair[0], pair[1]), radius, start, samples)
    machine: Any = name if name in robots() and not set_ else system
    found = certify_loop(path, machine, at)
    if as_json:
        print_json({"name": system.name, **found.__dict__})
    else:
        out.print(
            f"{'certified' if found.certified else 'NOT certified'}: {found.steps} steps, "
            f"smallest |det A| {found.smallest_det:.6g}, smallest Type 2 margin {found.smallest_type2:.4g}"
        )
        out.print(f"start {found.start.tolist()}")
        out.print(f"end   {found.end.tolist()}")
        changed = "the assembly mode CHANGED without a singularity" if found.changed else "the platform comes back"
        out.print(changed if found.closed else "the joints did not come back")
    if target:
        from irsbot_kinematics.algebra.tracking import Tracker
        from irsbot_supervisor.plots.algebra.paths import draw_loop

        first = dict(zip(system.pose, found.start.tolist(), strict=True))
        way = Tracker(system).follow(path.tolist(), first)
        title = f"{system.name}: a loop of joints {joints} about ({centre}), radius {radius:g}"
        draw_loop(way.dets, [list(p.values()) for p in way.poses], system.pose, target, title)
        out.print(f"written to {target}") if not as_json else None
    if not found.certified:
        raise Failed(f"the branch was lost after point {found.lost_at} of {samples}")


def _print(table: Table) -> None:
    """Numbers are never truncated: the table takes the width it needs."""
    for column in table.columns:
        column.no_wrap = True
    Console(highlight=False, markup=False, width=WIDE).print(table)


@contextmanager
def _progress() -> Iterator[Callable[[str, int, int], None]]:
    with Bars(BarColumn(), TimeElapsedColumn()) as progress:
        task = progress.add_task("walls", total=1)

        def stated(what: str, done: int, total: int) -> None:
            progress.update(task, description=what, completed=done, total=max(total, 1))

        yield stated
