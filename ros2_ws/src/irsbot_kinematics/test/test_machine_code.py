"""Machine code agrees with the equations on plain floats; where there is none, the reason is stated."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import stat
from itertools import product
from math import inf, isfinite, nan, tau
from types import SimpleNamespace

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.machine_code import library
from irsbot_kinematics.machine_code.library import MachineCode, built, compiled
from irsbot_kinematics.machine_code.source import RESULTS, c_source, c_text
from irsbot_kinematics.machine_code.symbols import NoClosedForm, Program
from irsbot_kinematics.numerics.arithmetic import FLOATS

pytestmark = pytest.mark.usefixtures("own_cache")

OUTSIDE = (nan, inf, -inf, 2e6)
FIELDS = ("pose", "type1_margin", "type2_margin", "pressure_angle", "closure_residual")


def joints_of(robot, number=3000):
    """Random joint positions in and around the workspace, angles also many turns away, and what is no position."""
    rng, joints = np.random.default_rng(1), robot.mechanism.joints
    low, high = [max(j.lower, -4.0) for j in joints], [min(j.upper, 4.0) for j in joints]
    spare = 0.2 * np.subtract(high, low)
    Q = rng.uniform(low - spare, high + spare, (number, len(joints)))
    turning = [j.is_angle for j in joints]
    Q[number // 2 :, turning] += tau * rng.integers(-1000, 1000, (number - number // 2, sum(turning)))
    for row, wrong in enumerate(OUTSIDE):
        Q[row, row % len(joints)] = wrong
    return Q


@pytest.mark.parametrize("name", ["irsbot2", "rrr3", "orthoglide", "linear_delta"])
def test_machine_code_agrees_with_the_equations_on_floats(name):
    robot, plain = irs.make_robot(name), irs.make_robot(name)
    Q = joints_of(robot)
    robot.compile()
    for mode in robot.mechanism.assembly_modes:
        many, numpy = robot.evaluate_many(Q, mode), plain.evaluate_many(Q, mode)
        np.testing.assert_array_equal(many.status, numpy.status)
        np.testing.assert_array_equal(many.working_mode, numpy.working_mode)
        assert set(many.status) >= {irs.Status.SOLVED, irs.Status.INVALID}
        for field in dataclasses.fields(many):
            if isinstance(values := getattr(many, field.name), np.ndarray):
                expected = getattr(numpy, field.name)
                np.testing.assert_array_equal(np.isnan(values), np.isnan(expected), field.name)
                far = ~(numpy.type2_margin < 1e-3)  # from where rounding changes the pose by its square root
                np.testing.assert_allclose(values[far], expected[far], rtol=1e-9, atol=1e-9, err_msg=field.name)
        solved = 0
        for row in np.flatnonzero(many.status == irs.Status.SOLVED)[::21]:
            at = plain.evaluate(Q[row], assembly_mode=mode)
            if at.type2_margin < 1e-3:
                continue
            solved += 1
            for field in FIELDS:
                expected = np.array(getattr(at, field))
                np.testing.assert_allclose(getattr(many, field)[row], expected, rtol=0.0, atol=1e-9, err_msg=field)
            if at.constraint_margin is not None:
                assert many.constraint_margin[row] == pytest.approx(at.constraint_margin, abs=1e-9, nan_ok=True)
        assert solved > 20


NUMBERS = [0.0, -0.0, 1.0, -1.0, 0.3, -0.7, 1e-300, 3.5, -4.0, 1e6, nan, inf, -inf]
ONE = {
    "sin": isfinite,
    "cos": isfinite,
    "acos": lambda x: abs(x) <= 1.0,
    "safe_sqrt": lambda x: x > -inf,
    "abs": lambda x: True,
    "wrap": lambda x: abs(x) != inf,  # no joint is there
}
TWO = {
    "atan2": lambda y, x: True,
    "minimum": lambda a, b: True,
    "maximum": lambda a, b: True,
    "ratio": lambda part, whole: part >= 0.0 and whole >= 0.0 and not part == whole == inf,
    "quotient": lambda above, below: above >= 0.0 and below >= 0.0 and not above == below == inf,
}
"""Functions of `Arithmetic`, and where they are defined."""


def fraction(number):
    """A number as a quotient of finite ones: joint positions are finite."""
    return (0.0, 0.0) if number != number else (number, 1.0) if isfinite(number) else (np.sign(number), 0.0)


def test_functions_on_symbols_are_those_on_floats():
    program, rows = Program(), list(product(NUMBERS, NUMBERS))
    q = [program.input(f"q{j}[i]") for j in range(4)]
    k, a, b, one = program.arithmetic, q[0] / q[1], q[2] / q[3], program.value("+", 1.0, 0.0)
    values = (*(getattr(k, name)(a) for name in ONE), *(getattr(k, name)(a, b) for name in TWO))
    results = {field: values if field == "pose" else (one,) for field in RESULTS}
    code = MachineCode(
        built(
            c_text(4, program, {**results, "closure_residual": (0.0 * one,)}, {"sine": (one,) * 4, "gap": (one, one)})
        )
    )
    out = SimpleNamespace(**{field: np.full((len(rows), len(values)), 7.0) for field in RESULTS})
    out.status, out.working_mode = np.full(len(rows), 9, np.uint8), np.full((len(rows), 4), 9, np.int8)
    code.evaluate(np.array([[*fraction(x), *fraction(y)] for x, y in rows]), out)
    assert set(out.status) == {irs.Status.SOLVED}
    for (name, defined), column in zip((*ONE.items(), *TWO.items()), out.pose.T, strict=True):
        for row, found in zip(rows, column, strict=True):
            operands = row if name in TWO else row[:1]
            if defined(*operands):
                expected = getattr(FLOATS, name)(*operands)
                assert found == pytest.approx(expected, rel=1e-14, abs=1e-14, nan_ok=True), (name, operands)


def test_blocks_that_are_not_full_are_evaluated_to_their_end():
    robot = irs.make_robot("five_bar")
    Q = joints_of(robot, 300)[10:]
    robot.compile()
    all_of_them = robot.evaluate_many(Q)
    for number in (0, 1, 127, 128, 129, 255, 257):
        some = robot.evaluate_many(Q[:number])
        np.testing.assert_array_equal(some.pose, all_of_them.pose[:number])
        np.testing.assert_array_equal(some.status, all_of_them.status[:number])
    every_other = robot.evaluate_many(Q[::2])  # rows that do not lie one after the other
    np.testing.assert_array_equal(every_other.type2_margin, all_of_them.type2_margin[::2])


def test_threads_share_the_samples_and_give_the_same_results(monkeypatch):
    monkeypatch.setattr(library, "PART", 100)
    one, three = irs.make_robot("five_bar"), irs.make_robot("five_bar")
    Q = joints_of(one, 1234)
    one.compile()
    three.compile(threads=3)
    for number in (0, 1, 100, 1234):
        expected, found = one.evaluate_many(Q[:number]), three.evaluate_many(Q[:number])
        np.testing.assert_array_equal(found.status, expected.status)
        np.testing.assert_array_equal(found.pose, expected.pose)
        np.testing.assert_array_equal(found.pressure_angle, expected.pressure_angle)
    for wrong in (0, -1, 1.5, "two", nan):
        with pytest.raises(irs.BadInput, match="threads"):
            one.compile(threads=wrong)


def test_a_load_and_a_start_are_evaluated_as_before():
    robot, plain = irs.make_robot("five_bar"), irs.make_robot("five_bar")
    Q = np.array([[2.0, 1.0], [2.001, 1.001]])
    robot.compile()
    loaded = robot.evaluate_many(Q, force=10.0)
    np.testing.assert_array_equal(loaded.reaction_max, plain.evaluate_many(Q, force=10.0).reaction_max)
    start = plain.direct(Q[0])
    np.testing.assert_array_equal(robot.evaluate_many(Q, start=start).pose, plain.evaluate_many(Q, start=start).pose)


def test_copies_of_a_robot_are_evaluated_as_before():
    robot = irs.make_robot("five_bar")
    robot.compile()
    for other in (copy.deepcopy(robot), pickle.loads(pickle.dumps(robot))):
        assert other.evaluate_many([[2.0, 1.0]]).status.tolist() == [irs.Status.SOLVED]
        other.compile()


@pytest.mark.parametrize("name", ["rrr3_base", "ruu4", "rpr3", "rails3"])
@pytest.mark.filterwarnings("ignore::irsbot_kinematics.LabelsVary")
def test_equations_that_iterate_have_no_machine_code(name):
    robot = irs.make_robot(name)
    with pytest.raises(irs.NotCompiled, match="closed form"):
        robot.compile()
    assert len(robot.evaluate_many(np.zeros((3, len(robot.mechanism.joints)))).status) == 3


@pytest.fixture
def compiler(tmp_path, monkeypatch):
    """Make a compiler of a shell script."""

    def made_of(*lines):
        file = tmp_path / "compiler"
        file.write_text("\n".join(["#!/bin/sh", *lines]))
        file.chmod(file.stat().st_mode | stat.S_IXUSR)
        monkeypatch.setenv("CC", str(file))

    return made_of


def test_machine_code_is_made_once_and_again_after_a_change_of_the_robot(compiler, tmp_path):
    calls = tmp_path / "calls"
    compiler(f'echo called >> "{calls}"', 'exec cc "$@"')
    mechanism = irs.make_robot("five_bar").mechanism
    for _ in range(3):
        compiled(mechanism, 1)
    assert calls.read_text().split() == ["called"]
    compiled(irs.make_robot("five_bar", l1=mechanism.geometry.l1 + 1e-15).mechanism, 1)
    assert calls.read_text().split() == ["called"] * 2


def test_a_file_of_the_cache_that_is_no_library_is_named(compiler, tmp_path):
    compiler('while [ "$1" != -o ]; do shift; done', 'echo "no library" > "$2"')
    with pytest.raises(irs.NotCompiled, match=r"[0-9a-f]{32}\.so cannot be loaded .*: delete it"):
        compiled(irs.make_robot("five_bar").mechanism, 1)
    assert len(list(tmp_path.glob("*.so"))) == 1


@pytest.mark.parametrize(
    ("compiler", "reason"),
    [
        ("no_such_compiler", "install gcc, or name one in CC"),
        ("false", "the compiler failed"),
        ("'", "no command"),
        ("/etc/passwd", "cannot run '/etc/passwd'"),
    ],
)
def test_without_a_working_compiler_the_reason_is_stated_and_numpy_goes_on(compiler, reason, monkeypatch):
    monkeypatch.setenv("CC", compiler)
    robot = irs.make_robot("five_bar")
    with pytest.raises(irs.NotCompiled, match=reason):
        robot.compile()
    assert robot.evaluate_many([[2.0, 1.0]]).status.tolist() == [irs.Status.SOLVED]


@pytest.mark.parametrize("stated", ["", " "])
def test_no_compiler_named_is_the_usual_one(stated, tmp_path, monkeypatch):
    monkeypatch.setenv("CC", stated)
    monkeypatch.setenv("IRSBOT_CACHE", str(tmp_path))
    compiled(irs.make_robot("five_bar").mechanism, 1)
    assert len(list(tmp_path.glob("*.so"))) == 1


@pytest.mark.parametrize("place", ["file/below", "/proc/nope"])
def test_a_folder_that_cannot_be_written_is_named(place, tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("IRSBOT_CACHE", str(tmp_path / place))
    with pytest.raises(irs.NotCompiled, match="cannot be kept in"):
        irs.make_robot("five_bar").compile()


def test_what_is_computed_twice_is_one_operation_and_zeros_of_both_signs_are_two():
    program = Program()
    x = program.input("x")
    assert (x * 2.0 + x * 2.0).name == "v1"
    assert (x + 0.0).name != (x + -0.0).name
    assert len(program.operations) == 4


def test_the_value_of_a_symbol_cannot_be_used():
    x = Program().input("x")
    for use in (bool, float, int, lambda s: s < 1.0, lambda s: s == 0.0, lambda s: np.sin(s), lambda s: np.ones(2) * s):
        with pytest.raises(TypeError):
            use(x)


def test_a_mechanism_that_branches_on_a_value_is_refused():
    class Branching(type(irs.make_robot("five_bar").mechanism)):
        def direct(self, k, joints, assembly):
            pose, gaps = super().direct(k, joints, assembly)
            return (pose if joints[0] > 0.0 else pose[::-1]), gaps

    mechanism = Branching(irs.make_robot("five_bar").mechanism.geometry)
    assert mechanism.direct(FLOATS, (2.0, 1.0), 1)
    with pytest.raises(NoClosedForm):
        c_source(mechanism, 1)


class WithMargin(type(irs.make_robot("five_bar").mechanism)):
    """A five-bar with a limb margin that is the same everywhere."""

    stated = 1

    @property
    def limb_count(self):
        return self.stated

    def legs(self, k, joints, pose):
        return dataclasses.replace(super().legs(k, joints, pose), limb=(0.5,))


def test_a_margin_that_is_the_same_everywhere_has_machine_code():
    robot = irs.Robot(WithMargin(irs.make_robot("five_bar").mechanism.geometry))
    before = robot.evaluate_many([[2.0, 1.0], [nan, 1.0]]).limb_margin
    robot.compile()
    found = robot.evaluate_many([[2.0, 1.0], [nan, 1.0]]).limb_margin
    np.testing.assert_array_equal(found[:1], before[:1])
    np.testing.assert_array_equal(found, [[0.5], [nan]])


def test_equations_that_give_more_numbers_than_are_stated_are_refused(monkeypatch):
    monkeypatch.setattr(WithMargin, "stated", 0)
    with pytest.raises(irs.NotCompiled, match=r"limb_margin of .* has 1 numbers, 0 are stated"):
        irs.Robot(WithMargin(irs.make_robot("five_bar").mechanism.geometry)).compile()
