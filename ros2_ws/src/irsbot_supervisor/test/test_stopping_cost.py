"""What it costs that a robot goes on until it stands, against formulas on paper and margins on a grid."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, isnan, pi, sqrt

import numpy as np
import pytest
from supervised import settings_of

from irsbot_supervisor.configuration.stoppable_speed import postures
from irsbot_supervisor.configuration.stopping_cost import Cost, costs
from irsbot_supervisor.core.stopping import limits_of

WHAT = ["as stated", "half of latency_s", "twice the rate", "half of acceleration_limit", "stamp_jitter_s 0"]


def way(v: float, gain: float, fastest: float, brake: float, free_s: float) -> float:
    """The theorem, integrated in small steps: speed up, at most to the limit, then brake."""
    s, steps = 0.0, 20000
    for _ in range(steps):
        faster = min(v + gain * free_s / steps, fastest)
        s, v = s + 0.5 * (v + faster) * free_s / steps, faster
    return s + v * v / (2.0 * brake)


def at_rest(gain: float, error: float, period_s: float) -> float:
    """Two equal positions a time D apart: the joint moved by 2 e at most and sped up since, or turned round."""
    longest = (ceil(sqrt(4.0 * error / gain) / period_s) + 1) * period_s  # the oldest position that is kept
    spans = [period_s * 2**k for k in range(12) if period_s * 2**k < longest]
    return min(max(2.0 * error / span + 0.5 * gain * span, gain * span) for span in [*spans, longest])


@pytest.mark.parametrize(("name", "rate_hz"), [("irsbot2", 1000.0), ("irsbot2", 100.0), ("linear_delta", 2000.0)])
def test_the_ways_are_those_of_the_theorem(name, rate_hz):
    settings, robot = settings_of(name)
    rows = costs(settings, robot.mechanism, rate_hz)
    assert [row.machine for row in rows] == WHAT
    latency, gain, tau = settings.latency_s, settings.acceleration_limit[0], settings.stamp_jitter_s
    fastest, brake = settings.velocity_limit[0], settings.deceleration_limit[0]
    machines = [
        (latency, rate_hz, gain, tau),
        (0.5 * latency, rate_hz, gain, tau),
        (latency, 2.0 * rate_hz, gain, tau),
        (latency, rate_hz, 0.5 * gain, tau),
        (latency, rate_hz, gain, 0.0),
    ]
    for row, (late, rate, most, jitter) in zip(rows, machines, strict=True):
        free_s = late + 1.0 / rate + min(1.0 / rate, 0.005)  # judging a sample takes 5 ms at most
        error = 0.5 * settings.encoder_resolution + jitter * fastest
        rest = way(at_rest(most, error, 1.0 / rate), most, fastest, brake, free_s) + error
        assert row.free_s == pytest.approx(free_s, rel=1e-12)
        assert row.from_rest == pytest.approx((rest,) * len(row.from_rest), rel=1e-4)
        full = fastest * free_s + fastest**2 / (2.0 * brake) + error
        assert row.from_full == pytest.approx((full,) * len(row.from_full), rel=1e-9)


def share_on_a_grid(name: str, row: Cost) -> float:
    """Of the postures above the stop limits, those that lose a margin somewhere on a grid over the box."""
    settings, robot = settings_of(name)
    found, stop = postures(settings, robot.mechanism), np.array(limits_of(settings, "stop"))
    lost = []
    for q in found.joints[(found.margins >= stop).all(axis=1)][::4]:
        axes = [np.linspace(a - half, a + half, 5) for a, half in zip(q, row.from_rest, strict=True)]
        near = robot.evaluate_many(np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(q)))
        kept = (near.type1_margin.min(axis=1) >= stop[0]) & (near.type2_margin >= stop[1])
        kept &= np.isnan(near.constraint_margin) | (near.constraint_margin >= stop[2])
        lost.append(not kept.all())
    return float(np.mean(lost))


@pytest.mark.parametrize("name", ["irsbot2", "five_bar"])
def test_the_share_of_postures_is_at_most_twice_the_true_share(name):
    settings, robot = settings_of(name)
    rows = costs(settings, robot.mechanism, 1000.0)
    for row in rows[:2]:
        true = share_on_a_grid(name, row)
        assert true - 0.03 <= row.stopped <= 2.0 * true + 0.03
    assert all(row.stopped <= rows[0].stopped for row in rows), "less of anything is no worse"
    assert rows[1].stopped < rows[0].stopped


def test_platform_metres_are_the_displacement_by_one_crank():
    """The platform of two rods moves with a crank of l1 = 1/margin at most as fast as its end."""
    settings, robot = settings_of("irsbot2")
    row = costs(settings, robot.mechanism, 1000.0)[0]
    crank = robot.mechanism.geometry.l1
    for platform, joints in ((row.platform_rest_m, row.from_rest), (row.platform_full_m, row.from_full)):
        assert 0.3 * crank * joints[0] < platform < 3.0 * crank * joints[0] < pi * crank


def test_a_robot_without_a_posture_above_its_limits_is_always_stopped():
    settings, robot = settings_of("irsbot2")
    rows = costs(replace(settings, type2_stop=1.0), robot.mechanism, 1000.0)
    assert all(row.stopped == 1.0 and isnan(row.platform_rest_m) for row in rows)
