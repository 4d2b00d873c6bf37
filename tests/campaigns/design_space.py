"""Random IRSBot-2 designs against brute force: posture counts against a scan of the torus, zones against a joint grid.

    python tests/campaigns/design_space.py --designs 2000

The scan knows only the robot in space (oracles/irsbot2_3d.py): it subdivides the (psi_I, psi_II) torus, drops every
cell in which the constraint margin cannot vanish, solves for the zeros in the others, and counts them. The joint grid
asks which of these postures, and which Type 2 postures, the arms can hold. Exit code 1 if anything disagrees.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

PACKAGE = Path(__file__).parents[2] / "ros2_ws/src/irsbot_kinematics"
sys.path[:0] = [str(PACKAGE), str(PACKAGE / "test/oracles")]

import irsbot2_3d as space  # noqa: E402

from irsbot_kinematics.design import Designs, counts, evaluate_questions, singular_postures  # noqa: E402
from irsbot_kinematics.design.proximal import holds  # noqa: E402
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry  # noqa: E402

Array = NDArray[np.float64]
Index = NDArray[np.int64]

COARSE = 32
"""Cells per turn at the start of the scan."""
HALVINGS = 5
"""Finest cells: 2 pi/(32 2^5) = 6.1e-3 rad."""
STARTS = 60
"""Starts of Newton per design besides the lowest cells: postures may share a narrow valley of the margin."""
NEWTON_STEPS = 12
STEP_RAD = 1e-5
"""Central differences of M, smooth and of size 1: error some 1e-10."""
LONGEST_RAD = 0.02
"""Newton stays near the cells that it starts from."""
ZERO = 1e-11
"""Constraint margin of a posture found by the scan; rounding leaves some 1e-15."""
SAME_RAD = 1e-5
"""Largest distance of a posture of the scan and one of the library that are the same."""
JOINT_STEPS = 180
"""Nodes per turn of the joint grid."""


class Scan(NamedTuple):
    """Singular postures that the scan found: which design, and its angles."""

    owner: Index
    psi: Array


class Report(NamedTuple):
    """Outcome of a campaign."""

    designs: int
    postures: int
    wrong_counts: int
    unmatched: int
    """Postures of the library without one of the scan within SAME_RAD, and the other way round."""
    zone_answers: int
    zone_wrong: int
    zone_unresolved: int
    """Answers that the joint grid is too coarse to tell."""


def random_designs(number: int, seed: int) -> Designs:
    """Designs on both sides of every bound of Table 2: p around a2 sin(beta), l2eq around D, arms of the same size.

    Not within 3 % of l2eq = D: there a leg nearly vanishes, and turns faster than the cells of the scan resolve.
    """
    rng = np.random.default_rng(seed)
    beta = rng.uniform(np.radians(5.0), np.radians(85.0), number)
    a1 = rng.uniform(0.1, 0.5, number)
    a2 = a1 * rng.uniform(0.05, 0.9, number)
    p = a2 * np.sin(beta) * 10.0 ** rng.uniform(-1.5, 1.5, number)
    ratio = rng.uniform(-0.8, 1.2, number)
    l2eq = (a1 - a2) * np.sin(beta) * 10.0 ** (ratio + np.copysign(0.013, ratio))
    l1 = l2eq * 10.0 ** rng.uniform(-1.0, 0.7, number)
    b0 = rng.uniform(-1.2, 1.2, number) * (l1 + l2eq)
    b = np.abs(p + a1 * np.sin(beta) + b0)
    return Designs(l1, l2eq, b, p, a1, a2, beta)


def scan(d: Designs) -> Scan:
    """All zeros of the constraint margin on the torus, one per connected patch of cells that cannot be excluded."""
    robots = _robots(d)
    i, j = np.divmod(np.arange(COARSE * COARSE), COARSE)
    number = d.b.size
    owner, i, j = np.repeat(np.arange(number), i.size), np.tile(i, number), np.tile(j, number)
    side = COARSE
    for level in range(HALVINGS + 1):
        kept = np.concatenate([_possible(robots, side, *part) for part in _parts(owner, i, j)])
        owner, i, j = owner[kept], i[kept], j[kept]
        if level < HALVINGS:
            owner = np.repeat(owner, 4)
            i = (2 * i[:, None] + np.array([0, 0, 1, 1])).ravel()
            j = (2 * j[:, None] + np.array([0, 1, 0, 1])).ravel()
            side *= 2
    start = _lowest_nearby(robots, owner, i, j, side) | _spread(owner)
    owner, psi = owner[start], _centre(np.stack([i, j], axis=1)[start], side)
    psi, margin = _solve(robots, owner, psi)
    return _distinct(owner[margin < ZERO], psi[margin < ZERO])


def _possible(robots: space.Design, side: int, owner: Index, i: Index, j: Index) -> NDArray[np.bool_]:
    """Cells in which the margin may vanish. A singular value changes by no more than the Frobenius norm of the change
    of the matrix; a rod normal is the rod's part across its first axis, so it turns by at most l2eq per that part."""
    d = _of(robots, owner)
    psi = _centre(np.stack([i, j], axis=1), side)
    half = np.pi / side
    moved_sq = half**2 * np.ones(owner.size)  # the moment: half the change of each u(psi_k)
    for k in (0, 1):
        at = space.leg(d, k, 0.0, psi[:, k])
        rod = (at.F - at.E)[:, 0, :]
        along = np.sum(rod * at.e1[:, 0, :], axis=1)
        across = np.sqrt(np.maximum(np.sum(rod * rod, axis=1) - along**2, 0.0)) - half * d.l2eq
        turn = np.divide(half * d.l2eq, across, out=np.full(owner.size, np.inf), where=across > 0.0)
        moved_sq += 2.0 * turn**2
    M = space.constraint_matrix(d, psi[:, 0], psi[:, 1])
    gram = np.linalg.eigvalsh(M @ np.swapaxes(M, 1, 2))[:, 0]
    return gram <= moved_sq


def _lowest_nearby(robots: space.Design, owner: Index, i: Index, j: Index, side: int) -> NDArray[np.bool_]:
    """Cells whose margin is not above that of any of the eight around them; the torus has no edge."""
    psi = _centre(np.stack([i, j], axis=1), side)
    margin = space.kappa(_of(robots, owner), psi[:, 0], psi[:, 1])
    key = (owner * side + i) * side + j
    order = np.argsort(key)
    lowest = np.ones(key.size, dtype=bool)
    for step_i, step_j in [(a, b) for a in (-1, 0, 1) for b in (-1, 0, 1) if a or b]:
        neighbour = (owner * side + (i + step_i) % side) * side + (j + step_j) % side
        place = order[np.minimum(np.searchsorted(key[order], neighbour), key.size - 1)]
        lowest &= (key[place] != neighbour) | (margin <= margin[place])
    return lowest


def _spread(owner: Index) -> NDArray[np.bool_]:
    """Every so many cells of each design."""
    left = np.bincount(owner)[owner]
    return np.arange(owner.size) % np.maximum(left // STARTS, 1) == 0


def _solve(robots: space.Design, owner: Index, psi: Array) -> tuple[Array, Array]:
    """Gauss-Newton on v^T M(psi) = 0 for the angles and the unit vector v; returns the angles and the margin there."""
    d = _of(robots, owner)
    matrix = lambda at: space.constraint_matrix(d, at[:, 0], at[:, 1])  # noqa: E731
    for _ in range(NEWTON_STEPS):
        M = matrix(psi)
        left = np.linalg.svd(M)[0]
        v = left[:, :, 2]
        slopes = [(matrix(psi + step) - matrix(psi - step)) / (2.0 * STEP_RAD) for step in STEP_RAD * np.eye(2)]
        columns = [np.einsum("ni,nij->nj", v, slope) for slope in slopes]
        columns += [np.einsum("ni,nij->nj", left[:, :, other], M) for other in (0, 1)]
        residual = np.einsum("ni,nij->nj", v, M)
        move = -np.linalg.pinv(np.stack(columns, axis=2), rcond=1e-12) @ residual[:, :, None]
        psi = psi + np.clip(move[:, :2, 0], -LONGEST_RAD, LONGEST_RAD)
    return psi, space.kappa(d, psi[:, 0], psi[:, 1])


def _distinct(owner: Index, psi: Array) -> Scan:
    """One of all solutions that are the same posture."""
    kept: list[int] = []
    for index in np.unique(owner):
        mine: list[int] = []
        for place in np.flatnonzero(owner == index):
            if not any(_apart(psi[place], psi[other]) < SAME_RAD for other in mine):
                mine.append(int(place))
        kept += mine
    return Scan(owner[kept], psi[kept])


def _apart(one: Array, other: Array) -> Array:
    return np.abs(np.angle(np.exp(1j * (one - other)))).max(axis=-1, initial=0.0)


def compare_counts(d: Designs, found: Scan) -> tuple[int, int]:
    """Designs whose number of postures differs from Table 1, and postures that have no partner."""
    expected = np.sum(np.array(counts(d)), axis=0)
    wrong = np.count_nonzero(np.bincount(found.owner, minlength=d.b.size) != expected)
    unmatched = 0
    for index in range(d.b.size):
        listed = np.array([posture.psi for posture in singular_postures(_geometry(d, index))]).reshape(-1, 2)
        scanned = found.psi[found.owner == index]
        near = _apart(listed[:, None, :], scanned[None, :, :]) < SAME_RAD
        unmatched += np.count_nonzero(~near.any(axis=1)) + np.count_nonzero(~near.any(axis=0))
    return int(wrong), int(unmatched)


def compare_zones(d: Designs, found: Scan) -> tuple[int, int, int]:
    """Answers checked, wrong, and too close to tell, for Z_a, both Type 2 kinds and the constraint singularities.

    A node of the grid lies within half a step of every posture, so that each elbow is at most l1 step/2 away.
    """
    q = np.arange(JOINT_STEPS) * (2.0 * np.pi / JOINT_STEPS)
    arm = np.exp(-1j * q)
    exact = evaluate_questions(d)
    robots = _robots(d)
    needed = _elbows_apart(_of(robots, found.owner), found.psi)
    total = wrong = unresolved = 0
    for index in range(d.b.size):
        l1, l2eq = d.l1[index], d.l2eq[index]
        error = l1 * (2.0 * np.pi / JOINT_STEPS)
        elbows = 2.0 * d.b[index] + l1 * (arm[None, :] - arm[:, None])
        offset = 2.0 * (d.a1[index] * np.sin(d.beta[index]) + d.p[index])
        distance = np.abs(elbows - offset)  # of the wrists' circles: radius l2eq about each
        misses = [np.abs(elbows - vector).min() for vector in needed[found.owner == index]]
        kinds = ("I1", "I2", "II", "III", "C1a", "C1b")
        held = all(holds(name, exact[name])[index] for name in kinds)
        close = min((abs(exact[name].slack[index]) for name in kinds), default=np.inf)
        seen = {
            "assembled": distance.min() <= 2.0 * l2eq,
            "opposite": distance.max() < 2.0 * l2eq,
            "equal": distance.min() > error,
            "constraint": min(misses, default=np.inf) > error,
        }
        stated = {name: bool(holds(name, exact[name])[index]) for name in ("assembled", "opposite", "equal")}
        slack = {name: abs(exact[name].slack[index]) for name in stated}
        stated["constraint"], slack["constraint"] = held, close
        for name, answer in stated.items():
            total += 1
            if 2.0 * slack[name] <= error:
                unresolved += 1
            elif answer != seen[name]:
                wrong += 1
    return total, wrong, unresolved


def _elbows_apart(d: space.Design, psi: Array) -> Array:
    """B_II - B_I that a posture of the distal loop needs, as x + i z."""
    ends = []
    for k in (0, 1):
        at = space.leg(d, k, 0.0, psi[:, k])
        ends.append(at.B - space.platform_point(d, k, at))
    apart = ends[1] - ends[0]
    return apart[:, 0] + 1j * apart[:, 2]


def campaign(number: int, seed: int, batch: int = 100) -> Report:
    """The sum over batches of random designs, each with a seed of its own."""
    parts = []
    for start in range(0, number, batch):
        d = random_designs(min(batch, number - start), seed + start)
        found = scan(d)
        parts.append((d.b.size, found.owner.size, *compare_counts(d, found), *compare_zones(d, found)))
    return Report(*(int(total) for total in np.sum(parts, axis=0)))


def _robots(d: Designs) -> space.Design:
    return space.Design(d.l1, d.l2eq, d.b, d.p, d.a1, d.a2, d.beta)


def _of(robots: space.Design, owner: Index) -> space.Design:
    return space.Design(*(np.asarray(column)[owner] for column in robots[:7]))


def _geometry(d: Designs, index: int) -> Irsbot2Geometry:
    """Large enough arms to be assembled: the distal loop does not know them."""
    column = {name: float(getattr(d, name)[index]) for name in ("l2eq", "b", "p", "a1", "a2", "beta")}
    return Irsbot2Geometry(l1=1e3, **column)


def _centre(cell: Index, side: int) -> Array:
    return (cell + 0.5) * (2.0 * np.pi / side) - np.pi


def _parts(owner: Index, i: Index, j: Index, most: int = 500_000) -> list[tuple[Index, Index, Index]]:
    return [(owner[at : at + most], i[at : at + most], j[at : at + most]) for at in range(0, owner.size, most)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--designs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    start = time.perf_counter()
    report = campaign(options.designs, options.seed)
    for name, value in report._asdict().items():
        print(f"{name.replace('_', ' '):16} {value}")
    print(f"{'seconds':16} {time.perf_counter() - start:.1f}")
    return 1 if report.wrong_counts or report.unmatched or report.zone_wrong else 0


if __name__ == "__main__":
    sys.exit(main())
