"""Bounds over boxes of rods of any place and motion: what the mechanisms hand to `reached`, and more."""

from __future__ import annotations

from itertools import product
from types import SimpleNamespace

import irsbot2_3d as space
import numpy as np
import pytest
from irsbot2_3d import Design
from random_boxes import PLATFORMS, WAYS, random_box
from rod_machines import Array, Machine, units
from scipy.optimize import lsq_linear, minimize

import irsbot_kinematics as irs
from irsbot_kinematics.bounds.boxes import Rod, reached
from irsbot_kinematics.bounds.cranks import Crank, levers_over
from irsbot_kinematics.bounds.quadratics import numbers
from irsbot_kinematics.bounds.sizes import distances, least_singular
from irsbot_kinematics.mechanisms.irsbot2 import Irsbot2
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

ROUNDING = 1e-10
"""m or 1: the machines are closed with rounding of their own."""


def corners(n: int) -> Array:
    return np.array(list(product((-1.0, 1.0), repeat=n)))


def steepest(box, n, m):
    """A point (s, e, g, a) with everything where it lowers the Type 2 margin fastest from the middle."""
    step, k = 0.05, 2 * n + n * m + 2 * n
    ways = step * np.concatenate([np.zeros((1, k)), np.eye(k)])
    s, e, g, a = np.split(ways, [n, n + n * m, 2 * n + n * m], axis=1)
    there, _ = box.met(s, e.reshape(-1, n, m), g, a.reshape(-1, n, 2))
    ds, de, dg, da = np.split(there.type2[0] - there.type2[1:], [n, n + n * m, 2 * n + n * m])
    down = [
        part / np.maximum(np.linalg.norm(part, axis=1, keepdims=True), 1e-12)
        for part in (de.reshape(n, m), da.reshape(n, 2))
    ]
    return np.sign(ds), down[0], np.sign(dg), down[1]


@pytest.mark.parametrize(
    ("platform", "way"),
    [(name, way) for name, (n, m) in PLATFORMS.items() for way in WAYS if n > m or way != "elsewhere"],
)
def test_rods_of_any_place_and_motion_stay_within_the_bounds_of_a_box(platform, way):
    """Near ends and lengths anywhere within their bounds, all corners, and where the Type 2 margin falls fastest."""
    rng, (n, m) = np.random.default_rng(32), PLATFORMS[platform]
    others, promised, used = 12, 0, np.zeros(3)
    for _ in range(200 if m < n > 3 else 25):
        box = random_box(rng, n, m, way)
        machine = box.machine
        stated = reached(machine.posture, box.rods(), box.arm)
        if stated is None or not stated.type2 > 0.0:
            continue
        promised += 1
        s = np.concatenate([corners(n), rng.uniform(-1.0, 1.0, (others, n)), np.zeros((1, n))])
        e, a = units(rng.normal(size=(len(s), n, m))), units(rng.normal(size=(len(s), n, 2)))
        e[::3] = machine.r * np.sign(rng.uniform(-1.0, 1.0, (len(e[::3]), n, 1)))
        g = np.sign(rng.uniform(-1.0, 1.0, s.shape))
        start, _ = box.met(0.0 * s[:1], 0.0 * e[:1], 0.0 * g[:1], 0.0 * a[:1])
        s, e, g, a = (np.concatenate([x, [worst]]) for x, worst in zip((s, e, g, a), steepest(box, n, m), strict=True))
        found, length = box.met(s, e, g, a)
        off = np.linalg.norm(found.move - s @ np.array(stated.moves), axis=1)
        changes = found.r * (length / machine.length)[..., None] - machine.r
        changes -= np.einsum("ns,rsm->nrm", s, np.array([change.ways for change in stated.changes]))
        rest, most = np.linalg.norm(changes, axis=2), np.array([change.rest for change in stated.changes])
        assert (off <= stated.aside + ROUNDING).all()
        assert (rest <= most + 10.0 * ROUNDING).all()
        assert (found.rod_turns(machine) <= stated.turn + 10.0 * ROUNDING).all()
        assert (found.type2 >= stated.type2 - ROUNDING).all()
        loss = (start.type2 - found.type2) / (start.type2 - stated.type2 + 1e-9)
        used = np.maximum(used, [(off / (stated.aside + 1e-9)).max(), (rest / (most + 1e-9)).max(), loss.max()])
    assert promised > 5, "hardly anything is promised"
    assert (used > [0.5, 0.5, 0.5]).all(), "what happens is far from what is said of displacement, directions, Type 2"


@pytest.mark.parametrize("wrong", [np.nan, np.inf])
def test_rods_with_unknown_motion_have_no_bound(wrong):
    machine = Machine(np.eye(3), np.zeros((3, 2)), np.ones(3))
    usual = Rod(1.0, (1e-3, 0.0, 0.0), 1e-6)
    assert reached(machine.posture, [usual] * 3) is not None
    for field, value in {
        "length": wrong,
        "near": (wrong, 0.0, 0.0),
        "aside": wrong,
        "growth": wrong,
        "growth_aside": wrong,
        "curve": (wrong, 0.0, 0.0),
        "growth_curve": wrong,
        "third": (wrong, 0.0, 0.0),
        "growth_third": wrong,
    }.items():
        if (field, wrong) == ("length", np.inf):  # a rod as long as can be is a plane: nothing is unknown of it
            continue
        stated = reached(machine.posture, [usual, usual._replace(**{field: value}), usual])
        assert stated is None or not stated.type2 > 0.0, field


# --- distances and singular values over a box ---


@pytest.mark.parametrize("dims", [2, 3])
def test_distances_over_a_box_stay_within_their_bounds(dims):
    """The largest is at a corner; the smallest is a least squares problem with bounds."""
    rng, used = np.random.default_rng(42), []
    for _ in range(150):
        x, n = rng.normal(size=dims), rng.integers(1, 5)
        moves = rng.normal(size=(n, dims)) * 10.0 ** rng.uniform(-3.0, 0.3)
        rest = rng.choice([0.0, 10.0 ** rng.uniform(-3.0, 0.0)])
        low, high = distances(x.tolist(), moves.tolist(), float(rest))
        nearest = np.linalg.norm(x + lsq_linear(moves.T, -x, (-1.0, 1.0), tol=1e-14).x @ moves)
        farthest = np.linalg.norm(x + corners(n) @ moves, axis=1).max() + rest
        assert max(nearest - rest, 0.0) >= low - ROUNDING
        assert farthest <= high + ROUNDING
        if low > 0.0:
            used.append(((np.linalg.norm(x) - nearest + rest) / (np.linalg.norm(x) - low), farthest / high))
    assert len(used) > 50
    assert np.median(used, axis=0)[0] > 0.95
    assert np.min(used, axis=0)[1] > 0.7


def test_distances_from_the_origin_itself():
    assert distances((0.0, 0.0), [(3.0, 4.0), (0.0, 1.0)], 0.5) == (0.0, 6.5)


def second(M):
    """Second singular values of (N, 2, k)."""
    return np.linalg.svd(M, compute_uv=False)[:, 1]


@pytest.mark.parametrize("ways", [1, 2, 3, 4])
def test_no_second_singular_value_over_a_box_is_below_its_bound(ways):
    """Sampled, searched, and with the rest that takes most of it; also where it is least inside the box."""
    rng, used, inside = np.random.default_rng(43), [], 0
    for _ in range(80):
        k = rng.integers(2, 5)
        M = rng.normal(size=(2, k)) * [[1.0], [10.0 ** rng.uniform(-1.5, 0.0)]]
        Mj = rng.normal(size=(ways, 2, k)) * 10.0 ** rng.uniform(-3.0, -0.3) * (rng.uniform(size=(ways, 1, k)) < 0.6)
        rest = rng.choice([0.0, 10.0 ** rng.uniform(-4.0, -1.0)])
        bound = least_singular(M.T.tolist(), [way.T.tolist() for way in Mj], float(rest))
        s = np.concatenate([corners(ways), rng.uniform(-1.0, 1.0, (60, ways))])
        values = second(M + np.einsum("ns,sab->nab", s, Mj))
        start = s[values.argmin()]
        best = minimize(
            lambda s, M=M, Mj=Mj: float(second((M + np.tensordot(s, Mj, 1))[None])[0]),
            start,
            method="Nelder-Mead",
            bounds=[(-1.0, 1.0)] * ways,
            options={"maxiter": 60},
        )
        lowest = min(values.min(), best.fun)
        inside += best.fun < values[: 2**ways].min() - 1e-6
        U, S, V = np.linalg.svd((M + np.tensordot(best.x, Mj, 1)), full_matrices=False)
        less = np.linalg.svd((U * [S[0], S[1] - rest]) @ V, compute_uv=False)[1] if S[1] > rest else 0.0
        assert bound <= max(lowest - rest, 0.0) + ROUNDING
        assert less >= bound - ROUNDING
        now = second(M[None])[0]
        if bound > 0.0:
            used.append((now - less) / (now - bound + 1e-9))
    assert len(used) > 30
    assert inside > 3, "the least value is always at a corner: the fixture proves nothing of the inside"
    assert np.median(used) > (0.9 if ways < 3 else 0.5)


def test_a_second_singular_value_that_vanishes_inside_the_box_is_not_promised():
    """diag(1, s) at s = 0, while both ends have 1; and diag(1, s + t) on a line."""
    assert least_singular([(1.0, 0.0), (0.0, 0.0)], [[(0.0, 0.0), (0.0, 1.0)]], 0.0) == 0.0
    way = [(0.0, 0.0), (0.0, 0.5)]
    assert least_singular([(1.0, 0.0), (0.0, 0.0)], [way, way], 0.0) == 0.0
    assert least_singular([(1.0, 0.0), (0.0, 2.0)], [way, way], 0.0) == pytest.approx(1.0, abs=0.35)


# --- levers about cranks ---


def some_quadratics(rng, n, m):
    """(n, 2, numbers): the horizontal coordinates of rods; products of joints and other effects in some of them."""
    size = 10.0 ** rng.uniform(-2.5, -0.5)
    found = size * rng.normal(size=(n, 2, numbers(n, m)))
    found[..., 1 + n :] *= size * rng.integers(0, 2)
    found[..., 0] = rng.normal(size=(n, 2))
    found[..., -1] = abs(found[..., -1])
    return found


def values_of(quadratics, s, z):
    """(N, n, 2) at points s (N, n), with the other effects and the rest at z (N, m + 1)."""
    n = s.shape[1]
    pairs = [s[:, j] * s[:, k] for k in range(n) for j in range(k)]
    terms = np.column_stack([np.ones(len(s)), s, s * s, *pairs, z])
    return np.einsum("nt,rdt->nrd", terms, quadratics)


@pytest.mark.parametrize("n", [3, 4])
def test_no_lever_of_a_rod_about_its_crank_is_below_its_bound(n):
    """Against the cross product of the rod and the direction of the turned crank."""
    rng, used = np.random.default_rng(48), []
    for _ in range(300):
        rods, q, t = some_quadratics(rng, n, n), rng.uniform(-np.pi, np.pi, n), 10.0 ** rng.uniform(-3.0, -0.3, n)
        s = np.concatenate([np.zeros((1, n)), corners(n), rng.uniform(-1.0, 1.0, (200, n))])
        z = rng.choice([-1.0, 1.0], (len(s), n + 1))
        z[0] = 0.0
        w = values_of(rods, s, z)
        levers = w[..., 0] * np.sin(q + t * s) - w[..., 1] * np.cos(q + t * s)
        sides = np.sign(levers[0])
        turning = [Crank(*row) for row in np.column_stack([np.cos(q), np.sin(q), t, sides]).tolist()]
        bounds = np.array(levers_over(rods.tolist(), turning))
        assert (levers * sides >= bounds - ROUNDING).all()
        used += ((abs(levers[0]) - (levers * sides).min(axis=0)) / (abs(levers[0]) - bounds)).tolist()
    assert np.median(used) > 0.7, "the levers are far above their bounds"


# --- constraint margins, whatever turns the rods ---


@pytest.mark.parametrize("flat", [False, True], ids=["any design", "long rods on a narrow platform"])
def test_the_constraint_margin_of_the_irsbot2_stays_above_its_bound_however_its_rods_turn(flat):
    """Against the robot in space: directions turned to first order by two joints, and by a rest besides."""
    rng, used = np.random.default_rng(45), []
    s = np.array(list(product(np.linspace(-1.0, 1.0, 5), np.linspace(-1.0, 1.0, 5), (-1.0, 1.0), (-1.0, 1.0))))
    while len(used) < 150:
        l1, l2eq, b, p, a1 = rng.uniform(0.1, 0.8, 5).tolist()
        a2, beta = a1 * rng.uniform(0.1, 0.95 if flat else 0.8), rng.uniform(0.3, 1.4)
        if flat:
            p *= 0.05
        d = Design(l1, l2eq, b, p, a1, a2, beta, 0.0)
        try:
            mechanism = Irsbot2(Irsbot2Geometry(*d))
        except irs.InvalidGeometry:
            continue
        psi = rng.uniform(-np.pi, np.pi, 2)
        turns = 10.0 ** rng.uniform(-3.0, -0.5) * rng.uniform(-1.0, 1.0, (2, 2)) * rng.integers(0, 2, (2, 1))
        if rng.uniform() < 0.5:
            turns[1] = rng.choice([-1.0, 1.0]) * turns[0]
        rests = rng.integers(0, 2) * 10.0 ** rng.uniform(-3.0, -1.0) * rng.uniform(size=2)
        screws = tuple(zip(np.cos(psi).tolist(), (-np.sin(psi)).tolist(), strict=True))
        bound = mechanism.constraint_over(SimpleNamespace(screws=screws), turns.tolist(), rests.tolist())
        there = psi - s[:, :2] @ turns.T - s[:, 2:] * rests  # psi is positive from x to -z
        kappa, now = space.kappa(d, *there.T), space.kappa(d, *psi[:, None])[0]
        assert (kappa >= bound - ROUNDING).all(), (d, psi, turns, rests)
        if bound > 0.0 and now - bound > 1e-6:
            used.append((now - kappa.min()) / (now - bound))
    assert np.quantile(used, 0.8) > 0.9, "the margin does not fall as far as is allowed for"


def test_the_constraint_margin_of_the_4_ruu_stays_above_its_bound_however_its_rods_change():
    """Upright rods, too, whose horizontal parts are short and turn much."""
    rng, used, ruu4 = np.random.default_rng(46), [], irs.make_robot("ruu4").mechanism
    while len(used) < 100:
        level = 10.0 ** rng.uniform(-1.5, 0.0, 4)
        angle = rng.uniform(-np.pi, np.pi, 4) * (rng.uniform() < 0.7)
        h = level[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        one = rng.integers(4)
        u = level[:, None, None] * rng.normal(size=(4, 4, 2)) * 10.0 ** rng.uniform(-2.0, -0.3) / 4.0
        u[:, np.arange(4) != one] *= rng.integers(0, 2)
        rest = rng.integers(0, 2) * level[:, None] * 10.0 ** rng.uniform(-2.5, -1.0) * rng.uniform(size=(4, 2))
        length = 10.0 ** rng.uniform(-1.0, 1.0)
        rods = length * np.concatenate([h[:, None], u, np.zeros((4, 14, 2)), rest[:, None]], axis=1)
        met = SimpleNamespace(rods=rods.transpose(0, 2, 1).tolist())
        bound = ruu4.constraint_over(SimpleNamespace(), met)
        s = np.concatenate([np.zeros((1, 4)), corners(4), rng.uniform(-1.0, 1.0, (100, 4))])
        e = rng.choice([-1.0, 1.0], (len(s), 4, 2)) * rest
        e[0] = 0.0
        there = units(h + np.einsum("ns,rsm->nrm", s, u) + e)
        margin = np.linalg.svd(there, compute_uv=False)[:, 1] / np.sqrt(2.0)
        assert (margin >= bound - ROUNDING).all()
        if bound > 0.0 and margin[0] - bound > 1e-6:
            used.append((margin[0] - margin.min()) / (margin[0] - bound))
    assert np.quantile(used, 0.8) > 0.5, "the margin is far above the bound"
