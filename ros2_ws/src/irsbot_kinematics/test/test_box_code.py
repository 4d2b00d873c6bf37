"""Machine code of the bounds gives the bits of Python, and is used only where it does."""

from __future__ import annotations

import ctypes
import os
import struct
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator, Sequence
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from random_boxes import PLATFORMS, WAYS, random_box

from irsbot_kinematics.bounds import boxes, couples, cranks
from irsbot_kinematics.bounds.box_code import SHAPES, BoxCode, codes_for, functions, library_for
from irsbot_kinematics.bounds.boxes import Reached, by_equations, numbers_of, reached
from irsbot_kinematics.bounds.quadratics import least, numbers
from irsbot_kinematics.machine_code.__main__ import make
from irsbot_kinematics.machine_code.branching import Branch, Further, Trace, Undecided, all_of

FLOATS = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([0.0, -0.0, 1.0, -1.0, 1e-300, 1e200])
MODULE = (sys.executable, "-m", "irsbot_kinematics.machine_code")


@pytest.fixture(scope="module", autouse=True)
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """The code that the set-up has made, or new one."""
    with pytest.MonkeyPatch.context() as patch:
        patch.delenv("IRSBOT_PLAIN", raising=False)
        if not all(library_for(*shape).is_file() for shape in SHAPES):
            patch.setenv("IRSBOT_CACHE", str(tmp_path_factory.mktemp("cache")))
            for shape in SHAPES:
                make(shape)
        codes_for.cache_clear()
        yield
    codes_for.cache_clear()


def code_of(shape: tuple[int, int, int], name: str = "reached") -> BoxCode:
    return codes_for(*shape)[name]


def bits(found: Reached | None) -> list[bytes] | None:
    """All numbers of a result."""
    if found is None:
        return None
    rows = [[found.type2], *found.pose, *[x for rod in found.rods for x in rod], found.longest]
    return [struct.pack(f"{len(row)}d", *row) for row in rows]


@pytest.mark.parametrize("platform", PLATFORMS)
def test_machine_code_gives_the_bits_of_python(platform: str) -> None:
    rng, (n, dims) = np.random.default_rng(3), PLATFORMS[platform]
    code, answers = code_of((n, dims, n)), Counter[str]()
    for way in WAYS:
        for _ in range(8 if n > dims or way != "elsewhere" else 0):
            box = random_box(rng, n, dims, way)
            at, rods = box.machine.posture, box.rods()
            for arm in (box.arm, 10.0 * box.machine.diameter)[: n - dims + 1]:
                assert bits(reached(at, rods, arm)) == bits(by_equations(at, rods, arm))
                found = code(numbers_of(at, rods, arm))
                known = "none" if found is None else "zero" if found[:1] == [0.0] else "positive"
                answers["not known" if found == [] else known] += 1
    assert min(answers["none"], answers["positive"]) > 10
    assert n == dims or answers["zero"] > 10, "errors of the attachments that are larger than the platform"
    assert answers["not known"] == 0


TURNING = [shape for shape in SHAPES if shape[2] > shape[1]]


def cases(shape: tuple[int, int, int], number: int) -> Iterator[tuple[list[list[list[float]]], list[cranks.Crank]]]:
    """Rods and cranks; every fifth has a number that is none somewhere."""
    rng, (n, dims, m) = np.random.default_rng(5), shape
    platform = next(name for name, size in PLATFORMS.items() if size == (n, dims))
    while number > 0:
        box = random_box(rng, *PLATFORMS[platform], rng.choice(WAYS))
        stated = by_equations(box.machine.posture, box.rods(), box.arm)
        if stated is None:
            continue
        number -= 1
        rods = [[list(x) for x in rod] for rod in stated.rods]
        if number % 5 == 0:
            rods[rng.integers(n)][rng.integers(2)][rng.integers(numbers(n, m))] = float(
                rng.choice([nan, inf, -inf, 0.0])
            )
        angles, travel = rng.uniform(-4.0, 4.0, n), 10.0 ** rng.uniform(-3.0, 0.0, n)
        sides = rng.choice([-1.0, 1.0], n)
        rows = np.column_stack([np.cos(angles), np.sin(angles), travel, sides]).tolist()
        yield rods, [cranks.Crank(*row) for row in rows]


def same(found: Sequence[float], expected: Sequence[float]) -> bool:
    return all(
        struct.pack("d", x) == struct.pack("d", y) or (x != x and y != y) for x, y in zip(found, expected, strict=True)
    )


@pytest.mark.parametrize("shape", TURNING)
def test_levers_about_cranks_have_the_bits_of_python(shape: tuple[int, int, int]) -> None:
    code, positive = code_of(shape, "levers"), 0
    for rods, turning in cases(shape, 200):
        found = code(cranks.numbers_of(rods, turning))
        expected = cranks.by_equations(rods, turning)
        assert found is not None
        assert same(found, expected)
        assert same(cranks.levers_over(rods, turning), expected)
        positive += max(expected) > 0.0
    assert positive > 50


def test_constraints_have_the_bits_of_python() -> None:
    shape, positive = (4, 3, 4), 0
    code = code_of(shape, "couples")
    for rods, _turning in cases(shape, 200):
        found = code(couples.numbers_of(rods))
        expected = couples.by_equations(rods)
        assert found is not None
        assert same(found, [expected])
        assert same([couples.least_over(rods)], [expected])
        positive += expected > 0.0
    assert 50 < positive < 200


@pytest.mark.parametrize("shape", SHAPES)
def test_numbers_that_are_none_give_no_bounds(shape: tuple[int, int, int]) -> None:
    rng, code = np.random.default_rng(4), code_of(shape)
    platform = next(name for name, (n, dims) in PLATFORMS.items() if (n, dims) == shape[:2])
    box = random_box(rng, *PLATFORMS[platform], "all")
    at, rods = box.machine.posture, box.rods()
    for field in ("length", "aside", "growth"):
        for value in (nan, inf, -inf, 0.0):
            wrong = [rods[0]._replace(**{field: value}), *rods[1:]]
            expected = by_equations(at, wrong, box.arm)
            assert bits(reached(at, wrong, box.arm)) == bits(expected)
            assert value == 0.0 or expected is None or not expected.type2 > 0.0
    at.screws = (at.screws[1], *at.screws[1:])  # rows that are equal: singular
    assert by_equations(at, rods, box.arm) is None
    assert code(numbers_of(at, rods, box.arm)) is None


@pytest.mark.parametrize("shape", SHAPES)
@given(data=st.data())
def test_the_least_value_of_a_quadratic_has_the_bits_of_python(
    shape: tuple[int, int, int], data: st.DataObject
) -> None:
    assert code_of(shape)
    function = ctypes.PyDLL(str(library_for(*shape))).least
    function.restype = ctypes.c_double
    n, _dims, m = shape
    size = numbers(n, m)
    usual = st.lists(st.floats(-1.0, 1.0) | st.sampled_from([0.0, 0.25, -0.25]), min_size=size, max_size=size)
    for row in (data.draw(usual), data.draw(st.lists(FLOATS, min_size=size, max_size=size))):
        row[-1] = abs(row[-1])
        found, expected = function((ctypes.c_double * size)(*row)), least(n, row)
        assert found == expected or (found != found and expected != expected)


# --- what is used ----------------------------------------------------------------------------------------------------


def without(monkeypatch: pytest.MonkeyPatch, code: BoxCode | None) -> None:
    for module, name in ((boxes, "reached"), (cranks, "levers"), (couples, "couples")):
        codes = {} if code is None else {name: code}
        monkeypatch.setattr(module, "codes_for", lambda *_shape, codes=codes: codes)


def a_box() -> tuple[object, Sequence[object], float]:
    box = random_box(np.random.default_rng(6), 3, 2, "swings")
    return box.machine.posture, box.rods(), box.arm


def test_python_answers_where_there_is_no_code_or_it_does_not_know(monkeypatch: pytest.MonkeyPatch) -> None:
    at, rods, arm = a_box()
    expected = bits(by_equations(at, rods, arm))
    assert expected is not None
    without(monkeypatch, None)
    assert bits(reached(at, rods, arm)) == expected
    without(monkeypatch, lambda _numbers: [])
    assert bits(reached(at, rods, arm)) == expected
    without(monkeypatch, lambda _numbers: None)
    assert reached(at, rods, arm) is None


def test_python_answers_for_cranks_and_constraints_where_there_is_no_code_or_it_does_not_know(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    for rods, turning in cases((4, 3, 4), 3):
        expected = [*cranks.by_equations(rods, turning), couples.by_equations(rods)]
        for code in (None, lambda _numbers: [], lambda _numbers: None):
            without(monkeypatch, code)
            assert same([*cranks.levers_over(rods, turning), couples.least_over(rods)], expected)


@pytest.mark.parametrize("more", [-1, 1])
def test_another_number_of_values_is_left_to_python(more: int) -> None:
    at, rods, arm = a_box()
    values = numbers_of(at, rods, arm)
    assert code_of((3, 2, 3))(values)
    assert code_of((3, 2, 3))([*values, 0.0][: len(values) + more]) == []


def test_plain_python_is_selected_by_the_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("IRSBOT_PLAIN", "1")
    assert codes_for.__wrapped__(*SHAPES[0]) == {}


@pytest.mark.usefixtures("own_cache")
def test_there_is_no_code_before_it_is_made() -> None:
    assert codes_for.__wrapped__(*SHAPES[0]) == {}
    file = make(SHAPES[0])
    made = file.stat().st_mtime_ns
    assert list(codes_for.__wrapped__(*SHAPES[0])) == list(functions(*SHAPES[0][1:]))
    assert make(SHAPES[0]).stat().st_mtime_ns == made, "it is kept"


@pytest.mark.usefixtures("own_cache")
def test_a_file_that_is_no_library_is_named_and_passed_over() -> None:
    file = library_for(*SHAPES[0])
    file.write_text("no library")
    with pytest.warns(UserWarning, match=f"{file} cannot be used"):
        assert codes_for.__wrapped__(*SHAPES[0]) == {}


@pytest.mark.usefixtures("own_cache")
def test_code_with_other_results_is_named_and_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    file = make(SHAPES[0])
    expected = (ctypes.c_double * 2).in_dll(ctypes.PyDLL(str(file)), "reached_expected")
    assert expected[0] > 0.0
    whole, first = file.read_bytes(), bytes(expected)
    assert whole.count(first) == 1, "its expected results"
    monkeypatch.setenv("IRSBOT_CACHE", str(file.parent / "other"))  # a file of a known name is not loaded again
    file = library_for(*SHAPES[0])
    file.parent.mkdir()
    file.write_bytes(whole.replace(first, struct.pack("2d", 0.5, expected[1])))
    with pytest.warns(UserWarning, match=f"{file} has other results on this machine"):
        assert codes_for.__wrapped__(*SHAPES[0]) == {}


def test_the_command_tells_what_is_made_and_what_is_missing(tmp_path: Path) -> None:
    env = {**os.environ, "IRSBOT_CACHE": str(tmp_path), "CC": "no_such_compiler"}

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run([*MODULE, *words], env=env, capture_output=True, text=True, check=False)

    assert "Example: python -m irsbot_kinematics.machine_code" in run("--help").stdout
    assert run("--check").returncode == 1
    done = run()
    assert done.returncode == 1
    assert done.stderr.startswith("no machine code of the bounds, plain Python runs: no C compiler: 'no_such_compiler'")
    for shape in SHAPES:
        Path(tmp_path, library_for(*shape).name).touch()
    assert run("--check").returncode == 0


# --- how equations are recorded --------------------------------------------------------------------------------------


def equations(x: Any, y: Any) -> Any:
    if not x > y:
        return None
    if not all_of([x < 2.0 * y, x >= 0.0]):
        return x * y + 1.0
    return abs(x) / y


def test_one_way_is_recorded_with_its_guards() -> None:
    trace = Trace()
    found = equations(trace.input("x"), trace.input("y"))
    assert trace.guards == [(0, (("x", ">", "y"),)), (1, (("x", "<", "v0"), ("x", ">=", "0.0")))]
    assert [(name, *operation) for name, operation in trace.operations] == [
        ("v0", "*", ("2.0", "y")),
        ("v1", "abs", ("x",)),
        ("v2", "/", ("v1", "y")),
    ]
    assert found.name == "v2"


def test_behind_a_denied_guard_nothing_new_is_computed() -> None:
    trace = Trace(denied=0)
    assert equations(trace.input("x"), trace.input("y")) is None
    trace = Trace(denied=1)
    with pytest.raises(Further):
        equations(trace.input("x"), trace.input("y"))


def test_a_branch_has_the_answers_that_it_is_told() -> None:
    branch = Branch([True, False])
    assert equations(branch.input("x"), branch.input("y")).name == "w2"
    assert branch.operations[1:] == [("w1", ("*", ("x", "y"))), ("w2", ("+", ("w1", "1.0")))]
    branch = Branch([True])
    with pytest.raises(Undecided) as raised:
        equations(branch.input("x"), branch.input("y"))
    assert raised.value.guard == (1, (("x", "<", "w0"), ("x", ">=", "0.0")))


def test_all_of_conditions_is_one_condition() -> None:
    x = Trace().input("x")
    assert all_of([]) is True
    assert all_of([True, 1.0 > 2.0]) is False
    assert all_of([x > 1.0, False]) is False
    assert all_of(iter([x > 1.0, True, x < 2.0])).comparisons == (("x", ">", "1.0"), ("x", "<", "2.0"))
