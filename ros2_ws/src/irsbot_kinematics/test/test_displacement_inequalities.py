"""Bounds of displacements against the inequalities that they have to satisfy."""

from __future__ import annotations

import numpy as np
import pytest

from irsbot_kinematics.bounds.displacement import displacement, displacement_and_turn


def test_the_displacement_is_the_smallest_root():
    rng = np.random.default_rng(3)
    found = 0
    for start, linear, square in rng.uniform(0.0, 1.0, (300, 3)):
        roots = np.roots([square, linear - 1.0, start])
        real = roots.real[(np.abs(roots.imag) < 1e-12) & (roots.real > 0.0)]
        d = displacement(start, linear, square)
        if np.isfinite(d):
            assert d == pytest.approx(real.min(), rel=1e-6)
            found += 1
        else:
            assert not len(real)
    assert 30 < found < 270


def test_a_box_of_translation_and_turn_maps_into_itself():
    """The right sides for (x, y) are at most (x, y), whichever of translation and turn asks for more."""
    rng = np.random.default_rng(4)
    bounded = {"translation": 0, "turn": 0}
    for _ in range(2000):
        x0, y0, moves, turns, path = 10.0 ** rng.uniform(-4.0, 0.0, 5)
        rod, radius = rng.uniform(0.1, 1.0, 2)
        x, y = displacement_and_turn(x0, y0, moves, turns, path, rod, radius)
        if not np.isfinite(x):
            continue
        sweep = x + radius * y
        # a rod's drive and the square of its path are in x0 and y0 already
        demand = (path * sweep + 0.5 * sweep**2) / rod + 0.5 * radius * y**2
        assert x0 + moves * demand <= x * (1.0 + 1e-9)
        assert y0 + turns * demand <= y * (1.0 + 1e-9)
        bounded["translation" if moves / x0 > turns / y0 else "turn"] += 1
    assert min(bounded.values()) > 100
