"""Pictures of the commands `algebra`: which one belongs to what was computed."""

from __future__ import annotations

from fractions import Fraction
from pathlib import Path
from typing import Any

from irsbot_kinematics import BadInput
from irsbot_kinematics import algebra as al


def draw_singular(
    system: al.System,
    found: al.Projection,
    box: dict[str, tuple[str, str]],
    fixed: dict[str, Any],
    target: Path,
    title: str,
) -> None:
    """Draw singular curves over a box of two names, or surfaces over a box of three.

    found: irreducible polynomials. box: range of each name, rational texts. fixed: values of the others. target: .html
    only for surfaces. Raises BadInput if the box has other names than the polynomials, or not two or three.
    """
    names = tuple(box)
    wanted = {
        gen.removeprefix("t_") if gen.removeprefix("t_") in system.angles else gen for p in found for gen in p.names
    }
    if wanted and set(names) != wanted:
        raise BadInput(f"give --box for {', '.join(sorted(wanted))}, got {', '.join(names) or 'none'}")
    ranges = [(float(Fraction(low)), float(Fraction(high))) for low, high in box.values()]
    if len(names) == 3:
        from irsbot_supervisor.plots.algebra import surfaces

        draw = surfaces.page_of_surfaces if target.suffix == ".html" else surfaces.draw_surfaces
        draw(found, names, ranges, system, target, title)
        return
    if len(names) != 2:
        raise BadInput(f"a picture needs --box for two or three names, got {len(names)}")
    if target.suffix == ".html":
        raise BadInput("curves are drawn as .png, .svg or .pdf")
    from irsbot_kinematics.algebra.charts import axis
    from irsbot_kinematics.algebra.model.polynomial import ring_of
    from irsbot_kinematics.algebra.plane import Plane
    from irsbot_supervisor.plots.algebra.slices import draw_curves

    first, second = (axis(n, box[n], n in system.angles, False) for n in names)
    plane = Plane([ring_of(p, (first.gen, second.gen)) for p in found], first, second)
    points: list[al.Cusp] = []
    if system.name == "3rpr" and set(names) <= set(system.joints):
        points = list(al.cusps(system, fixed))
    draw_curves(plane, system, (names[0], names[1]), target, title, points)


def cusps_of(system: al.System, found: al.Cells, fixed: dict[str, Any]) -> list[al.Cusp]:
    """The cusps to mark in a decomposed slice: of the joint space of 3rpr; none of other manipulators."""
    if system.name != "3rpr" or found.space != "joint":
        return []
    return list(al.cusps(system, fixed))
