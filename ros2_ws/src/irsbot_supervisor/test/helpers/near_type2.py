"""Robots near Type 2. Of rails3 a place where it may stand, with Type 2 only millimetres away: where a time without
samples can lose the branch."""

from __future__ import annotations

from functools import cache
from itertools import product
from math import acos, pi

from supervised import feed, joints_of, newest, sample, supervisor_of

import irsbot_kinematics as irs
from irsbot_msgs_py.records import Floats, JointSample, Level
from irsbot_supervisor.core.supervisor import Supervisor

FREE, TOWARDS = (-0.086153889149302, 0.7385104115796117, 0.7359930647205954), (-1.0, 1.0, 1.0)
"""Joint positions of rails3, m, where it may stand, and the direction in which Type 2 is 4.6 mm away."""

STAND_MS = 300

ALWAYS = {"reaction_check": "stop", "reaction_limit_n": 1e-9}
"""Settings that stop every robot for its reactions alone."""


def along(way_m: float, start: Floats = FREE) -> Floats:
    """Joint positions that much nearer to Type 2."""
    return tuple(q + u * way_m for q, u in zip(start, TOWARDS, strict=True))


def distance_m() -> float:
    """How far Type 2 is from FREE."""
    supervisor = supervisor_of("rails3")
    mechanism = supervisor.robot.mechanism
    at, way_m, step_m = mechanism.posture(FREE, supervisor.settings.assembly_mode), 0.0, 1e-4
    while step_m > 1e-9:
        if (found := mechanism.track(along(way_m + step_m), at)).status == irs.Status.SOLVED:
            at, way_m = found, way_m + step_m
        else:
            step_m *= 0.5
    assert min(at.cos_pressure) < 1e-3, "not Type 2"
    return way_m


def out_s(way_m: float) -> float:
    """Least time in which the drives go so far from rest: at the largest acceleration, then at the largest speed."""
    settings = supervisor_of("rails3").settings
    v, a = settings.velocity_limit[0], settings.acceleration_limit[0]
    return v / a + (way_m - 0.5 * v * v / a) / v


def standing(begin_ms: int, end_ms: int, position: Floats = FREE) -> list[JointSample]:
    names = supervisor_of("rails3").settings.joint_names
    return [sample(ms, position, names=names) for ms in range(begin_ms, end_ms)]


def stood_at(position: Floats) -> Supervisor:
    """A supervisor of rails3 that says OK of a robot that has stood until time 0."""
    supervisor = supervisor_of("rails3")
    steps = feed(supervisor, standing(-STAND_MS, 1, position))
    assert newest(steps).level == Level.OK
    return supervisor


@cache
def until_type2(name: str) -> tuple[Floats, Floats]:
    """Where a robot may stand, and a way from there to a Type 2 singularity."""
    supervisor = supervisor_of(name)
    mechanism = supervisor.robot.mechanism
    if name == "irsbot2_beta45":  # the cranks stand mirrored; its elbows meet where b0 + l1 cos q2 = 0
        away = joints_of(supervisor, 0.0, -0.8)[1]
        way = -acos(-mechanism.geometry.b0 / mechanism.geometry.l1) - away
        return (-pi - away, away), (-way, way)
    start = FREE if name == "rails3" else joints_of(supervisor, 0.0, 0.0, 0.0)
    ways = []
    for signs in product((-1.0, 0.0, 1.0), repeat=len(start)):
        at, way, step = mechanism.posture(start, supervisor.settings.assembly_mode), 0.0, 1e-2
        while any(signs) and step > 1e-10 and way < 2.0:
            there = tuple(q + (way + step) * sign for q, sign in zip(start, signs, strict=True))
            found = mechanism.track(there, at)
            at, way, step = (found, way + step, step) if found.status == irs.Status.SOLVED else (at, way, 0.5 * step)
        if min(at.cos_pressure) < 1e-2:
            ways.append(tuple(way * sign for sign in signs))
    return start, min(ways, key=lambda way: max(map(abs, way)))
