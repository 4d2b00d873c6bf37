"""The numbers of docs/explanation/guarantee.md follow from the theorem and the shipped settings."""

from __future__ import annotations

import re
from math import ceil, sqrt
from pathlib import Path

import pytest

import irsbot_kinematics as irs
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.core.settings import Settings

PAGE = (Path(__file__).parents[1] / "docs" / "explanation" / "guarantee.md").read_text()
PERIOD_S = 1e-3
SHIPPED = sorted(name for name in irs.robots() if shipped_values(irs.make_robot(name)))


def error(settings: Settings) -> float:
    """e' of the first joint."""
    e = 0.5 * settings.encoder_resolution + settings.encoder_offset
    return e + settings.stamp_jitter_s * settings.velocity_limit[0]


def at_rest(settings: Settings) -> float:
    """v+ of a joint whose positions are all equal: the best of the positions that the observer looks at."""
    a, e = settings.acceleration_limit[0], error(settings)
    oldest = (ceil(sqrt(4.0 * e / a) / PERIOD_S) + 1) * PERIOD_S
    spans = [PERIOD_S * 2**k for k in range(10) if PERIOD_S * 2**k < oldest]
    return min(max(2.0 * e / span + 0.5 * a * span, a * span) for span in [*spans, oldest])


def reach(settings: Settings, v: float, **other: float) -> float:
    """s+ of the page, first joint."""
    V, a = other.get("V", settings.velocity_limit[0]), other.get("a", settings.acceleration_limit[0])
    d, T = other.get("d", settings.deceleration_limit[0]), other.get("T", settings.latency_s + 2.0 * PERIOD_S)
    t1, v1 = min((V - v) / a, T), min(v + a * T, V)
    return v * t1 + a * t1**2 / 2 + V * (T - t1) + v1**2 / (2 * d)


def unseen(settings: Settings) -> float:
    return settings.velocity_limit[0] * (settings.stale_s + settings.heartbeat_s - 2.0 * PERIOD_S)


def row(name: str) -> str:
    settings, robot = read_settings(name)
    unit = robot.mechanism.joints[0].unit
    v = at_rest(settings)
    numbers = [1e3 * (settings.latency_s + 2.0 * PERIOD_S), v, reach(settings, v) + error(settings)]
    numbers += [reach(settings, settings.velocity_limit[0]) + error(settings), unseen(settings)]
    return f"| {name} | {unit} | " + " | ".join(f"{number:.3g}" for number in numbers) + " |"


def costs() -> dict[str, float]:
    """What the table of what is not covered says, by what its line begins with."""
    s, _robot = read_settings("irsbot2")
    V, a, d = s.velocity_limit[0], s.acceleration_limit[0], s.deceleration_limit[0]
    rest, full, slow = at_rest(s), reach(s, V), s.recovery_share * V
    return {
        "a silence": unseen(s),
        "drives that are faster": reach(s, 1.1 * V, V=1.1 * V) - full,
        "drives that speed up harder": reach(s, rest, a=1.1 * a) - reach(s, rest),
        "brakes that are weaker": reach(s, V, d=0.9 * d) - full,
        "brakes that act 1 ms later": V * 1e-3,
        "an encoder that freezes while": V * 0.02,
        "an encoder that freezes while the message": d * 0.02**2 / 2,  # the motion at which a slow joint is detected
        "the way out of a stop": slow * s.latency_s + slow**2 / (2 * d),
    }


@pytest.mark.parametrize("name", SHIPPED)
def test_the_box_of_every_shipped_robot_is_the_one_of_the_theorem(name: str) -> None:
    (stated,) = re.findall(rf"^\| {name} \|.*$", PAGE, re.MULTILINE)
    assert stated == row(name)
    settings, _robot = read_settings(name)
    assert len(set(settings.velocity_limit)) == 1, "one row is enough for all joints"


@pytest.mark.parametrize(("begin", "cost"), costs().items())
def test_the_costs_of_what_is_not_covered_are_those_of_the_page(begin: str, cost: float) -> None:
    (stated,) = re.findall(rf"^\| {begin}.*\|(.*)\|$", PAGE, re.MULTILINE)
    assert f"{cost:.2g} rad" in stated


def test_the_rows_are_the_shipped_robots_and_no_others() -> None:
    table = PAGE.split("## The boxes")[1].split("## What is not covered")[0]
    assert sorted(re.findall(r"^\| (\w+) \| (?:rad|m) \|", table, re.MULTILINE)) == SHIPPED


def test_every_setting_that_is_assumed_exists() -> None:
    assumed = set(re.findall(r"`([a-z0-9]+(?:_[a-z0-9]+)+)`", PAGE.split("## Proof")[0]))
    assert assumed - set(Settings.__dataclass_fields__) == set()
