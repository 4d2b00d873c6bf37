"""Certified margins over what a robot can reach until it stands, against postures from the batch solver."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from itertools import product
from math import inf, nan

import numpy as np
import pytest
from counted import Counted
from supervised import settings_of

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.box_search import BoxBounds, Part, Search, spare_of
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.margins import PROBE, Margins, margins_of
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import (
    CUTS_IF_CLEAR,
    CUTS_OF_A_SAMPLE,
    Goal,
    StoppingPredictor,
    limits_of,
    raised,
    wider,
)
from irsbot_supervisor.validation.harness.oracle import good_postures, joint_ranges, margins, margins_along, supervised
from irsbot_supervisor.validation.in_process.reachable import errors, reach

Array = np.ndarray
every_robot = pytest.mark.parametrize("name", irs.robots())
shipped = cache(settings_of)


@cache
def postures(name: str, number: int = 12, least: float = 0.05) -> list[irs.Posture]:
    """Random postures in the usual assembly mode with all margins above `least`, over the whole joint range."""
    (settings, robot), rng = shipped(name), np.random.default_rng(7)
    low, high = joint_ranges(robot)
    Q = rng.uniform(low, high, (120 * number, len(low)))
    good = np.flatnonzero(margins(robot, settings, Q).min(axis=1) > least)[:number]
    assert len(good) >= number // 2, f"{len(good)} postures of {robot}: the fixture proves nothing"
    return [robot.mechanism.posture(tuple(Q[i].tolist()), settings.assembly_mode) for i in good]


def speeds_of(rng: np.random.Generator, settings: Settings, share: float) -> Speeds:
    most = share * np.array(settings.velocity_limit)
    return Speeds(tuple(rng.uniform(0.0, most)), tuple(rng.uniform(0.0, most)))


def box_of(settings: Settings, at: irs.Posture, speeds: Speeds, prediction_delay_s: float) -> tuple[Array, Array]:
    """The box of the theorem, by the oracle of the campaign."""
    horizon_s, error = prediction_delay_s + settings.latency_s, errors(settings)
    ahead, back = (reach(np.array([side]), horizon_s, settings)[0] for side in speeds)
    return np.array(at.joints) - back - error, np.array(at.joints) + ahead + error


def met(name: str, settings: Settings, at: irs.Posture, low: Array, high: Array, rng: np.random.Generator) -> Array:
    """(4,) smallest margins at the corners of a box and at random points in it."""
    robot, n = shipped(name)[1], len(low)
    inner = 60 if robot.mechanism.label_is_invariant else 6
    shares = np.vstack((np.array(list(product((0.0, 1.0), repeat=n))), rng.uniform(size=(inner, n))))
    points = low + shares * (high - low)
    if robot.mechanism.label_is_invariant:
        return margins(robot, settings, points).min(axis=0)
    return np.min([margins_along(robot, settings, q[None], at)[0] for q in points], axis=0)


# --- never above what is met -------------------------------------------------------------------------------------


@every_robot
@pytest.mark.parametrize(("ask", "slack_m"), [("predict", 0.0), ("wanted", 0.0), ("predict", 1e-4)])
def test_no_margin_in_the_reachable_box_is_below_its_bound(name, ask, slack_m):
    """Also where what is proved is taken from the box of an earlier sample: the robot goes on by small steps."""
    settings, robot = shipped(name)
    settings = replace(settings, encoder_offset=2e-4, geometry_tolerance_m=slack_m)
    rng, predictor = np.random.default_rng(3), StoppingPredictor(settings, robot.mechanism)
    told = 0
    for at in postures(name):
        speeds = speeds_of(rng, settings, rng.choice([0.0, 0.1, 0.5]))
        for _ in range(2):
            prediction_delay_s = float(rng.choice([0.0, 0.002, 0.01]))
            if ask == "wanted":
                certified = predictor.predict(at, speeds, prediction_delay_s, limits_of(settings, "stop"))
            else:
                certified = predictor.predict(at, speeds, prediction_delay_s)
            low, high = box_of(settings, at, speeds, prediction_delay_s)
            least = met(name, settings, at, low, high, rng)
            there = np.isfinite(margins_of(at))
            assert (np.isinf(certified) == ~there).all()
            assert (np.array(certified)[there] <= least[there] + 1e-9).all(), f"{certified} where {least} is met"
            told += min(certified) > 0.0
            step = tuple((np.array(at.joints) + rng.normal(0.0, 1e-3, len(low))).tolist())
            at = robot.mechanism.track(step, at)
            if at.status != irs.Status.SOLVED:
                break
    assert told >= 2, "nothing is ever told: the fixture proves nothing"


@every_robot
def test_no_margin_on_a_path_with_constant_rates_is_below_its_bound(name):
    """Whenever the drives brake, each at least as hard as configured."""
    settings, robot = shipped(name)
    rng, predictor, told = np.random.default_rng(9), StoppingPredictor(settings, robot.mechanism), 0
    speed, brake = np.array(settings.velocity_limit), np.array(settings.deceleration_limit)
    for at in postures(name, least=0.15):
        rates = rng.uniform(-1.0, 1.0, len(speed)) * speed * rng.choice([0.02, 0.1, 0.5])
        share = float(rng.choice([0.001, 0.01, 0.05]))
        delay_s = float(rng.choice([0.0, 0.005, 0.02]))
        near = [margin - share for margin in margins_of(at)]
        type1, type2, constraint, limb = near  # what one box does not prove: the path is halved
        certified = predictor.along(at, tuple(rates.tolist()), delay_s, (type1, type2, constraint, limb))
        told += min(certified) > 0.0
        for braked_s in (delay_s + settings.latency_s) * np.array([0.0, rng.uniform(), 1.0]):
            brakes = brake * rng.choice([1.0, 3.0], len(brake))
            going = at.joints + rates * np.linspace(0.0, braked_s, 20)[:, None]
            t = np.linspace(0.0, (np.abs(rates) / brakes).max(), 20)[:, None]
            t = np.minimum(t, np.abs(rates) / brakes)
            path = np.vstack((going, going[-1] + rates * t - 0.5 * np.sign(rates) * brakes * t * t))
            least, there = margins_along(robot, settings, path, at).min(axis=0), np.isfinite(margins_of(at))
            assert (np.array(certified)[there] <= least[there] + 1e-9).all(), f"{certified} where {least} is met"
    assert told >= 2, "nothing is ever told: the fixture proves nothing"


@pytest.mark.parametrize("name", supervised())
def test_robots_in_good_postures_are_not_stopped_for_a_bound_alone(name):
    """At rest, 2 ms ahead: where all that is met is 1.5 times the warning limit, or 0.5."""
    settings, robot = shipped(name)
    rng, predictor, bites = np.random.default_rng(5), StoppingPredictor(settings, robot.mechanism), 0
    speeds = Speeds(*((0.0,) * len(settings.velocity_limit),) * 2)
    for q in good_postures(robot, settings, 12, rng).tolist():
        at = robot.mechanism.posture(tuple(q), settings.assembly_mode)
        least = met(name, settings, at, *box_of(settings, at, speeds, 0.002), rng)
        if (least >= np.minimum(1.5 * np.array(limits_of(settings, "warn")), 0.5)).all():
            bites += 1
            assert spare_of(predictor.predict(at, speeds, 0.002), limits_of(settings, "stop")) >= 0.0
    assert bites >= 4, "the fixture proves nothing"


# --- what makes a bound smaller ----------------------------------------------------------------------------------


def fresh(name: str, at: irs.Posture, speeds: Speeds, prediction_delay_s: float, **changes) -> Array:
    """The quickest bound, which grows with nothing that makes the box larger."""
    settings, robot = shipped(name)
    predictor = StoppingPredictor(replace(settings, **{"latency_s": 1e-3, **changes}), robot.mechanism)
    return np.array(predictor.predict(at, speeds, prediction_delay_s, (-inf,) * 4))


@every_robot
def test_longer_times_higher_speeds_and_larger_errors_never_raise_a_bound(name):
    settings, _ = shipped(name)
    rng, lower = np.random.default_rng(4), 0
    for at in postures(name, least=0.2)[:6]:
        slow = speeds_of(rng, settings, 0.02)
        fast = Speeds(*(tuple(2.0 * np.array(side)) for side in slow))
        base = fresh(name, at, slow, 0.002)
        for worse in (
            fresh(name, at, slow, 0.006),
            fresh(name, at, fast, 0.002),
            fresh(name, at, slow, 0.002, latency_s=5e-3),
            fresh(name, at, slow, 0.002, encoder_offset=1e-3),
            fresh(name, at, slow, 0.002, encoder_resolution=2e-3),
            fresh(name, at, slow, 0.002, stamp_jitter_s=1e-3),
            fresh(name, at, slow, 0.002, deceleration_limit=tuple(0.5 * np.array(settings.deceleration_limit))),
        ):
            assert (worse <= base + 1e-12).all()
            lower += (worse[:2] < base[:2]).any()
    assert lower >= 8, "nothing made a bound smaller: the fixture proves nothing"


def test_a_robot_whose_arm_is_longer_than_it_should_be_is_within_the_bounds():
    settings, robot = shipped("irsbot2")
    wrong = 1e-3
    settings = replace(settings, geometry_tolerance_m=wrong)
    predictor, rng = StoppingPredictor(settings, robot.mechanism), np.random.default_rng(8)
    rest, geometry = Speeds((0.0,) * 2, (0.0,) * 2), robot.mechanism.geometry
    for at in postures("irsbot2"):
        certified = np.array(predictor.predict(at, rest, 0.002))
        low, high = box_of(settings, at, rest, 0.002)
        points = low + rng.uniform(size=(100, 2)) * (high - low)
        for size in (wrong, -wrong):
            other = irs.make_robot("irsbot2", l1=geometry.l1 + size)
            least = margins(other, settings, points).min(axis=0)
            assert (certified <= least + 1e-9).all()


# --- bounded work, and proofs that are used again ------------------------------------------------------------------


def with_time_for(settings: Settings, cuts: int) -> Settings:
    """The time of one box is stated, and that of a sample, both far too short to change the reachable box."""
    return replace(settings, bounding_s=1e-6, judging_s=(3 + 2 * cuts) * 1e-6)


@pytest.mark.parametrize("cuts", [CUTS_OF_A_SAMPLE, 1, 0])
@every_robot
def test_the_work_for_one_sample_is_bounded_however_near_a_limit_the_robot_is(name, cuts):
    """The quickest look, a wider box and the box itself; every cut makes two, and none counts for both."""
    settings, robot = shipped(name)
    settings = with_time_for(settings, cuts)
    counted = Counted(robot.mechanism)
    most = 3 + 2 * cuts
    rng, spent = np.random.default_rng(6), 0
    for at in postures(name)[:6]:
        for share in (0.1, 0.5, 1.0):
            speeds = speeds_of(rng, settings, share)
            least = met(name, settings, at, *box_of(settings, at, speeds, 0.002), rng)
            # Limits a little below what is met are those that all cuts are spent on.
            least = np.where(np.isfinite(least), least, 1.0)
            limits = {
                f"{kind}_{which}": max(float(share * value), 1e-3)
                for kind, value in zip(("type1", "type2", "constraint", "limb"), least, strict=True)
                for which, share in (("warn", 0.99), ("stop", 0.98))
            }
            predictor, counted.boxes = StoppingPredictor(replace(settings, **limits), counted), 0
            predictor.predict(at, speeds, 0.002)
            assert counted.boxes <= most
            spent += counted.boxes > min(5, most - 1)
    assert spent >= 3, "the cuts were not spent: the fixture proves nothing"


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3"])
def test_what_is_not_proved_in_time_is_not_proved(name):
    """Limits for which the cuts are needed: between what is proved without them, and with them."""
    settings, robot = shipped(name)
    rng, needed, bounds = np.random.default_rng(9), 0, BoxBounds(robot.mechanism, settings.slack_m)
    for at in postures(name, least=0.3):
        speeds = speeds_of(rng, settings, 0.3)
        low, high = box_of(settings, at, speeds, 0.002)
        goal = (*(0.98 * met(name, settings, at, low, high, rng)[:2]).tolist(), -inf, -inf)
        box = tuple(low.tolist()), tuple(high.tolist())
        few, many = (np.array(bounds.least(at, *box, goal, cuts)[:2]) for cuts in (0, CUTS_OF_A_SAMPLE))
        least = np.maximum(0.5 * (few + many), 1e-3)
        limits = {f"type{k + 1}_{which}": float(least[k]) for k in (0, 1) for which in ("warn", "stop")}
        spare = []
        for cuts in (0, CUTS_OF_A_SAMPLE):
            timed = with_time_for(replace(settings, **limits), cuts)
            certified = StoppingPredictor(timed, robot.mechanism).predict(at, speeds, 0.002)
            spare.append(float(np.min(np.subtract(certified, limits_of(timed, "stop"))[:2])))
        needed += spare[0] < 0.0 <= spare[1]
    assert needed


def near_a_limit(name: str) -> tuple[Settings, irs.Robot, irs.Posture]:
    """Settings under which the quickest box does not do, but a cut one does."""
    settings, robot = shipped(name)
    rest = Speeds(*((0.0,) * len(settings.velocity_limit),) * 2)
    for at in postures(name, least=0.3):
        quick = StoppingPredictor(settings, robot.mechanism).predict(at, rest, 0.002, (0.0,) * 4)
        for more in (0.002, 0.01, 0.03):
            kinds = ("type1_warn", "type1_stop", "type2_warn", "type2_stop")
            limit = dict.fromkeys(kinds, min(quick[:2]) + more)
            changed = replace(settings, **limit)
            certified = StoppingPredictor(changed, robot.mechanism).predict(at, rest, 0.002)
            if spare_of(certified, limits_of(changed, "stop")) >= 0.0:
                return changed, robot, at
    raise AssertionError("no such posture: the fixture proves nothing")


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3"])
def test_proved_bounds_are_reused_only_for_boxes_inside(name):
    settings, robot, at = near_a_limit(name)
    n, counted = len(at.joints), Counted(robot.mechanism)
    predictor, rest = StoppingPredictor(settings, counted), Speeds(*((0.0,) * len(at.joints),) * 2)
    certified = predictor.predict(at, rest, 0.002)
    counted.boxes = 0
    assert predictor.predict(at, rest, 0.002) == certified
    assert counted.boxes <= 1, "the same box is proved already"  # the quickest look
    for far in (0.3, 3.0):
        low, high = box_of(settings, at, rest, 0.002)
        for sign in (-1.0, 1.0):
            moved = tuple((np.array(at.joints) + sign * far * (high - low) * (np.arange(n) == 0)).tolist())
            there, counted.boxes = robot.mechanism.track(moved, at), 0
            anew = StoppingPredictor(settings, counted)
            other = predictor.predict(there, rest, 0.002)
            assert other == anew.predict(there, rest, 0.002), "a box that is not contained is bounded by itself"
    counted.boxes = 0
    predictor.predict(at, Speeds(*(settings.velocity_limit,) * 2), 0.002)
    assert counted.boxes >= 2, "a larger box is none that was proved"


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3"])
def test_a_failed_proof_is_repeated_for_a_smaller_box(name):
    """A robot that is being stopped: its boxes shrink, and soon one is proved that lies in one that was not."""
    settings, robot, at = near_a_limit(name)
    predictor, sizes, proved, again = (
        StoppingPredictor(settings, robot.mechanism),
        np.full(len(at.joints), inf),
        False,
        0,
    )
    for share in 0.5 * 0.97 ** np.arange(200):
        speeds = Speeds(*(tuple(share * np.array(settings.velocity_limit)),) * 2)
        low, high = box_of(settings, at, speeds, 0.002)
        if (high - low > 0.95 * sizes).any():
            continue  # the same box but for flicker
        sizes, before = high - low, proved
        fresh = StoppingPredictor(settings, robot.mechanism).predict(at, speeds, 0.002)
        proved = spare_of(fresh, limits_of(settings, "stop")) >= 0.0
        earlier = spare_of(predictor.predict(at, speeds, 0.002), limits_of(settings, "stop"))
        assert earlier >= 0.0 or not proved, "what is proved at once is proved with the cuts of earlier boxes, too"
        again += proved and not before
    assert again >= 1, "the fixture proves nothing"


def test_a_goal_that_a_posture_contradicts_takes_no_cuts():
    settings, robot = shipped("orthoglide")
    counted, contradicted = Counted(robot.mechanism), 0
    for at in postures("orthoglide", 24, least=0.2):
        low, high = box_of(settings, at, Speeds(*((0.0,) * 3,) * 2), 0.02)
        least = met("orthoglide", settings, at, low, high, np.random.default_rng(1))
        search, counted.boxes = BoxBounds(counted, 0.0).search(at, tuple(low), tuple(high)), 0
        assert not search.proves((float(least[0]) + 1e-3, 0.0, 0.0, 0.0), 20)
        contradicted += counted.boxes <= 3
    assert contradicted >= 20


@pytest.mark.parametrize("name", ["rrr3", "rrr3_base", "irsbot2_csc"])
def test_a_box_with_a_corner_without_a_posture_seldom_takes_cuts(name: str) -> None:
    """Whichever margin lacks most: nothing can be proved there, and a stop that is due must not wait."""
    (settings, robot), rng = shipped(name), np.random.default_rng(1)
    took = []
    for at in postures(name, 24):
        low, high = (side.tolist() for side in box_of(settings, at, speeds_of(rng, settings, 0.5), 0.002))
        corners = (robot.mechanism.track(corner, at) for corner in product(*zip(low, high, strict=True)))
        if all(corner.status == irs.Status.SOLVED for corner in corners):
            continue
        search = BoxBounds(robot.mechanism, 0.0).search(at, tuple(low), tuple(high))
        assert not search.proves(limits_of(settings, "stop"), 16)
        took.append(search.cuts)
    assert len(took) >= 3, "the fixture proves nothing"
    assert sum(took) <= 0.1 * 16 * len(took)


TO_BE_CUT = {"irsbot2": 0.2, "orthoglide": 0.04, "rrr3": 0.09, "rrr3_base": 0.08, "rpr3": 0.02, "ruu4": 0.05}
"""rad or m: half extents of boxes that need cuts."""


def search_near(name: str, at: irs.Posture) -> tuple[Search, tuple[Floats, Floats], tuple[float, ...]]:
    """A search whose goal is a little below what is met; the box and the goal."""
    settings, half = shipped(name)[0], TO_BE_CUT[name]
    low, high = np.array(at.joints) - half, np.array(at.joints) + half
    least = met(name, settings, at, low, high, np.random.default_rng(1))
    box = tuple(low.tolist()), tuple(high.tolist())
    goal = tuple(np.where(np.isfinite(least), least - 1e-4, -inf).tolist())
    return BoxBounds(shipped(name)[1].mechanism, 0.0).search(at, *box), box, goal


def extent(part: Part, low: Array, high: Array) -> tuple[Array, Array]:
    """A part of a box, by cutting it."""
    low, high = low.copy(), high.copy()
    for cut in part:
        (high if cut % 2 == 0 else low)[cut // 2] = 0.5 * (low + high)[cut // 2]
    return low, high


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3", "ruu4"])
def test_a_search_begins_with_the_parts_of_the_last_one_which_together_are_the_whole_box(name: str) -> None:
    (settings, robot), rng, divided = shipped(name), np.random.default_rng(4), 0
    for at in postures(name, least=0.2):
        search, box, goal = search_near(name, at)
        search.proves(goal, 16)
        low, high = map(np.array, box)
        for most in (1, 5, 100):
            parts = search.parts(goal, most)
            assert len(parts) <= most
            assert sum(0.5 ** len(part) for part in parts) == 1.0
            ends = [extent(part, np.zeros(len(low)), np.ones(len(low))) for part in parts]
            for point in rng.uniform(size=(50, len(low))):
                assert sum(((a <= point) & (point < b)).all() for a, b in ends) == 1
            divided += len(parts) > 5
            step = 0.05 * (high - low)
            there = robot.mechanism.track(tuple((np.array(at.joints) + step).tolist()), at)
            ahead = tuple((low + step).tolist()), tuple((high + step).tolist())
            again = BoxBounds(robot.mechanism, 0.0).search(there, *ahead, parts)
            again.proves(goal, 0)
            least, exists = met(name, settings, there, low + step, high + step, rng), np.isfinite(margins_of(there))
            assert (np.array(again.certified)[exists] <= least[exists] + 1e-9).all()
            assert again.cuts == len(parts) // 2
    assert divided >= 5, "nothing was cut: the fixture proves nothing"


@pytest.mark.parametrize("name", ["rrr3_base", "rpr3", "ruu4"])
def test_the_branch_of_a_part_is_followed_from_the_nearest_part_beside_it(name: str) -> None:
    """The straight way stays in the smallest part around both, which is what proves that all are on one branch."""
    robot, divided = shipped(name)[1], 0
    for at in postures(name, 8, least=0.2):
        search, (low, high), goal = search_near(name, at)
        search.proves(goal, 24)
        parts = sorted(search.parts(goal, 100))
        counted = Counted(robot.mechanism)
        BoxBounds(counted, 0.0).search(at, low, high, tuple(reversed(parts))).proves((-1.0,) * 4, 0)
        (_, middle), *ways = counted.ways
        for k, (start, end) in enumerate(ways):
            before = parts[:k] or [()]
            depths = [
                next((n for n, (a, b) in enumerate(zip(parts[k], other, strict=False)) if a != b), 0)
                for other in before
            ]
            beside = [other for other, depth in zip(before, depths, strict=True) if depth == max(depths)]
            ends = [0.5 * np.add(*extent(part, np.array(low), np.array(high))) for part in (*beside, parts[k])]
            ways_there = np.abs(np.subtract(ends[:-1], ends[-1])).sum(axis=1)
            np.testing.assert_allclose(end.joints, ends[-1], rtol=0.0, atol=1e-12)
            assert np.abs(np.subtract(start.joints, end.joints)).sum() <= ways_there.min() + 1e-12
            assert np.isclose(ends[:-1], start.joints, rtol=0.0, atol=1e-12).all(axis=1).any()
            straight = robot.mechanism.track(end.joints, middle)
            np.testing.assert_allclose(end.pose, straight.pose, rtol=0.0, atol=1e-9)
        divided += len(ways)
    assert divided >= 50, "nothing was cut: the fixture proves nothing"


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3"])
def test_halves_become_one_again_where_no_cut_was_needed(name: str) -> None:
    robot, less = shipped(name)[1], 0
    for at in postures(name, least=0.2):
        search, box, goal = search_near(name, at)
        search.proves(goal, 16)
        parts = search.parts(goal, 100)
        while len(parts) > 1:
            search = BoxBounds(robot.mechanism, 0.0).search(at, *box, parts)
            search.proves((-1.0,) * 4, 16)
            fewer = search.parts((-1.0,) * 4, 100)
            assert len(fewer) == len(parts) - 1
            parts, less = fewer, less + 1
    assert less >= 10, "nothing was cut: the fixture proves nothing"


@pytest.mark.parametrize("name", ["irsbot2", "rrr3", "orthoglide"])
def test_of_the_halves_that_become_one_again_the_worse_has_most_to_spare(name: str) -> None:
    """All pairs are tried, with bounds of every part on its own."""
    mechanism, joined = shipped(name)[1].mechanism, 0
    for at in postures(name, least=0.2):
        search, box, goal = search_near(name, at)
        search.proves(goal, 16)
        spare = {}
        for part in search.parts(goal, 100):
            alone = BoxBounds(mechanism, 0.0).search(at, *[tuple(end) for end in extent(part, *map(np.array, box))])
            alone.proves(goal, 0)
            spare[part] = spare_of(alone.certified, goal)
        while len(spare) > 1:
            pairs = [(part, (*part[:-1], part[-1] ^ 1)) for part in spare]
            least = {pair: min(spare[pair[0]], spare[pair[1]]) for pair in pairs if pair[1] in spare}
            one, other = max(least, key=least.__getitem__)
            if sorted(least.values())[-3:-2] == [least[one, other]]:
                break  # as good as another pair
            spare[one[:-1]] = min(spare.pop(one), spare.pop(other))
            assert set(search.parts(goal, len(spare))) == set(spare)
            joined += 1
    assert joined >= 30, "nothing was cut: the fixture proves nothing"


@pytest.mark.parametrize("name", ["irsbot2", "ruu4"])
def test_the_neighbours_of_the_middle_are_solved_once_for_all_margins_that_descend_from_there(name: str) -> None:
    robot, most = shipped(name)[1], 0
    for at in postures(name, least=0.2):
        _search, (low, high), goal = search_near(name, at)
        counted = Counted(robot.mechanism)
        BoxBounds(counted, 0.0).search(at, low, high).proves(goal, 12)
        ends = np.array([end.joints for _, end in counted.ways])
        ways = np.abs(ends - ends[0])  # the middle comes first
        neighbours = np.isclose(np.sort(ways), [0.0] * (len(low) - 1) + [PROBE], rtol=0.0, atol=1e-12).all(axis=1)
        corners = np.isclose(ways, TO_BE_CUT[name], rtol=0.0, atol=1e-12).all(axis=1)
        assert neighbours.sum() == (2 * len(low) if corners.any() else 0)
        most = max(most, corners.sum())
    assert most >= 2, "never more than one margin descended: the fixture proves nothing"


@pytest.mark.parametrize("name", ["irsbot2", "rrr3", "rrr3_base"])
def test_a_box_that_grows_is_proved_longer_than_one_that_comes_at_once(name: str) -> None:
    """With the same work for each. A limit lies between what the cuts of one sample prove, and twice as many."""
    settings, robot = shipped(name)
    counted, cuts, proved, tried = Counted(robot.mechanism), CUTS_OF_A_SAMPLE, 0, 0
    for at in postures(name, 8, least=0.2):
        search, box, goal = search_near(name, at)
        before, after = ((search.proves(goal, number), search.certified)[1] for number in (cuts, 2 * cuts))
        kind = int(np.argmax(np.subtract(after[:2], before[:2])))
        limit = before[kind] + 0.5 * (after[kind] - before[kind])
        if not after[kind] > before[kind] + 1e-3 or limit <= 0.0:
            continue
        kinds = ("type1", "type2", "constraint", "limb")
        low = {f"{other}_{end}": 1e-6 for other in kinds for end in ("stop", "warn")}
        limits = low | {f"{kinds[kind]}_{end}": limit for end in ("stop", "warn")}
        changed = replace(with_time_for(settings, cuts), hysteresis=0.0, **limits)
        predictor, stop, ends = StoppingPredictor(changed, counted), limits_of(changed, "stop"), box
        count = settings.encoder_resolution
        for size in np.linspace(0.5, 1.0, 30):
            low_ends, high_ends = wider(*box, 0.5 * (float(size) - 1.0))
            ends = tuple(a + count for a in low_ends), tuple(b - count for b in high_ends)  # `renew` adds it again
            counted.boxes = 0
            grown = spare_of(predictor.renew(at, *ends).certified, stop) >= 0.0
            assert counted.boxes <= 2 + 2 * cuts
        at_once = spare_of(StoppingPredictor(changed, counted).renew(at, *ends).certified, stop) >= 0.0
        assert grown or not at_once
        tried += not at_once
        proved += grown and not at_once
    assert tried >= 3, "one sample is always enough: the fixture proves nothing"
    assert proved >= 0.5 * tried


def clear_of_the_limits(
    name: str,
) -> Iterator[tuple[Counted, StoppingPredictor, irs.Posture, tuple[Floats, Floats], Margins]]:
    """Boxes over which the cuts of one sample do not prove the stop limits, though everything met keeps 1.15 times as
    much; with a predictor of each, and its limits."""
    settings, robot = shipped(name)
    counted, no_limits = Counted(robot.mechanism), {f"{kind}_stop": 1e-6 for kind in ("type1", "type2", "constraint")}
    for at in postures(name, 16, least=0.2):
        _search, box, goal = search_near(name, at)
        for kind, least in zip(("type1", "type2"), goal[:2], strict=True):
            limit = least / 1.15
            changed = replace(settings, **no_limits | {f"{kind}_stop": limit, f"{kind}_warn": 1.0})
            stop = limits_of(changed, "stop")
            hasty = StoppingPredictor(with_time_for(changed, CUTS_OF_A_SAMPLE), robot.mechanism)
            if limit >= 0.01 and not spare_of(hasty.renew(at, *box).certified, stop) >= 0.0:
                yield counted, StoppingPredictor(changed, counted), at, box, stop


@pytest.mark.parametrize("name", ["irsbot2", "rrr3", "rrr3_base"])
def test_where_no_limit_is_near_a_false_stop_is_worth_more_cuts(name: str) -> None:
    tried, proved = 0, 0
    for counted, predictor, at, box, stop in clear_of_the_limits(name):
        counted.boxes = 0
        proved += spare_of(predictor.renew(at, *box).certified, stop) >= 0.0
        tried += 1
        assert 2 * CUTS_OF_A_SAMPLE < counted.boxes <= 3 + 2 * CUTS_IF_CLEAR
    assert tried >= 3, "the cuts of one sample are always enough: the fixture proves nothing"
    assert proved >= 0.8 * tried


def test_a_box_that_needed_more_cuts_leaves_all_its_parts_to_the_next_unless_a_limit_is_near() -> None:
    """Twice as many boxes as parts were bounded on the way to them. Near a limit a sample has the usual work again."""
    tried = 0
    for name in TO_BE_CUT:
        for counted, predictor, at, box, stop in clear_of_the_limits(name):
            counted.boxes = 0
            proved = spare_of(predictor.renew(at, *box).certified, stop) >= 0.0
            needed, counted.boxes = counted.boxes, 0
            if proved and needed > 2 * (2 * CUTS_OF_A_SAMPLE - 1):
                predictor.renew(at, *box)
                assert counted.boxes <= needed // 2 + 1
                near = [goal._replace(clear=(inf,) * 4) for goal in predictor._goals]
                predictor._goals = tuple(near)
                predictor.renew(at, *box)
                counted.boxes = 0
                predictor.renew(at, *box)
                assert counted.boxes <= 1 + 2 * CUTS_OF_A_SAMPLE
                tried += 1
    assert tried >= 3, "fewer parts are always enough: the fixture proves nothing"


@pytest.mark.parametrize("name", ["irsbot2", "orthoglide", "rrr3"])
def test_a_goal_has_more_cuts_only_if_all_that_was_looked_at_is_clear(name: str) -> None:
    """The middle of the box is looked at first."""
    mechanism, longer = shipped(name)[1].mechanism, 0
    for at in postures(name, 8, least=0.2):
        _search, box, goal = search_near(name, at)
        above_the_middle = tuple(margin + 1e-9 for margin in margins_of(at))
        near, clear = BoxBounds(mechanism, 0.0).search(at, *box), BoxBounds(mechanism, 0.0).search(at, *box)
        Goal(goal, 2, above_the_middle, 20).is_proved_by(near)
        assert near.cuts <= 2
        assert Goal(goal, 2, (-inf,) * 4, 20).is_proved_by(clear) or clear.cuts == 20
        longer += clear.cuts > 2
    assert longer >= 4, "two cuts are always enough: the fixture proves nothing"


def test_new_settings_discard_proved_bounds():
    from supervised import configure, ready, sample

    supervisor, q = ready(pose=(0.9, -0.6))
    before = supervisor.step(sample(0, q)).state.stop_margin
    supervisor.step(configure(1, supervisor, encoder_offset=2e-3, geometry_tolerance_m=1e-3))
    assert supervisor.step(sample(2, q)).state.stop_margin < before


@every_robot
def test_an_unproved_branch_is_not_reported(name):
    """Limits of 1 cannot be proved, and what is told is still met."""
    settings, robot = shipped(name)
    rng = np.random.default_rng(2)
    strict = replace(settings, **{f"{kind}_{which}": 1.0 for kind in ("type1", "type2") for which in ("warn", "stop")})
    predictor = StoppingPredictor(strict, robot.mechanism)
    for at in postures(name)[:4]:
        speeds = speeds_of(rng, settings, 0.1)
        least = met(name, settings, at, *box_of(settings, at, speeds, 0.002), rng)
        certified = predictor.predict(at, speeds, 0.002)
        there = np.isfinite(margins_of(at))
        assert min(certified[:2]) < 1.0
        assert (np.array(certified)[there] <= least[there] + 1e-9).all()


@pytest.mark.parametrize("name", ["irsbot2_beta45", "rrr3_base"])
def test_a_box_across_a_singularity_promises_nothing_of_it(name):
    settings, robot = shipped(name)
    most = Speeds(*(settings.velocity_limit,) * 2)
    for at in postures(name):
        certified = StoppingPredictor(settings, robot.mechanism).predict(at, most, 1.0)
        assert min(certified[:2]) <= 0.0


# --- what is not known ----------------------------------------------------------------------------------------------


@every_robot
@pytest.mark.parametrize("bad", [nan, inf, 1e308, 1e200])
def test_speeds_that_are_none_promise_nothing(name, bad):
    """All margins that there are fall to 0, and no others."""
    settings, robot = shipped(name)
    at = postures(name)[0]
    n, there = len(at.joints), np.isfinite(margins_of(at))
    for joint in range(n):
        one = tuple(bad if k == joint else 0.1 for k in range(n))
        for speeds in (Speeds(one, (0.0,) * n), Speeds((0.0,) * n, one)):
            certified = np.array(StoppingPredictor(settings, robot.mechanism).predict(at, speeds, 0.002))
            assert (certified[there] == 0.0).all()
            assert np.isinf(certified[~there]).all()


@pytest.mark.parametrize("bad", [nan, inf, 1e300])
@pytest.mark.parametrize("name", ["five_bar", "irsbot2", "orthoglide", "ruu4"])
def test_a_time_without_end_promises_nothing(name, bad):
    settings, robot = shipped(name)
    at, n = postures(name)[0], len(settings.velocity_limit)
    certified = StoppingPredictor(settings, robot.mechanism).predict(at, Speeds((0.0,) * n, (0.0,) * n), bad)
    assert min(certified) == 0.0
    assert not np.isnan(certified).any()


@pytest.mark.parametrize("bad", [nan, inf, 1e308])
@pytest.mark.parametrize("name", ["five_bar", "irsbot2", "orthoglide", "ruu4"])
def test_rates_that_are_none_promise_nothing_of_a_steady_way(name, bad):
    settings, robot = shipped(name)
    at = postures(name)[0]
    certified = StoppingPredictor(settings, robot.mechanism).along(
        at, (bad,) * len(at.joints), 0.002, limits_of(settings, "stop")
    )
    assert min(certified) <= 0.0
    assert not np.isnan(certified).any()


@pytest.mark.parametrize("bad", [nan, inf])
def test_a_box_that_is_none_holds_nothing(bad):
    _settings, robot = shipped("irsbot2")
    at = postures("irsbot2")[0]
    certified = BoxBounds(robot.mechanism, 0.0).least(at, (bad, 0.0), (bad, 0.1), (0.1,) * 4, 4)
    assert min(certified) <= 0.0
    assert not np.isnan(certified).any()


@pytest.mark.parametrize("share", [0.0, 0.05, 0.5, 10.0])
def test_limits_are_raised_by_a_share_and_stay_within_reach_of_a_margin(share: float) -> None:
    limits = (0.1, 0.5, 0.99, 0.0)
    for limit, higher in zip(limits, raised(limits, share), strict=True):
        assert limit <= higher < 1.0  # a margin is at most 1: a warning can end
        assert higher == pytest.approx(limit + share * limit) or higher == pytest.approx(0.5 * (limit + 1.0))
