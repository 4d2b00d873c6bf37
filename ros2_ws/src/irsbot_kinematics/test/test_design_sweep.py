"""Sweeps: which designs, in which chunks, judged like single ones."""

from __future__ import annotations

import tracemalloc

import numpy as np
import pytest

import irsbot_kinematics as irs
from irsbot_kinematics.design import PARAMETERS, ZONES, Designs, Plan, Range, check, judge, sweep
from irsbot_kinematics.design.sweep import chunks, designs
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry

FIXED = {"l1": 0.375, "l2eq": 0.825, "b": 0.1375, "p": 0.05, "a1": 0.42, "a2": 0.03, "beta": 0.17}


def plan(samples=None, seed=0, **ranges):
    return Plan({name: Range(value, value) for name, value in FIXED.items()} | ranges, samples, seed)


def joined(chunks):
    chunks = list(chunks)
    return {name: np.concatenate([chunk[name] for chunk in chunks]) for name in chunks[0]}


def test_a_grid_holds_every_combination_once_in_order():
    table = joined(sweep(plan(l1=Range(0.1, 0.3, 3), beta=Range(0.2, 0.8, 4)), chunk=5))
    assert table["l1"] == pytest.approx(np.repeat([0.1, 0.2, 0.3], 4))
    assert table["beta"] == pytest.approx(np.tile([0.2, 0.4, 0.6, 0.8], 3))
    assert set(table["b"]) == {0.1375}


def test_every_chunk_of_random_designs_is_a_latin_hypercube():
    ranges = {"l1": Range(0.1, 0.5), "p": Range(0.01, 0.2), "beta": Range(0.1, 1.4)}
    sizes = []
    for d in map(designs, chunks(plan(samples=2500, **ranges), 1000)):
        sizes.append(d.b.size)
        for name, values in ranges.items():
            place = (getattr(d, name) - values.low) / (values.high - values.low) * d.b.size
            assert sorted(np.floor(place)) == list(range(d.b.size))
    assert sizes == [1000, 1000, 500]


def test_the_seed_decides_the_designs():
    one, same, other = (
        [designs(chunk).l1 for chunk in chunks(plan(samples=100, seed=seed, l1=Range(0.1, 0.5)), 50)]
        for seed in (3, 3, 4)
    )
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)
    assert not np.array_equal(*one), "chunks do not repeat one another"


def test_a_swept_design_is_judged_like_a_single_one():
    ranges = {
        "l1": Range(0.05, 0.5),
        "l2eq": Range(0.1, 1.0),
        "b": Range(0.05, 0.6),
        "p": Range(0.005, 0.1),
        "a1": Range(0.11, 0.4),
        "a2": Range(0.02, 0.1),
        "beta": Range(0.1, 1.4),
    }
    table = joined(sweep(plan(samples=300, **ranges)))
    compared = 0
    for row in range(300):
        try:
            g = Irsbot2Geometry(**{name: float(table[name][row]) for name in PARAMETERS})
        except irs.InvalidGeometry:
            assert not (table["valid"][row] and table["zone_a"][row])
            continue
        verdict = check(g)
        assert table["valid"][row]
        assert {zone: bool(table[f"zone_{zone}"][row]) for zone in ZONES} == verdict.zones
        for finding in verdict.findings:
            assert table[f"slack_{finding.name}"][row] == finding.larger - finding.smaller
        compared += 1
    assert compared > 100


@pytest.mark.parametrize(
    "lengths",
    [
        {"a2": 0.42},
        {"a2": 0.5},
        {"beta": 0.0},
        {"beta": np.pi / 2},
        {"l1": -1.0},
        {"l1": 0.0},
        {"p": np.nan},
        {"l2eq": np.inf},
        {"b": 0.05 + 0.42 * np.sin(0.17)},
    ],
)
def test_a_design_that_no_machine_can_have_is_marked_and_in_no_zone(lengths):
    table = judge(Designs.columns({name: [value, {**FIXED, **lengths}[name]] for name, value in FIXED.items()}))
    assert table["valid"].tolist() == [True, False]
    assert not any(table[f"zone_{zone}"][1] for zone in ZONES)
    assert np.isnan(table["slack_equal"][1])
    assert table["n_C1a"].tolist() == [2, 0]


def test_a_design_that_cannot_be_assembled_is_in_no_zone_that_asks_for_it():
    table = judge(Designs.columns({name: [value] for name, value in {**FIXED, "b": 9.0}.items()}))
    assert table["valid"][0]
    assert table["slack_assembled"][0] < 0.0
    assert not any(table[f"zone_{zone}"][0] for zone in ("a", "wac", "z", "wps", "strict"))


def test_memory_is_bounded_by_the_chunk_not_by_the_number_of_designs():
    def peak(number):
        tracemalloc.start()
        for _ in sweep(plan(samples=number, l1=Range(0.1, 0.5), beta=Range(0.1, 1.4)), chunk=2000):
            pass
        _, most = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        return most

    assert peak(40_000) < 1.5 * peak(4_000)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Range(0.5, 0.1), "low <= high, got 0.5 against 0.1"),
        (lambda: Range(float("nan"), 0.1), "got nan"),
        (lambda: Range(0.1, 0.5, 0), "steps >= 1, got 0"),
        (lambda: Plan({"l1": Range(0.1, 0.2)}), "ranges of l1, l2eq"),
        (lambda: plan(samples=0), "samples >= 1, got 0"),
    ],
)
def test_a_plan_that_makes_no_sense_is_refused(make, words):
    with pytest.raises(irs.BadInput) as refusal:
        make()
    assert words in str(refusal.value)
