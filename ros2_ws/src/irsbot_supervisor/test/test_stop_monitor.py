"""Stops that keep to their brakes are measured and say nothing; others are named."""

from __future__ import annotations

from math import tau

import numpy as np
import pytest
from supervised import settings_of

from irsbot_msgs_py.records import Cause, Finding, Level
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.estimator import Estimator
from irsbot_supervisor.core.stop_monitor import StopMonitor
from irsbot_supervisor.core.validation import Accepted

BRAKE, LATENCY_S = 400.0, 0.01  # shipped
SEEN_NS, STAMP_NS = 10**9, 10**15


class Stopped:
    """joint_1 of irsbot2 at a rate, rad/s, joint_2 at another; stopped by the sample at 60 ms."""

    def __init__(self, rate: float = 6.0, begin: float = 0.0, *, other: float = 0.0, **changes) -> None:
        settings, robot = settings_of(**changes)
        self.monitor = StopMonitor(settings, robot.mechanism.joints)
        self._estimator = Estimator(settings, robot.mechanism.joints)
        self._rate, self._begin, self._other, self._ms = rate, begin, other, 0
        self.findings: list[Finding] = []

    def see(self, position: float, second: float = 1.0) -> Estimate:
        stamp = self._ms * 10**6
        position = float(np.remainder(position + np.pi, tau) - np.pi)
        sample = Accepted(STAMP_NS + stamp, STAMP_NS + stamp, SEEN_NS + stamp, (position, second), (), ())
        estimate = self._estimator.update(sample)
        assert isinstance(estimate, Estimate)
        self.findings += self.monitor.look(estimate)
        self._ms += 1
        return estimate

    def run(self, brake: float = BRAKE, latency_s: float = LATENCY_S, rest_ms: int = 100) -> StopMonitor:
        """Steady motion, the stop, brakes that act when they do and as hard as they do, and rest."""
        for k in range(61):
            estimate = self.see(self._begin + 1e-3 * k * self._rate, 1.0 + 1e-3 * k * self._other)
        self.monitor.begin(estimate)
        stop_s = latency_s + abs(self._rate) / brake
        for k in range(1, round(1e3 * stop_s) + rest_ms):
            t = min(1e-3 * k, stop_s)
            braking = max(t - latency_s, 0.0)
            way = self._rate * t - 0.5 * np.sign(self._rate) * brake * braking**2
            other = self._other * min(t, 0.5 * latency_s)  # stops within half of the latency
            self.see(self._begin + 0.06 * self._rate + way, 1.0 + 0.06 * self._other + other)
        self._begin += 0.06 * self._rate + way
        return self.monitor


@pytest.mark.parametrize("rate", [6.0, -6.0, 11.0, 0.5])
@pytest.mark.parametrize("at", [0.0, 3.14, -3.14])
@pytest.mark.parametrize("harder", [1.0, 3.0])
def test_a_stop_within_its_brakes_has_no_finding_and_is_measured(rate, at, harder):
    """Also where it leads across half a turn. at: rad where the stop begins."""
    stopped = Stopped(rate, at - 0.06 * rate)
    last = stopped.run(harder * BRAKE).last
    assert stopped.findings == []
    assert last is not None
    way, time_s = abs(rate) * LATENCY_S + rate**2 / (2.0 * harder * BRAKE), LATENCY_S + abs(rate) / (harder * BRAKE)
    assert (last.joint, last.unit) == ("joint_1", "rad")
    assert last.way == pytest.approx(way, abs=1e-6)
    assert last.way <= last.allowed
    # 1 ms of sampling, and what the last crawl below the standstill speed goes unnoticed.
    assert last.time_s == pytest.approx(time_s, abs=2e-3)
    assert last.time_s <= last.allowed_s + 1e-3


@pytest.mark.parametrize("other", [-10.0, 10.0])
@pytest.mark.parametrize("rate", [3.0, -3.0])
def test_the_measured_joint_is_the_one_with_the_largest_share_of_its_allowance(rate, other):
    """joint_2 goes farther, 0.05 rad in half of the latency, but may go much farther."""
    last = Stopped(rate, other=other).run().last
    assert last is not None
    assert last.joint == "joint_1"
    assert last.way == pytest.approx(3.0 * LATENCY_S + 9.0 / (2.0 * BRAKE), abs=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_that_swings_back_is_measured_by_the_way_that_takes_more_of_its_allowance(sign):
    stopped = Stopped(0.5 * sign)
    for k in range(61):
        estimate = stopped.see(sign * 5e-4 * k)
    stopped.monitor.begin(estimate)
    ways = [*np.linspace(0.0, 6e-3, 15), *np.linspace(6e-3, -2e-4, 40), *[-2e-4] * 100]
    for way in ways:
        stopped.see(sign * (0.03 + way))
    last = stopped.monitor.last
    assert last is not None
    assert last.way == pytest.approx(6e-3, abs=1e-9)


@pytest.mark.parametrize("rate", [12.0, -12.0])
def test_brakes_may_begin_the_latency_after_a_verdict_that_takes_half_an_interval(rate):
    """At full speed, where no drive speeds up; samples come every millisecond."""
    stopped = Stopped(rate)
    stopped.run(latency_s=LATENCY_S + 0.0005)
    assert stopped.findings == []


@pytest.mark.parametrize("rate", [11.0, -11.0])
def test_the_allowance_is_the_displacement_of_the_worst_drive(rate):
    """The speed is 11 rad/s and up to 12 certain; drives may speed up to 12 until the brakes act, 10 ms and one of
    judging later: no less than of what is seen, no more than from full speed."""
    last = Stopped(rate).run().last
    assert 11.0 * 0.01 + 11.0**2 / 800.0 <= last.allowed <= 12.0 * 0.0115 + 12.0**2 / 800.0 + 2.0 * 0.00061
    assert 0.01 + 11.0 / 400.0 <= last.allowed_s <= 0.0115 + 12.0 / 400.0


@pytest.mark.parametrize(
    "fault", [{"brake": 0.5 * BRAKE}, {"latency_s": LATENCY_S + 0.02}, {"brake": 0.1 * BRAKE}], ids=str
)
@pytest.mark.parametrize("rate", [10.0, -10.0])
def test_brakes_that_are_weaker_or_later_than_configured_are_named_with_joint_way_and_allowed_way(fault, rate):
    stopped = Stopped(rate)
    last = stopped.run(**fault, rest_ms=120).last
    assert stopped.findings
    for finding in stopped.findings:
        assert (finding.level, finding.cause, finding.unit) == (Level.WARN, Cause.BRAKING, "rad")
        assert finding.value > finding.limit
        assert "joint_1" in finding.text
        assert f"{finding.limit:.4g} rad" in finding.text
        assert f"{finding.value:.4g} rad" in finding.text
    brake, latency_s = fault.get("brake", BRAKE), fault.get("latency_s", LATENCY_S)
    way = 10.0 * latency_s + 50.0 / brake
    assert stopped.findings[-1].value == pytest.approx(way, abs=1e-4)
    assert last.way == pytest.approx(way, abs=1e-4)
    assert last.way > last.allowed


def test_before_a_stop_and_after_rest_there_is_no_finding():
    stopped = Stopped(6.0)
    assert stopped.monitor.last is None
    stopped.run()
    first = stopped.monitor.last
    for k in range(200):
        stopped.see(0.46 + 1e-3 * 6.0 * k)  # the robot works again
    assert stopped.findings == []
    assert stopped.monitor.last is first


def test_every_stop_is_measured_by_itself():
    stopped = Stopped(10.0)
    first = stopped.run().last
    stopped._rate = -4.0
    second = stopped.run().last
    assert stopped.findings == []
    assert first.way == pytest.approx(0.1 + 0.125, abs=1e-6)
    assert second.way == pytest.approx(0.04 + 0.02, abs=1e-6)
    assert second.allowed < first.allowed


def test_a_stop_that_has_begun_is_measured_by_the_limits_it_began_with():
    stopped = Stopped(10.0)
    for k in range(61):
        estimate = stopped.see(1e-2 * k)
    stopped.monitor.begin(estimate)
    stopped.monitor.configure(settings_of(latency_s=0.0, deceleration_limit=4000.0)[0])
    for k in range(1, 36):
        t = 1e-3 * k
        stopped.see(0.6 + 10.0 * t - 200.0 * max(t - 0.01, 0.0) ** 2)
    assert stopped.findings == []


def test_no_stop_is_over_before_the_robot_has_stood_for_the_stale_limit():
    stopped = Stopped(6.0)
    assert stopped.run(rest_ms=40).last is None
    for _ in range(20):
        stopped.see(stopped._begin)
    assert stopped.monitor.last is not None
