"""The largest useful rectangle, and the search for a free design."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.optimize import minimize_scalar

import irsbot_kinematics as irs
from irsbot_kinematics.design import Limits, Task, check, largest_rectangle, search
from irsbot_kinematics.design.search import RANGES, NoDesign, judge
from irsbot_kinematics.numerics.arithmetic import ARRAYS

ANYWHERE = Limits(0.0, 0.0, 0.0)
FLAT = 0.005
"""m^2: the optimum is flat, and a grid of 3 mm sees it to that."""


def robot(name, **lengths):
    return irs.make_robot(name, **lengths).mechanism


def test_the_largest_rectangle_of_the_default_robot_in_closed_form():
    """Between the inner circle of radius l2eq - l1 and the outer ones about (-+|b0|, 0)."""
    g = robot("irsbot2").geometry

    def area(w):
        return 2.0 * w * (np.sqrt((g.l1 + g.l2eq) ** 2 - (w + abs(g.b0)) ** 2) - (g.l2eq - g.l1))

    best = -minimize_scalar(lambda w: -area(w), bounds=(0.1, 1.1), method="bounded").fun
    assert best == pytest.approx(0.7197, abs=5e-5)
    found = largest_rectangle(robot("irsbot2"), ANYWHERE)
    assert found.area == pytest.approx(best, abs=FLAT)
    assert found.area <= best


@pytest.mark.parametrize(
    ("name", "limits", "area", "w", "z_low", "z_high"),
    [
        ("irsbot2", ANYWHERE, 0.7197, 0.698, -0.965, -0.450),
        ("irsbot2", Limits(0.3, 0.5, 0.1), 0.548, 0.6225, -0.9225, -0.4825),
        ("irsbot2_beta45", ANYWHERE, 0.456, 0.53, -0.945, -0.515),
    ],
)
def test_the_rectangles_of_the_sheet(name, limits, area, w, z_low, z_high):
    found = largest_rectangle(robot(name), limits)
    assert found.area == pytest.approx(area, abs=FLAT)
    assert [found.half_width, found.z_low, found.z_high] == pytest.approx([w, z_low, z_high], abs=0.02)


def test_every_pose_of_a_useful_rectangle_keeps_the_limits():
    machine, limits = robot("irsbot2"), Limits(0.3, 0.5, 0.1)
    box = largest_rectangle(machine, limits)
    x, z = np.meshgrid(np.linspace(-box.half_width, box.half_width, 301), np.linspace(box.z_low, box.z_high, 201))
    joints, reachability = machine.inverse(ARRAYS, (x, z), (1, -1))
    legs = machine.legs(ARRAYS, joints, (x, z))
    (ax, az), (bx, bz) = legs.screws
    between_nodes = 2e-3  # what a margin may change within half a cell of 1.5 mm
    assert np.minimum(*reachability).min() > 0.0
    assert np.abs(legs.normalised_levers).min() > limits.type1 - between_nodes
    assert (-(ax * bz - az * bx)).min() > limits.type2 - between_nodes
    assert legs.constraint.min() > limits.constraint - between_nodes


def test_limits_that_no_pose_meets_give_no_rectangle():
    assert largest_rectangle(robot("irsbot2"), Limits(0.99, 0.99, 2.0), cells=(40, 80)).area == 0.0


def test_the_search_beats_the_strict_preset_at_its_own_size_and_slack():
    task = Task(slack=0.095, population=6, generations=25)
    found = search(task)
    reference = judge(robot("irsbot2_strict").geometry, task)
    assert reference.slack == pytest.approx(0.0952847, abs=1e-6)
    assert found.geometry.l1 + found.geometry.l2eq == pytest.approx(1.0, abs=1e-12)
    assert found.slack >= task.slack
    assert found.rectangle.area > reference.rectangle.area
    assert check(found.geometry).free


def test_the_search_repeats_itself_and_stays_in_its_ranges():
    task = Task(population=3, generations=3, slack=0.01)
    seen = []
    one, same = search(task, lambda generation, area: seen.append((generation, area))), search(task)
    assert one == same
    assert [generation for generation, _ in seen] == [1, 2, 3]
    assert seen[-1][1] >= seen[0][1] >= 0.0
    for name, (low, high) in RANGES.items():
        assert low <= getattr(one.geometry, name) <= high


def test_the_result_does_not_depend_on_where_designs_are_judged():
    task, calls = Task(population=3, generations=3, slack=0.01), []

    def elsewhere(function, stated):
        calls.append(len(stated))
        return [pickle.loads(pickle.dumps(function))(pickle.loads(pickle.dumps(one))) for one in stated]

    assert search(task, spread=elsewhere) == search(task)
    assert len(calls) == 4, "the first designs, and three generations"
    assert sum(calls) > 0


def test_the_rectangle_grows_with_the_square_of_the_size():
    one, three = (search(Task(size=size, slack=0.01 * size, population=3, generations=3)) for size in (1.0, 3.0))
    assert three.rectangle.area == pytest.approx(9.0 * one.rectangle.area, rel=1e-6)


def test_a_search_that_cannot_succeed_is_refused():
    with pytest.raises(NoDesign, match="zone 'strict'"):
        search(Task(slack=0.4, population=3, generations=2))


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"size": 0.0}, "size > 0, got 0"),
        ({"size": float("nan")}, "got nan"),
        ({"ranges": {**RANGES, "b": (0.5, 0.1)}}, "0 < low < high for b, got 0.5 against 0.1"),
        ({"ranges": {"b": (0.1, 0.5)}}, "ranges of l1, b"),
        ({"zone": "nonsense"}, "no zone 'nonsense'"),
    ],
)
def test_a_task_that_makes_no_sense_is_refused(wrong, words):
    with pytest.raises(irs.BadInput) as refusal:
        Task(**wrong)
    assert words in str(refusal.value)
