"""Every argument of the library: in another form it gives the same, else it is refused in one sentence."""

from __future__ import annotations

import inspect
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from math import inf, nan
from typing import Any

import numpy as np
import pytest
from closures import CLOSURES
from postures import NAMES, ROBOTS, random_joints

import irsbot_kinematics as irs
from irsbot_kinematics import arguments
from irsbot_kinematics.numerics.tolerances import FARTHEST, PAIR_TOL_M

pytestmark = pytest.mark.usefixtures("own_cache")  # for machine code

ROBOT = irs.make_robot("irsbot2")
POSE = (0.3, -0.75)
JOINTS = tuple(ROBOT.inverse(POSE).tolist())
NOTHING: list[Any] = [None, "x", b"x", {}, object(), 1j, [[1.0], [2.0, 3.0]], "2020-01-01", True, 10**5000]
"""Refused wherever numbers are wanted."""


def numbers(n: int) -> list[Any]:
    """No n finite numbers."""
    wrong = [(), (0.1,) * (n + 1), 0.1, ["a"] * n, [None] * n, [True] * n, [1j] * n, np.zeros((1, n)), np.zeros((n, 1))]
    return [*NOTHING, *wrong, *[(bad, *(0.1,) * (n - 1)) for bad in (nan, inf, -inf, 1e300, -1e300, 10**400, "0.1")]]


def rows(n: int) -> list[Any]:
    """No table of n columns."""
    wrong = [(), (0.1,) * n, 0.1, np.zeros((2, n + 1)), np.zeros((2, 2, n)), [["a"] * n], [[None] * n], [[1j] * n]]
    return [*NOTHING, *wrong, np.zeros((2, n), dtype=bool)]


SIZES = [*NOTHING, nan, inf, -1.0, -1e-300, 1e300, [1.0], np.zeros(1), np.zeros(2), np.bool_(True), "1.0"]
"""No sizes of a force or a moment."""
MOMENTS = [size for size in SIZES if not (isinstance(size, float) and -1.0 <= size < 0.0)]
"""No moments; its sign does not matter."""
MODES = [
    (1,),
    (1, 1, 1),
    (0, 1),
    (1, 2),
    (1.5, -1),
    (nan, 1),
    1,
    "",
    "+",
    "++-",
    "up",
    b"+-",
    {},
    object(),
    [[1], [1, 2]],
    1j,
]
LABELS = [0, 2, -3, 1.5, nan, inf, "+", "1", True, (1,), [1], {}, object(), 1j, 10**400]
NAMES_OF_NONE = [3, None, nan, b"irsbot2", ["irsbot2"], {}, object(), True, np.zeros(2)]


@dataclass(frozen=True)
class Call:
    """A public function, arguments that are right, and per argument what is not."""

    function: Callable[..., Any]
    right: dict[str, Any]
    wrong: dict[str, list[Any]]


P, Q, MODE, LABEL = numbers(2), numbers(2), [*MODES], [*LABELS]
PAIR = {"pose": POSE, "joints": JOINTS}
WRONG_PAIR = {"pose": [*P, (0.3, -0.74)], "joints": [*Q, (JOINTS[0], JOINTS[1] + 1e-3)]}
CALLS = [
    Call(ROBOT.inverse, {"pose": POSE, "working_mode": (1, -1)}, {"pose": P, "working_mode": MODE}),
    Call(ROBOT.inverse_all, {"pose": POSE}, {"pose": P}),
    Call(ROBOT.inverse_solutions, {"pose": POSE}, {"pose": P}),
    Call(ROBOT.inverse_many, {"poses": [POSE], "working_mode": "+-"}, {"poses": rows(2), "working_mode": MODE}),
    Call(ROBOT.direct, {"joints": JOINTS, "assembly_mode": -1}, {"joints": Q, "assembly_mode": LABEL}),
    Call(ROBOT.direct_all, {"joints": JOINTS}, {"joints": Q}),
    Call(ROBOT.direct_solutions, {"joints": JOINTS}, {"joints": Q}),
    Call(ROBOT.posture, {"joints": JOINTS, "assembly_mode": -1}, {"joints": Q, "assembly_mode": LABEL}),
    Call(ROBOT.posture_near, {"joints": JOINTS, "pose": POSE}, {"joints": Q, "pose": P}),
    Call(ROBOT.jacobians, PAIR, WRONG_PAIR),
    Call(
        ROBOT.evaluate,
        {"joints": JOINTS, "assembly_mode": -1, "force": 2.0, "moment": 1.0},
        {"joints": Q, "assembly_mode": LABEL, "force": SIZES, "moment": MOMENTS},
    ),
    Call(
        ROBOT.evaluate_many,
        {"joints": [JOINTS], "assembly_mode": -1, "force": 2.0, "moment": 1.0},
        {"joints": rows(2), "assembly_mode": LABEL, "force": SIZES[1:], "moment": MOMENTS},
    ),
    Call(ROBOT.evaluate_many, {"joints": [JOINTS], "start": POSE}, {"joints": rows(2), "start": numbers(2)[1:]}),
    Call(ROBOT.velocity, {**PAIR, "joint_rates": (1.0, 2.0)}, {**WRONG_PAIR, "joint_rates": numbers(2)}),
    Call(
        ROBOT.acceleration,
        {**PAIR, "joint_rates": (1.0, 2.0), "joint_accelerations": (0.5, 0.25)},
        {**WRONG_PAIR, "joint_rates": numbers(2), "joint_accelerations": numbers(2)},
    ),
    Call(ROBOT.reactions, {**PAIR, "wrench": (1.0, 2.0)}, {**WRONG_PAIR, "wrench": numbers(2)}),
    Call(ROBOT.efforts, {**PAIR, "wrench": (1.0, 2.0)}, {**WRONG_PAIR, "wrench": numbers(2)}),
    Call(ROBOT.reaction_max, {**PAIR, "force": 2.0, "moment": 1.0}, {**WRONG_PAIR, "force": SIZES, "moment": MOMENTS}),
    Call(irs.make_robot("five_bar").compile, {"threads": 1}, {"threads": [0, -1, 1025, *LABELS[3:]]}),
    Call(irs.make_robot, {"name": "irsbot2", "l1": 0.375}, {"name": NAMES_OF_NONE, "l1": [*SIZES, 0.0]}),
    Call(irs.load_robot, {"path": "irsbot2", "l1": 0.375}, {"path": NAMES_OF_NONE, "l1": [*SIZES, 0.0]}),
    Call(irs.make_robot, {"name": "rrr3_base"}, {"phase": [*NOTHING, nan, (1.0,), [1.0, 2.0, "x"], np.zeros((3, 1))]}),
    Call(irs.Robot, {"mechanism": ROBOT.mechanism}, {"mechanism": [None, 3, "irsbot2", ROBOT, {}, nan]}),
    Call(
        irs.certify_loop,
        {"path": [JOINTS, JOINTS], "robot": "irsbot2", "start": POSE},
        {"path": [*rows(2), [JOINTS], [(nan, 0.0)] * 2, [(1e300, 0.0)] * 2], "robot": NAMES_OF_NONE, "start": P[1:]},
    ),
]


def ids(call: Call) -> str:
    return f"{call.function.__qualname__}({', '.join(call.right)})"


def equal(a: Any, b: Any, tolerance: float) -> bool:
    """The same up to rounding, all the way down."""
    if hasattr(a, "__dict__") and not isinstance(a, (irs.Robot, type)):
        return equal(vars(a), vars(b), tolerance)
    if isinstance(a, dict):
        return all(equal(a[key], b[key], tolerance) for key in a)
    if isinstance(a, irs.Robot):
        return repr(a).split("(")[0] == repr(b).split("(")[0]
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(equal(x, y, tolerance) for x, y in zip(a, b, strict=True))
    if isinstance(a, str) or a is None:
        return bool(a == b)
    return bool(np.allclose(np.asarray(a, float), np.asarray(b, float), rtol=tolerance, atol=tolerance, equal_nan=True))


@pytest.mark.parametrize("call", CALLS, ids=ids)
def test_a_wrong_argument_is_refused_in_one_sentence_that_names_it(call: Call) -> None:
    call.function(**call.right)
    for name, nonsense in call.wrong.items():
        for value in nonsense:
            stated = refusal(call.function, {**call.right, name: value})
            assert stated, f"{name} = {arguments.shown(value)} was taken"
            assert "\n" not in stated
            assert len(stated) < 300
            word = {"path": "path" if "start" in call.right else "robot", "name": "robot"}.get(name, name)
            assert word.split("_")[0] in stated, (name, arguments.shown(value), stated)


def refusal(function: Callable[..., Any], given: dict[str, Any]) -> str:
    """The sentence of the refusal; empty if the arguments are taken."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            function(**given)
    except (irs.BadInput, irs.InvalidGeometry) as error:
        return str(error)
    return ""


@pytest.mark.parametrize("call", CALLS, ids=ids)
def test_numbers_may_come_in_other_forms(call: Call) -> None:
    wanted = call.function(**call.right)

    def is_numbers(value: Any) -> bool:
        return not isinstance(value, (str, irs.Mechanism, int)) and value is not None

    forms: list[tuple[Callable[[Any], Any], float]] = [
        (lambda v: np.array(v) if np.ndim(v) else np.float64(v), 1e-12),
        (lambda v: np.array(v).tolist(), 1e-12),
        (lambda v: np.float32(v), 0.01),
    ]
    pairs = {"pose", "joints"} <= set(call.right) and "start" not in call.right
    for form, tolerance in forms:
        if pairs and tolerance > 1e-6:  # seven digits of an angle are no pair to PAIR_TOL_M, or by chance
            continue
        given = {name: form(value) if is_numbers(value) else value for name, value in call.right.items()}
        assert equal(wanted, call.function(**given), tolerance), form


def test_whole_numbers_of_numpy_and_python_are_numbers() -> None:
    q = ROBOT.inverse((0, -1))
    assert (q == ROBOT.inverse((0.0, -1.0))).all()
    assert (q == ROBOT.inverse(np.array([0, -1]))).all()
    assert (ROBOT.reaction_max((0, -1), q, np.int64(3)) == ROBOT.reaction_max((0.0, -1.0), q, 3.0)).all()
    lengths = {"l1": np.float32(0.5), "l2": np.int64(1), "b": np.array(0.25)}
    del lengths["b"]
    found = irs.make_robot("five_bar", **lengths).mechanism.geometry
    assert (found.l1, found.l2) == (0.5, 1.0)
    assert {type(found.l1), type(found.l2)} == {float}


def test_every_public_function_stands_in_the_table() -> None:
    """Classes that are only answers, and properties, take no arguments of a user."""
    tried = {call.function.__name__ for call in CALLS}
    methods = {name for name, _ in inspect.getmembers(irs.Robot, inspect.isfunction) if not name.startswith("_")}
    functions = {name for name in irs.__all__ if inspect.isfunction(getattr(irs, name))} - {"robots"}
    assert methods | functions <= tried


@pytest.mark.parametrize("name", NAMES)
def test_pose_and_joints_that_do_not_close_are_refused_by_every_robot(name: str) -> None:
    """By the oracle's own closure equations, 10 tolerances off; at a tenth of one they are taken."""
    robot, rng = ROBOTS[name], np.random.default_rng(20)
    mechanism, closure = robot.mechanism, CLOSURES[robot.mechanism.kind]
    refused = taken = 0
    for q in random_joints(robot, rng, 60):
        at = mechanism.posture(tuple(q.tolist()), mechanism.usual_assembly_mode)
        if at.status != irs.Status.SOLVED or at.type2 < 0.1 or min(at.type1) < 0.1:
            continue
        near, far = (np.array(at.pose) + np.eye(len(at.pose))[0] * off * PAIR_TOL_M for off in (0.1, 1e3))
        robot.jacobians(near, q)
        taken += 1
        if np.abs(closure(mechanism.geometry, q, far)).max() > 20.0 * PAIR_TOL_M:
            ones = np.ones(len(q))
            asked: list[tuple[Callable[..., Any], tuple[Any, ...]]] = [
                (robot.jacobians, ()),
                (robot.velocity, (ones,)),
                (robot.acceleration, (ones, ones)),
                (robot.reactions, (ones,)),
                (robot.efforts, (ones,)),
                (robot.reaction_max, (1.0,)),
            ]
            for ask, rest in asked:
                with pytest.raises(irs.BadInput, match="belong together"):
                    ask(far, q, *rest)
            refused += 1
    assert min(refused, taken) > 3


@pytest.mark.parametrize("name", NAMES)
def test_no_bound_is_above_the_margin_for_a_travel_or_an_error_that_is_none(name: str) -> None:
    robot, rng = ROBOTS[name], np.random.default_rng(21)
    mechanism, n, tried = robot.mechanism, len(robot.mechanism.joints), 0
    for q in random_joints(robot, rng, 40):
        at = mechanism.posture(tuple(q.tolist()), mechanism.usual_assembly_mode)
        if at.status != irs.Status.SOLVED:
            continue
        tried += 1
        for size in (1e-9, 1e-3, 0.1, 10.0):
            mixed = (-size, *(0.01 * size,) * (n - 1))
            for travel, slack in [((-size,) * n, 0.0), (mixed, 0.0), (mixed[::-1], 0.0), ((0.0,) * n, -size)]:
                for bounds in (mechanism.certified_bounds, mechanism.sharp_bounds):
                    low = bounds(at, travel, slack)
                    assert low.type2 == 0.0
                    assert max(low.type1) == 0.0 or mechanism.kind in ("rpr3", "rails2")  # a strut's is always 1
    assert tried > 2


def test_solutions_have_labels_and_say_whether_the_joints_are_in_range() -> None:
    """Orthoglide: slides of 0 to 4 m. From the reach of the rod: q = x -+ sqrt(L^2 - y^2 - z^2) + constant."""
    robot = irs.make_robot("orthoglide")
    seen = set()
    for pose in [(0.0, 0.0, 0.0), (0.2, -0.3, 0.1), (-0.4, 0.2, 0.5)]:
        solutions = robot.inverse_solutions(pose)
        assert [s.working_mode for s in solutions] == list(robot.mechanism.working_modes)
        for solution, plain in zip(solutions, robot.inverse_all(pose), strict=True):
            assert (solution.joints == plain).all()
            assert (robot.inverse(pose, solution.working_mode) == plain).all()
            inside = all(c.lower <= q <= c.upper for c, q in zip(robot.mechanism.joints, plain, strict=True))
            assert solution.within_range == inside
            seen.add(inside)
            back = robot.direct_solutions(plain)
            assert [s.assembly_mode for s in back] == [-1, 1]
            assert [s.within_range for s in back] == [inside] * 2
            nearest = min(back, key=lambda s: float(np.abs(s.pose - pose).max()))
            assert nearest.pose == pytest.approx(pose, abs=1e-9)
            assert nearest.working_mode == solution.working_mode
            assert robot.posture_near(plain, pose).assembly_mode == nearest.assembly_mode
    assert seen == {True, False}


def test_an_angle_is_in_its_range_by_whole_turns() -> None:
    joint = irs.Coordinate("joint", "rad", 3.0, 5.0)
    assert [joint.contains(q) for q in (2.9, 3.1, 4.9, 5.1, 4.0 - 2 * np.pi, 4.0 + 20 * np.pi, -1.0, nan)] == [
        False, True, True, False, True, True, False, False,
    ]  # fmt: skip
    slide = irs.Coordinate("slide", "m", 3.0, 5.0)
    assert [slide.contains(q) for q in (4.0, 4.0 - 2 * np.pi)] == [True, False]


def test_joints_of_so_many_turns_that_no_digits_are_left_are_not_solved() -> None:
    for size in (2.0 * FARTHEST, 1e300):
        assert ROBOT.mechanism.posture((size, 0.1), -1).status == irs.Status.INVALID
        assert ROBOT.evaluate_many([(size, 0.1)]).status[0] == irs.Status.INVALID
        joints, status, _ = ROBOT.inverse_many([(size, 0.1)])
        assert status[0] == irs.Status.INVALID
        assert np.isnan(joints).all()
    with pytest.raises(irs.BadInput, match="joints"):
        ROBOT.direct((1e300, 0.1))


# --- robots whose labels do not follow a branch ---


def motion(robot: irs.Robot, rng: np.random.Generator, samples: int) -> np.ndarray[Any, Any] | None:
    """A straight joint motion whose branch, followed in steps ten times finer, changes its label."""
    mechanism = robot.mechanism
    for _ in range(400):
        first, last = random_joints(robot, rng, 2)
        last = first + 0.3 * (last - first)
        fine = np.linspace(first, last, 10 * (samples - 1) + 1)
        at = mechanism.posture(tuple(fine[0].tolist()), mechanism.usual_assembly_mode)
        poses = []
        for q in fine:
            at = mechanism.track(tuple(q.tolist()), at)
            if at.status != irs.Status.SOLVED or at.type2 < 0.05:
                break
            poses.append(at.pose)
        if len(poses) == len(fine):
            labelled = mechanism.posture(tuple(last.tolist()), mechanism.usual_assembly_mode)
            if labelled.status != irs.Status.SOLVED or np.abs(np.array(labelled.pose) - poses[-1]).max() > 0.01:
                return np.column_stack([fine[::10], np.array(poses)[::10]])
    return None


@pytest.mark.parametrize("name", [name for name in NAMES if not ROBOTS[name].mechanism.label_is_invariant])
def test_samples_of_a_motion_are_followed_on_their_branch_and_a_fixed_label_is_warned_of(name: str) -> None:
    robot = ROBOTS[name]
    n = len(robot.mechanism.joints)
    found = motion(robot, np.random.default_rng(22), 60)
    assert found is not None, "no motion along which the label changes: the fixture proves nothing"
    joints, poses = found[:, :n], found[:, n:]
    followed = robot.evaluate_many(joints, start=poses[0], force=1.0)
    assert (followed.status == irs.Status.SOLVED).all()
    np.testing.assert_allclose(followed.pose, poses, atol=1e-6)
    with pytest.warns(irs.LabelsVary, match="start"):
        labelled = robot.evaluate_many(joints)
    assert np.nanmax(np.abs(labelled.pose - poses)) > 0.01 or (labelled.status != irs.Status.SOLVED).any()
    for k in (0, 30, 59):
        at = robot.posture_near(joints[k], poses[k])
        assert followed.type2_margin[k] == pytest.approx(at.type2)
        assert followed.type1_margin[k] == pytest.approx(at.type1)
        assert tuple(followed.working_mode[k]) == at.working_mode
        assert followed.reaction_max[k] == pytest.approx(robot.reaction_max(at.pose, joints[k], 1.0))


def test_a_motion_that_loses_its_branch_has_no_poses_from_there_on() -> None:
    pose = (0.3, -0.75)
    joints = [JOINTS, (nan, 0.0), JOINTS]
    found = ROBOT.evaluate_many(joints, start=pose)
    assert [status == irs.Status.SOLVED for status in found.status] == [True, False, False]
    assert np.isnan(found.pose[1:]).all()
    assert np.isnan(found.type2_margin[1:]).all()
    assert len(ROBOT.evaluate_many(np.empty((0, 2)), start=pose).status) == 0


@pytest.mark.parametrize(
    ("first", "status"),
    [((nan, 0.0), irs.Status.INVALID), ((2e6, 0.0), irs.Status.INVALID), ((np.pi, 0.0), irs.Status.UNREACHABLE)],
)
def test_a_motion_that_begins_without_a_pose_has_none_at_all(first, status) -> None:
    robot = irs.make_robot("five_bar", l1=0.4, l2=0.3, b=0.3)
    found = robot.evaluate_many([first, (1.0, np.pi - 1.0)], start=(0.0, -0.5))
    assert found.status.tolist() == [status] * 2
    assert np.isnan(found.pose).all()
    with pytest.raises((irs.NotAssembled, irs.BadInput)):
        robot.posture_near(first, (0.0, -0.5))


def test_a_single_sample_and_robots_whose_labels_hold_are_not_warned_of() -> None:
    robot = irs.make_robot("rrr3_base")
    q = robot.inverse((0.0, 0.0, 0.3)) if robot.inverse_all((0.0, 0.0, 0.3)) else np.zeros(3)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        robot.evaluate_many([q])
        ROBOT.evaluate_many([JOINTS, JOINTS])
