"""Lower bound of the Type 2 margin from rods as vectors: attachments that are off, each on its own."""

from __future__ import annotations

from itertools import product
from math import cos, hypot, pi, sin

import numpy as np
import pytest

from irsbot_kinematics.bounds.quadratics import numbers
from irsbot_kinematics.bounds.type2_over_box import type2_over

DIRECTIONS = [(cos(k * pi / 4), sin(k * pi / 4)) for k in range(8)]
ROUNDING = 1e-12


def constant(value: float) -> list[float]:
    """A quantity in three joints that no joint changes."""
    return [float(value)] + [0.0] * (numbers(3, 0) - 1)


def least_cosine_of(rods: np.ndarray, attachments: np.ndarray) -> float:
    """Smallest cosine between a rod and the velocity of its place when it alone yields, from the twists."""
    units = rods / np.linalg.norm(rods, axis=1, keepdims=True)
    moments = attachments[:, 0] * units[:, 1] - attachments[:, 1] * units[:, 0]
    found = []
    for leg, twist in enumerate(np.linalg.inv(np.column_stack([units, moments])).T):
        x, y = attachments[leg]
        velocity = np.array([twist[0] - twist[2] * y, twist[1] + twist[2] * x])
        found.append(abs(velocity @ units[leg]) / hypot(*velocity))
    return min(found)


@pytest.mark.parametrize("share", [1e-3, 1e-2])
def test_attachments_that_are_off_count_with_their_moments(share: float):
    """Nothing else is off, so all that the margin loses is the effect of the arms; most of what is allowed is met."""
    rng, met = np.random.default_rng(4), []
    while len(met) < 40:
        attachments, rods = rng.uniform(-0.1, 0.1, (3, 2)), rng.uniform(-0.4, 0.4, (3, 2))
        exact, arm = least_cosine_of(rods, attachments), 0.1 * share
        if exact < 0.2:
            continue
        vectors = [[constant(x) for x in rod] for rod in rods]
        lengths = np.linalg.norm(rods, axis=1)
        of = (vectors, [constant(length) for length in lengths], attachments.tolist())
        assert type2_over(*of, 0.0, lengths.tolist()) == pytest.approx(exact, abs=ROUNDING)
        floor = type2_over(*of, arm, lengths.tolist())
        if not floor > 0.0:
            continue
        least = min(least_cosine_of(rods, attachments + arm * np.array(away)) for away in product(DIRECTIONS, repeat=3))
        assert floor <= least + ROUNDING
        met.append((exact - least) / (exact - floor))
    assert max(met) > 0.5, "what is met is far from what is allowed: the attack does not bite"
