"""Mistakes in every member of a mechanism class, one at a time: `check-mechanism` finds them with default effort."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.conformance import conformance

EXAMPLE = Path(__file__).parents[1] / "docs" / "examples" / "prr3"

ERRORS = "Errors(2.0 * place, slack_m, place)"

FOUND = {
    "inverse: sign of the mode": ("+ w * k.safe_sqrt", "- w * k.safe_sqrt"),
    "inverse: sign of the reach": ("reach.append(l - h)", "reach.append(h - l)"),
    "direct: arguments of the turn": ("k.atan2(by - y, bx - x)", "k.atan2(bx - x, by - y)"),
    "legs: sign of the moment": ("ax * ry - ay * rx", "ay * rx - ax * ry"),
    "legs: sign of a screw": ("screws.append((rx, ry", "screws.append((rx, -ry"),
    "legs: sign of the levers": (
        "normalised_levers.append(-(rx * ux + ry * uy))",
        "normalised_levers.append(rx * ux + ry * uy)",
    ),
    "legs: reach": ("reach.append(l - l * k.abs", "reach.append(2.0 * l - l * k.abs"),
    "legs: closure": ("closure.append(size - l)", "closure.append(0.0 * size)"),
    "legs: wrong attachments": (
        "legs.attachments = attachments",
        "legs.attachments = (attachments[0], attachments[0], attachments[0])",
    ),
    "legs: no attachments": ("legs.attachments = attachments", "legs.attachments = ()"),
    "bias: sign of the pull": ("across * across / l - w", "across * across / l + w"),
    "travel_of: path": ("max(travel) + ends", "0.1 * max(travel) + ends"),
    "travel_of: rod": ("min(self.rods))", "5.0 * min(self.rods))"),
    "travel_of: drives": ("drives = [abs(lever) * t", "drives = [0.1 * abs(lever) * t"),
    "rods_of: near end": ("(h * ux, h * uy)", "(0.5 * h * ux, 0.5 * h * uy)"),
    "rods_of: length": ("Rod(l, (h", "Rod(3.0 * l, (h"),
    "sine_floors: turn": ("turn_rad + 0.5", "0.5 * turn_rad + 0.5"),
    "sine_floors: sign": ("sine * cos(turn_rad) -", "sine * cos(turn_rad) +"),
    "turn_rate: rate": ("max([1.0 / (l * sqrt", "max([0.5 / (l * sqrt"),
    "radius": ("self.radius = self.diameter", "self.radius = 0.3 * g.b\n        self.diameter"),
    "span": ("self.radius = self.diameter =", "self.diameter = 0.1 * g.b\n        self.radius ="),
    "length_m": ("self.length_m = g.b", "self.length_m = 1000.0 * g.b"),
    "assembly_modes": ("self.assembly_modes = (1, -1, 2, -2)", "self.assembly_modes = (1, -1)"),
    "direct: gap of the circles": ("k.minimum(slack, slack_b)", "k.maximum(slack, slack_b)"),
    "direct: gap of the centres": ("k.minimum(apart, apart_b)", "k.maximum(apart, apart_b)"),
    "travel_of: a tenth of the drives": ("drives = [abs(lever) * t", "drives = [0.9 * abs(lever) * t"),
    "travel_of: errors of the ends": ("* t + ends + length for", "* t + length for"),
    "travel_of: errors of the path": ("max(travel) + ends", "max(travel)"),
    "rods_of: errors of the ends": ("ends, 0.0, length)", "0.0, 0.0, length)"),
    "rods_of: errors of the length": ("ends, 0.0, length)", "ends, 0.0, 0.0)"),
    "rods_of: a tenth of the way": ("(h * ux, h * uy)", "(0.9 * h * ux, 0.9 * h * uy)"),
    "geometry_errors: place": ("place = sqrt(2.0) * slack_m", "place = 0.1 * slack_m"),
    "geometry_errors: ends": (ERRORS, "Errors(0.0, slack_m, place)"),
    "geometry_errors: one end": (ERRORS, "Errors(place, slack_m, place)"),
    "geometry_errors: length": (ERRORS, "Errors(2.0 * place, 0.0, place)"),
    "geometry_errors: arm": (ERRORS, "Errors(2.0 * place, slack_m, 0.0)"),
    "sine_floors: tilt of a rail": ("tilt = 2.0", "tilt = 0.0"),
}


def is_found(right: str, wrong: str, folder: Path) -> bool:
    source = (EXAMPLE / "prr3.py").read_text(encoding="utf-8")
    assert right in source, "the mistake cannot be made: the fixture proves nothing"
    (folder / "prr3.py").write_text(source.replace(right, wrong, 1), encoding="utf-8")
    shutil.copy(EXAMPLE / "prr3.yaml", folder)
    return any(check.broken for check in conformance(irs.load_robot(folder / "prr3.yaml"), joints=60))


@pytest.mark.slow
@pytest.mark.parametrize("where", FOUND)
def test_a_seeded_mistake_is_found(where: str, tmp_path: Path) -> None:
    assert is_found(*FOUND[where], tmp_path)
