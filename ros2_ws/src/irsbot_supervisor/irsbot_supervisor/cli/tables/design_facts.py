"""The facts that `design` prints, as plain values for JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from irsbot_kinematics.design import (
    QUESTIONS,
    ZONES,
    Cells,
    Designs,
    Move,
    SingularPosture,
    Verdict,
    evaluate_printed_zones,
    evaluate_questions,
    find_seats,
    in_zone,
    reachability,
)
from irsbot_kinematics.design.cells import Cell
from irsbot_kinematics.design.search import Found
from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

MODES: tuple[Signs, ...] = ((1, -1), (-1, 1), (1, 1), (-1, -1))


def verdict_facts(g: Irsbot2Geometry, verdict: Verdict, nearest: tuple[Move, ...]) -> dict[str, Any]:
    return {
        "geometry": asdict(g),
        "zone": verdict.zone,
        "in_zone": verdict.free,
        "questions": [
            {
                **QUESTIONS[one.name]._asdict(),
                "name": one.name,
                "needed": one.name in ZONES[verdict.zone],
                "holds": one.holds,
                "larger_m": one.larger,
                "smaller_m": one.smaller,
            }
            for one in verdict.findings
        ],
        "zones": _both(verdict.zones, verdict.printed),
        "flow": [asdict(step) for step in verdict.flow],
        "reached": [posture_facts(g, posture) for posture, _ in verdict.postures],
        "type2": [asdict(part) for part in verdict.loci],
        "modes": [
            {"working_mode": mode, "below": below, "free": verdict.free_in(mode, below)}
            for mode in MODES
            for below in (True, False)
        ],
        "nearest": [{**asdict(move), "relative": move.relative} for move in nearest],
    }


def _both(exact: Mapping[str, bool], stated: Mapping[str, bool]) -> dict[str, Any]:
    return {name: {"exact": inside, "printed": stated.get(name)} for name, inside in exact.items()}


def cells_facts(found: Cells) -> dict[str, Any]:
    return {
        "beta": found.beta.name,
        "p": [_cell(cell) for cell in found.p],
        "l2eq": [{**_cell(cell), "counts": cell.counts, "table_3": cell.table_3} for cell in found.l2eq],
        "counts": found.counts,
        "table_3": found.table_3,
        "distal_free": found.distal_free,
    }


def _cell(cell: Cell) -> dict[str, Any]:
    return {"name": cell.name, "low": cell.low.value, "high": cell.high.value, "here": cell.here}


def zones_facts(g: Irsbot2Geometry) -> dict[str, Any]:
    d = Designs.of(g)
    found, stated = evaluate_questions(d), evaluate_printed_zones(d)
    s1g = float(d.s1g[0])
    bounds = {
        "assembled": f"|b - {s1g:.6f}| <= l1 + {g.l2eq:.6f}",
        "opposite": f"|b - {s1g:.6f}| < {g.l2eq:.6f} - l1",
        "equal": f"|b - {s1g:.6f}| > l1",
    }
    places = {}
    for name, seat in find_seats(d).items():
        centre, height = float(seat.centre[0]), float(seat.height[0])
        if centre == centre:
            places[name] = {"centre_m": centre, "height_m": height}
            bounds[name] = f"(b - {centre:.6f})^2 + {height * height:.6f} > l1^2"
    return {
        "bounds": bounds,
        "seats": places,
        "zones": _both(
            {name: bool(in_zone(name, found)[0]) for name in ZONES},
            {name: bool(flags[0]) for name, flags in stated.items() if name in ZONES},
        ),
    }


def posture_facts(g: Irsbot2Geometry, posture: SingularPosture) -> dict[str, Any]:
    where = reachability(g, posture)
    return {
        **asdict(posture),
        "kind": posture.kind.value,
        "gained": posture.gained,
        "type2": posture.is_type_2,
        "slack_m": where.slack,
        "anywhere": where.anywhere,
        "placements": [asdict(place) for place in where.placements],
    }


def found_facts(found: Found) -> dict[str, Any]:
    box = found.rectangle
    return {
        "geometry": asdict(found.geometry),
        "rectangle": {**box._asdict(), "area": box.area},
        "slack_m": found.slack,
    }
