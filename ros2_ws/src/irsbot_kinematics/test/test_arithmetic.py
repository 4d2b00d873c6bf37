"""Floats and arrays: the same functions, on every kind of number."""

from __future__ import annotations

from dataclasses import fields
from math import inf, nan, pi

import numpy as np
import pytest

from irsbot_kinematics.numerics.arithmetic import ARRAYS, FLOATS, Arithmetic

NUMBERS = [0.0, -0.0, 1.0, -1.0, 0.3, -0.7, 1e-300, 1e300, 3.5, -4.0, 100.0, pi, -pi, nan, inf, -inf]
ONE = {"sin", "cos", "acos", "safe_sqrt", "sqrt", "abs", "wrap"} & {field.name for field in fields(Arithmetic)}
PAIRS = {"cos_sin"}
TWO = {"atan2", "hypot", "minimum", "maximum", "ratio", "quotient"}
DEFINED = {
    # where floats raise ValueError, arrays give NaN: the callers keep such numbers out
    "sin": np.isfinite,
    "cos": np.isfinite,
    "acos": lambda x: abs(x) <= 1.0,
    "sqrt": lambda x: x >= 0.0,
    "safe_sqrt": lambda x: x > -inf,
    "ratio": lambda part, whole: part >= 0.0 and whole >= 0.0 and not part == whole == inf,
    "quotient": lambda above, below: above >= 0.0 and below >= 0.0 and not above == below == inf,
    # arrays take the square: lengths end earlier than numbers
    "hypot": lambda x, y: not {1e300, 1e-300} & {abs(x), abs(y)} and not (np.isnan(x) or np.isnan(y)),
}


def equal(a, b):
    return (np.isnan(a) and np.isnan(b)) or a == pytest.approx(b, rel=1e-15, abs=1e-15)


def test_no_function_is_left_out():
    assert {field.name for field in fields(Arithmetic)} == ONE | PAIRS | TWO


@pytest.mark.parametrize("name", sorted(ONE))
def test_functions_of_one_number_agree(name):
    for x in filter(DEFINED.get(name, lambda x: True), NUMBERS):
        with np.errstate(all="ignore"):
            many = getattr(ARRAYS, name)(np.array([x]))[0]
        assert equal(getattr(FLOATS, name)(x), many), (name, x)


@pytest.mark.parametrize("size", [1e-300, 1e-8, 1.0, pi, 100.0, 1e6])
def test_cosine_and_sine_together_are_those_of_the_angle(size):
    angles = np.concatenate([np.random.default_rng(1).uniform(-size, size, 10_000), [0.0, -0.0, size, -size]])
    angles = np.concatenate([angles, np.arange(-4.0, 5.0) * pi / 4.0])  # also where one vanishes
    for cosine, sine in (ARRAYS.cos_sin(angles), np.transpose([FLOATS.cos_sin(angle) for angle in angles.tolist()])):
        np.testing.assert_allclose(cosine, np.cos(angles), rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(sine, np.sin(angles), rtol=1e-15, atol=0.0)
    with np.errstate(invalid="ignore"):
        assert np.isnan(ARRAYS.cos_sin(np.array([nan, inf, -inf]))).all()


def test_lengths_of_arrays_whose_square_is_no_number_are_infinite_or_nothing():
    with np.errstate(over="ignore", under="ignore"):
        assert ARRAYS.hypot(np.array([1e300, 1e-300, inf]), np.array([1.0, 1e-300, 0.0])).tolist() == [inf, 0.0, inf]


@pytest.mark.parametrize("name", sorted(TWO))
def test_functions_of_two_numbers_agree(name):
    for x in NUMBERS:
        for y in NUMBERS:
            if DEFINED.get(name, lambda x, y: True)(x, y):
                with np.errstate(all="ignore"):
                    many = getattr(ARRAYS, name)(np.array([x]), np.array([y]))[0]
                assert equal(getattr(FLOATS, name)(x, y), many), (name, x, y)


@pytest.mark.parametrize("k", [FLOATS, ARRAYS], ids=["floats", "arrays"])
def test_a_number_that_is_not_known_is_not_forgotten(k):
    unknown, known = (nan, 1.0) if k is FLOATS else (np.array([nan]), np.array([1.0]))
    with np.errstate(invalid="ignore"):
        for function in (k.minimum, k.maximum, k.hypot, k.atan2, k.ratio, k.quotient):
            assert np.isnan(function(unknown, known)).all()
            assert np.isnan(function(known, unknown)).all()
        for function in (k.safe_sqrt, k.abs, k.wrap):
            assert np.isnan(function(unknown)).all()


def test_roots_quotients_and_ratios_are_defined_at_their_ends():
    assert FLOATS.safe_sqrt(-1e-20) == 0.0
    assert (FLOATS.ratio(2.0, 1.0), FLOATS.ratio(0.0, 0.0), FLOATS.ratio(1.0, 4.0)) == (1.0, 0.0, 0.25)
    assert (FLOATS.quotient(1.0, 0.0), FLOATS.quotient(1.0, 4.0)) == (inf, 0.25)


@pytest.mark.parametrize("turns", [0, 1, -3, 1000, 10**6])
def test_wrapped_angles_are_the_same_direction_within_half_a_turn(turns):
    for angle in np.linspace(-3.1, 3.1, 25):
        for wrapped in (FLOATS.wrap(angle + turns * 2.0 * pi), ARRAYS.wrap(np.array([angle + turns * 2.0 * pi]))[0]):
            assert wrapped == pytest.approx(angle, abs=1e-15 * (10 + abs(turns) * 10))
            assert abs(wrapped) <= pi
