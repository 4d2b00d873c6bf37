"""Kinematics and margins of the IRSBot-2 on a large scale, against the robot in space (oracles/irsbot2_3d.py).

    python tests/campaigns/kinematics.py            # some minutes
    python tests/campaigns/kinematics.py --quick    # seconds; also run by the tests
    python tests/campaigns/kinematics.py --part sharp

round trip   random poses, every working mode: status against the annuli of both legs, pose against pose
margins      random designs and postures: Type 1, Type 2 and constraint margins against points, axes, singular values
loci         presets and random designs: margins along the curves of parallel singularities and at constraint points
guarantees   random designs, postures and boxes of joints: no margin in a box is below what was promised for it
geometry     the same for machines of every kind of which every length and place is off, each on its own
sharp        the same for bounds of second order, exact machines and wrong ones in turn; the worst points are searched
clearances   random designs and postures: no point of a locus of the same working mode is nearer than the clearance

Exit code 1 if anything exceeds its limit.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

PACKAGE = Path(__file__).parents[2] / "ros2_ws/src/irsbot_kinematics"
sys.path[:0] = [str(PACKAGE), str(PACKAGE / "test/oracles")]

import irsbot2_3d as space  # noqa: E402
import singular_points as loci  # noqa: E402
import wrong_geometry as wrong  # noqa: E402
from postures import joint_range  # noqa: E402

import irsbot_kinematics as irs  # noqa: E402
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2  # noqa: E402
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry  # noqa: E402
from irsbot_kinematics.numerics.arithmetic import ARRAYS  # noqa: E402

Array = NDArray[np.float64]
Tick = Callable[[int], None]

LIMIT = 1e-9
"""m, or 1 for margins: the largest error that passes."""
BOUNDARY_M = 1e-6
"""m: poses nearer than this to a singularity are classified, but their error does not count."""
LEAST_TYPE2 = 1e-3
"""1: where less is promised, a machine may come so near to Type 2 that Newton's method does not close it."""
ROUNDS = 3
"""How often the search for the worst point of a box goes on from the worst points found."""
PRESETS = ("irsbot2", "irsbot2_beta45", "irsbot2_csc", "irsbot2_strict")


PARTS = ("round trip", "margins", "loci", "guarantees", "geometry", "sharp", "clearances")


@dataclass
class Result:
    """What one part found."""

    name: str
    cases: int = 0
    worst: float = 0.0
    """Largest error, m or 1."""
    wrong: int = 0
    """Cases classified differently, or promises broken."""
    boxes: int = 0
    """Boxes in which something was promised, and attacked."""

    @property
    def passed(self) -> bool:
        return self.cases > 0 and self.wrong == 0 and self.worst < LIMIT

    def count(self, cases: int, errors: Array, wrong: Array) -> None:
        self.cases += cases
        self.worst = max(self.worst, float(np.max(errors, initial=0.0)))
        self.wrong += int(np.sum(wrong)) + int(np.sum(np.isnan(errors)))


def design_of(robot: irs.Robot) -> space.Design:
    g = robot.mechanism.geometry
    return space.Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)


def random_design(rng: np.random.Generator) -> tuple[irs.Robot, space.Design]:
    """Any proportions that can be assembled; l2eq on both sides of D, b0 of both signs."""
    while True:
        a1, p, l1, l2eq, b = np.exp(rng.uniform(np.log(0.03), np.log(1.0), 5)).tolist()
        a2, beta, e = a1 * rng.uniform(0.05, 0.95), rng.uniform(0.05, 1.5), rng.uniform(-0.3, 0.3)
        d = space.Design(l1, l2eq, b, p, a1, a2, beta, e)
        if 1e-3 < abs(d.b0) < 0.95 * (l1 + l2eq):
            return irs.Robot(Irsbot2(Irsbot2Geometry(*d))), d


# --- round trip ---


def round_trip(poses: int, seed: int, tick: Tick) -> Result:
    """At least `poses` reachable poses, and unreachable ones among them, in every working mode."""
    result, rng = Result("round trip"), np.random.default_rng(seed)
    for preset in PRESETS:
        robot = irs.make_robot(preset)
        d, left = design_of(robot), poses // len(PRESETS)
        farthest = abs(d.b0) + d.l1 + d.l2eq
        while left > 0:
            x, z = rng.uniform(-farthest, farthest, (2, min(2 * left + 100, 200_000))) - [[0.0], [d.e]]
            reached = _round_trip(robot, x, z, result)
            left -= reached
            tick(reached)
    return result


def _round_trip(robot: irs.Robot, x: Array, z: Array, result: Result) -> int:
    d = design_of(robot)
    far = [np.hypot(x + sign * d.b0, z + d.e) for sign in space.SIGMA]
    reach = np.min([np.minimum(d.l1 + d.l2eq - r, r - abs(d.l1 - d.l2eq)) for r in far], axis=0)
    for mode in robot.mechanism.working_modes:
        q, status, stated = robot.inverse_many(np.stack([x, z], axis=1), mode)
        expected = np.where(reach >= 0.0, irs.Status.SOLVED, irs.Status.UNREACHABLE)
        clear = np.abs(reach) > 1e-8  # the library accepts a nanometre outside
        on = status == irs.Status.SOLVED
        result.count(int(on.sum()), np.abs(stated - reach), clear & (status != expected))
        _there_and_back(robot, d, q[on], np.stack([x, z], axis=1)[on], reach[on], mode, result)
    return int(np.sum(reach > 0.0))


def _there_and_back(
    robot: irs.Robot, d: space.Design, q: Array, P: Array, reach: Array, mode: tuple[int, ...], result: Result
) -> None:
    """Elbows from the joints alone; their distance and the side of P say which gap is near and which assembly it is."""
    C = [
        -sign * d.b0 + d.l1 * np.cos(q[:, k]) + 1j * (-d.e - d.l1 * np.sin(q[:, k]))
        for k, sign in enumerate(space.SIGMA)
    ]
    point = P[:, 0] + 1j * P[:, 1]
    rods = [point - elbow for elbow in C]
    closure = np.max([np.abs(np.abs(rod) - d.l2eq) for rod in rods], axis=0)
    apart = np.abs(C[1] - C[0])
    inside = (reach > BOUNDARY_M) & (apart > BOUNDARY_M) & (2.0 * d.l2eq - apart > BOUNDARY_M)
    side = np.imag(rods[1] * np.conj(rods[0]))  # l2eq^2 sin(psi_I - psi_II), with z up
    for assembly in robot.mechanism.assembly_modes:
        mine = inside & (np.sign(side) == assembly)
        evs = robot.evaluate_many(q[mine], assembly)
        error = np.hypot(*(evs.pose - P[mine]).T)
        wrong = (evs.status != irs.Status.SOLVED) | (evs.working_mode != mode).any(axis=1)
        result.count(0, np.maximum(error, closure[mine]), wrong)


# --- margins ---


def margins(designs: int, postures: int, seed: int, tick: Tick) -> Result:
    result, rng = Result("margins"), np.random.default_rng(seed)
    for _ in range(designs):
        robot, d = random_design(rng)
        for assembly, q in _assembled(d, postures, rng):
            evs = robot.evaluate_many(q, assembly)
            psi1, psi2, *_ = space.posture(d, q[:, 0], q[:, 1], assembly)
            type1 = np.abs(np.sin(q - np.stack([psi1, psi2], axis=1))).T
            type2 = np.abs(np.sin(psi1 - psi2))
            errors = [*(evs.type1_margin.T - type1), evs.type2_margin - type2]
            errors.append(evs.constraint_margin - space.kappa(d, psi1, psi2))
            result.count(len(q), np.abs(errors).max(axis=0), evs.status != irs.Status.SOLVED)
        tick(1)
    return result


def _assembled(d: space.Design, number: int, rng: np.random.Generator) -> Iterator[tuple[int, Array]]:
    """Joints of `number` postures that exist and are a micrometre away from Type 2, by assembly mode."""
    found: list[Array] = []
    while sum(map(len, found)) < number:
        q = rng.uniform(-np.pi, np.pi, (4 * number, 2))
        with np.errstate(invalid="ignore"):
            *_, apart = space.posture(d, q[:, 0], q[:, 1], 1)
        found.append(q[(apart > BOUNDARY_M) & (2.0 * d.l2eq - apart > BOUNDARY_M)])
    q = np.concatenate(found)[:number]
    yield -1, q[: number // 2]
    yield 1, q[number // 2 :]


# --- loci ---


def singular_loci(designs: int, points: int, seed: int, tick: Tick) -> Result:
    result, rng = Result("loci"), np.random.default_rng(seed)
    robots = [irs.make_robot(preset) for preset in PRESETS]
    pairs = [(robot, design_of(robot)) for robot in robots] + [random_design(rng) for _ in range(designs)]
    for robot, d in pairs:
        for curve in (loci.parallel_rods(d, points), loci.rods_in_line(d, points)):
            legs = robot.mechanism.legs(ARRAYS, tuple(curve.q.T), (curve.x, curve.z))
            (ax, az), (bx, bz) = legs.screws
            errors = np.abs([ax * bz - az * bx, *legs.closure]).max(axis=0) if len(curve.x) else np.empty(0)
            result.count(len(curve.x), errors, np.empty(0))
        for point in loci.constraint_points(d):
            at = robot.mechanism.at(point.q, (point.x, point.z), 1, (0.0, 0.0))
            result.count(1, np.array([at.constraint, at.residual]), np.empty(0))
        tick(1)
    return result


# --- guarantees ---


def guarantees(designs: int, postures: int, samples: int, seed: int, tick: Tick) -> Result:
    """Corners and inner points of random boxes. `worst` stays 0: what counts is that no promise is broken."""
    result, rng = Result("guarantees"), np.random.default_rng(seed)
    for _ in range(designs):
        robot, d = random_design(rng)
        for assembly, q in _assembled(d, postures, rng):
            for centre in q:
                at = robot.mechanism.posture(tuple(centre.tolist()), assembly)
                travel = 10.0 ** rng.uniform(-5.0, -0.5) * rng.uniform(0.0, 1.0, 2)
                points = centre + travel * _corners_and_inner(rng, samples, 2)
                for promise in (robot.mechanism.certified_bounds, robot.mechanism.sharp_bounds):
                    bound = promise(at, travel.tolist())
                    if bound.type2 > 0.0:
                        result.boxes += 1
                        result.count(samples, np.empty(0), _broken(d, points, assembly, bound))
        tick(1)
    return result


def _corners_and_inner(rng: np.random.Generator, samples: int, size: int) -> Array:
    """(samples, size) numbers in -1..1, half of them -1 or 1."""
    inner = rng.uniform(-1.0, 1.0, (samples, size))
    return np.where(rng.uniform(size=inner.shape) < 0.5, np.sign(inner), inner)


def _broken(d: space.Design, q: Array, assembly: int, bound: irs.CertifiedBounds) -> NDArray[np.bool_]:
    with np.errstate(invalid="ignore"):
        psi1, psi2, *_ = space.posture(d, q[:, 0], q[:, 1], assembly)
    found = [np.abs(np.sin(q[:, 0] - psi1)), np.abs(np.sin(q[:, 1] - psi2)), np.abs(np.sin(psi1 - psi2))]
    kept = [value >= floor - LIMIT for value, floor in zip(found, (*bound.type1, bound.type2), strict=True)]
    if bound.constraint > 0.0:
        kept.append(space.kappa(d, psi1, psi2) >= bound.constraint - LIMIT)
    return ~np.all(kept, axis=0)


# --- geometry ---


def geometry(machines: int, postures: int, seed: int, tick: Tick) -> Result:
    """Shipped robots and others of their kinds in turn; random errors, and those that lower a margin fastest."""
    result, rng, names = Result("geometry"), np.random.default_rng(seed), irs.robots()
    for number in range(machines):
        robot = irs.make_robot(names[number // 2 % len(names)])
        if number % 2:
            robot = wrong.random_machine(robot.mechanism.kind, rng)
        for _ in range(postures):
            at = wrong.some_posture(robot, rng)
            if at is None:
                continue
            slack = robot.mechanism.length_m * 10.0 ** rng.uniform(-6.0, -2.3)
            travel = rng.integers(0, 2) * wrong.random_travel(robot, at, rng)
            bound = robot.mechanism.certified_bounds(at, travel.tolist(), slack)
            if bound.type2 > 0.0:
                result.boxes += 1
                met = wrong.margins(robot, at, *wrong.attacks(robot, at, travel, slack, rng))
                kept = wrong.columns(met) >= wrong.columns(bound)[0] - LIMIT
                result.count(len(kept), np.empty(0), ~kept.all(axis=1))
        tick(1)
    return result


# --- sharp ---


def sharp(machines: int, postures: int, seed: int, tick: Tick) -> Result:
    """Shipped robots and others of their kinds in turn, exact and wrong in turn. `worst` is by how much a margin is
    below its bound at most."""
    result, rng, names = Result("sharp"), np.random.default_rng(seed), irs.robots()
    for number in range(machines):
        robot = irs.make_robot(names[number // 2 % len(names)])
        if number % 2:
            robot = wrong.random_machine(robot.mechanism.kind, rng)
        lower, upper = joint_range(robot)
        for turn in range(postures):
            at = wrong.some_posture(robot, rng)
            if at is None:
                continue
            travel = (upper - lower) * 10.0 ** rng.uniform(-5.0, -1.0) * rng.uniform(0.0, 1.0, len(lower))
            travel = np.minimum(travel, np.minimum(np.array(at.joints) - lower, upper - np.array(at.joints)))
            slack = turn % 2 * robot.mechanism.length_m * 10.0 ** rng.uniform(-6.0, -2.3)
            bound = robot.mechanism.sharp_bounds(at, travel.tolist(), slack)
            if bound.type2 > LEAST_TYPE2:
                result.boxes += 1
                below = wrong.columns(bound)[0] - _searched(robot, at, travel, slack, rng)
                result.count(len(below), np.maximum(below, 0.0).max(axis=1), (below > LIMIT).any(axis=1))
        tick(1)
    return result


def _searched(robot: irs.Robot, at: irs.Posture, travel: Array, slack: float, rng: np.random.Generator) -> Array:
    """(N, margins) margins at corners, inner points, and where steps downhill from the worst points lead."""
    n, k = len(travel), wrong.number_of_errors(robot) if slack else 0
    limits = np.concatenate([travel, np.full(k, slack)])

    def met(points: Array) -> Array:
        errors = np.zeros((len(points), wrong.number_of_errors(robot)))
        errors[:, : k or None] = points[:, n:] * slack if k else 0.0
        return wrong.columns(wrong.margins(robot, at, points[:, :n] * travel, errors))

    step = 1e-4 * np.eye(n + k)[limits > 0.0]
    corners = np.array(list(product((-1.0, 1.0), repeat=n)))
    points = np.concatenate([np.zeros((1, n + k)), _corners_and_inner(rng, len(corners) + 16, n + k)])
    points[1 : 1 + len(corners), :n] = corners
    found = [met(points)]
    for _ in range(ROUNDS):
        worst = points[found[-1].argmin(axis=0)]  # one per margin
        around = worst[:, None] + np.concatenate([0.0 * step[:1], step])
        values = met(around.reshape(-1, n + k)).reshape(*around.shape[:2], -1)
        values = np.stack([values[:, :, i][i] for i in range(len(worst))])
        downhill = np.zeros_like(worst)
        downhill[:, limits > 0.0] = values[:, :1] - values[:, 1:]
        downhill /= np.maximum(np.abs(downhill).max(axis=1, keepdims=True), 1e-300)
        steps = 10.0 ** np.array([-2.0, -1.0, 0.0, 6.0])  # the last one leads to a corner
        points = np.clip(worst + steps[:, None, None] * downhill, -1.0, 1.0).reshape(-1, n + k)
        points = np.concatenate([worst, points])
        found.append(met(points))
    return np.concatenate(found)


# --- clearances ---


def clearances(designs: int, postures: int, points: int, seed: int, tick: Tick) -> Result:
    """`worst` is by how much a clearance exceeds the distance to a sampled point, at least that to the locus."""
    result, rng = Result("clearances"), np.random.default_rng(seed)
    for _ in range(designs):
        robot, d = random_design(rng)
        curves = loci.parallel_rods(d, points), loci.rods_in_line(d, points)
        places = {mode: [np.empty((0, 2))] for mode in robot.mechanism.working_modes}
        for curve in curves:
            legs = robot.mechanism.legs(ARRAYS, tuple(curve.q.T), (curve.x, curve.z))
            signs = np.sign(np.array(legs.normalised_levers)).T.astype(int)
            for mode, found in places.items():
                found.append(np.stack([curve.x, curve.z], axis=1)[(signs == mode).all(axis=1)])
        for point in loci.constraint_points(d):
            places.get(point.working_mode, []).append(np.array([[point.x, point.z]]))
        near = {mode: np.concatenate(found) for mode, found in places.items()}
        for assembly, q in _assembled(d, postures, rng):
            for joints in q:
                at = robot.mechanism.posture(tuple(joints.tolist()), assembly)
                others = near.get(at.working_mode, np.empty((0, 2)))
                distance = np.min(np.hypot(*(others - at.pose).T), initial=min(at.reach))
                result.count(1, np.array([max(robot.mechanism.clearance(at) - distance, 0.0)]), np.empty(0))
        tick(1)
    return result


def run(quick: bool, seed: int, progress: Progress | None = None, only: str | None = None) -> list[Result]:
    """All parts, or one; `quick` is a thousandth of the work."""
    poses, designs, postures, points = (4_000, 40, 60, 200) if quick else (1_000_000, 2_000, 300, 4_000)
    parts: list[tuple[str, int, Callable[[Tick], Result]]] = [
        ("round trip", poses, lambda tick: round_trip(poses, seed, tick)),
        ("margins", designs, lambda tick: margins(designs, postures, seed + 1, tick)),
        ("loci", designs // 4 + len(PRESETS), lambda tick: singular_loci(designs // 4, points, seed + 2, tick)),
        ("guarantees", designs // 4, lambda tick: guarantees(designs // 4, postures // 4, 60, seed + 3, tick)),
        ("geometry", designs, lambda tick: geometry(designs, postures // 20, seed + 6, tick)),
        ("sharp", designs, lambda tick: sharp(designs, postures // 20, seed + 5, tick)),
        ("clearances", designs // 4, lambda tick: clearances(designs // 4, postures, points // 2, seed + 4, tick)),
    ]
    results = []
    for name, total, part in parts:
        if only not in (None, name):
            continue
        task = progress.add_task(name, total=total) if progress else None

        def tick(done: int, task: object = task) -> None:
            if progress and task is not None:
                progress.advance(task, done)

        results.append(part(tick))
    return results


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a short version")
    parser.add_argument("--part", choices=PARTS, help="one part alone")
    parser.add_argument("--seed", type=int, default=1, help="other numbers, same statement")
    options = parser.parse_args()
    console = Console()
    with Progress(console=console) as progress:
        results = run(options.quick, options.seed, progress, options.part)
    table = Table("part", "cases", "boxes", "largest error", "wrong", "")
    for result in results:
        table.add_row(
            result.name,
            f"{result.cases:,}",
            f"{result.boxes:,}" if result.boxes else "",
            f"{result.worst:.2e}",
            str(result.wrong),
            "ok" if result.passed else "FAILED",
        )
    console.print(table)
    return 0 if all(result.passed for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
