"""Ways out of a stop through the command gate: away moves, toward is blocked, OK is reached, nothing chatters.

A robot runs at a limit, past the gate, and is stopped. From where it stands velocity commands in many directions go
through the gate, each for a while; then it is led along the escape direction until its margins are good again, and
reset. What is away and what is toward is told by differences of the true margins.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from itertools import dropwhile, groupby
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Posture, Robot
from irsbot_msgs_py.records import Level
from irsbot_supervisor.campaign.rows import Job, Row, Tally
from irsbot_supervisor.campaign.truth import Array, followed, good_postures, limits, margins_along, supervised
from irsbot_supervisor.closed_loop import GuidedRobot
from irsbot_supervisor.core.assess import margins_of
from irsbot_supervisor.core.gate import DIP
from irsbot_supervisor.core.policy import KINDS
from irsbot_supervisor.core.reach import position_error
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import floor_of
from irsbot_supervisor.settings_file import read_settings

NAME = "escape"
MUST = "away moves, toward is blocked, OK is reached, no chatter"

DIRECTIONS = 16
"""Commands that are tried from every stopped state."""
TRIED_BEATS = 10
"""Heartbeats for which each is tried."""
SPEEDS = (0.3, 1.0)
"""1: share of full speed with which a robot runs at a limit, lowest and highest."""
RUN_BEATS = 200
"""Heartbeats in which a run meets a limit or is given up."""
REST_BEATS = 16
"""Heartbeats in which dwell times pass and a slow robot comes to rest."""
ESCAPE_BEATS = 1500
"""Heartbeats in which a robot at recovery speed has crossed any margin."""
CLEAR_SLOPE = 0.02
"""1/rad or 1/m: directions in which a margin changes less than this are neither away nor toward."""
PROBE = 1e-5
"""rad or m: step of the differences."""
BACK = 1.1
"""1: share of the warning limits at which a robot counts as out."""
MOST_LEVELS = 4
"""Levels from a stop on: STOP, and after the reset WARN, OK, WARN at most. What was warned of before is the run's."""


class Stopped(NamedTuple):
    """A robot that ran at a limit and stands, latched."""

    guided: GuidedRobot
    at: Posture  # where it truly is: on the branch on which it began, which not every robot can tell by a label


def run(job: Job) -> Row:
    """The row: a case is a stopped state, the same number for every robot."""
    tally = Tally(NAME, job)
    names = job.robots or supervised()
    tally.figures.update({"away moved": 0.0, "toward blocked": 0.0, "reached OK": 0.0})
    for k, name in enumerate(names):
        rng = np.random.default_rng([job.seed, k])
        settings, robot = read_settings(name)
        for stopped in stopped_robots(robot, settings, -(-job.amount // len(names)), rng):
            unsafe, failed = _try_directions(stopped, rng, tally)
            failed = failed or _lead_out(deepcopy(stopped), tally)
            tally.case(f"{name}: {unsafe}" if unsafe else "", f"{name}: {failed}" if failed else "")
    return tally.row()


def stopped_robots(robot: Robot, settings: Settings, number: int, rng: np.random.Generator) -> Iterator[Stopped]:
    """As many of them; how they got there differs."""
    found = 0
    while found < number:
        for start in good_postures(robot, settings, number - found, rng):
            guided = GuidedRobot(robot, settings, tuple(start.tolist()))
            at = robot.mechanism.posture(tuple(start.tolist()), settings.assembly_mode)
            for _ in range(REST_BEATS):
                guided.drift()
            direction = rng.uniform(-1.0, 1.0, len(start))
            speed = rng.uniform(*SPEEDS) * np.array(settings.velocity_limit)
            rates = tuple((speed * direction / np.abs(direction).max()).tolist())
            for _ in range(RUN_BEATS):
                guided.rush(rates)
                at = _followed(guided, at)
                if guided.now.level >= Level.STOP:
                    break
            for _ in range(2 * REST_BEATS):  # whoever drives it goes on commanding, through the gate now
                guided.beat(rates)
                at = _followed(guided, at)
            if guided.now.latched and guided.now.level == Level.STOP and _kinds(guided):
                found += 1
                yield Stopped(guided, at)


def _followed(guided: GuidedRobot, at: Posture) -> Posture:
    """Where the robot truly is by now."""
    robot = guided.supervisor.robot
    if robot.mechanism.labels_hold:
        return at
    *_, now = followed(robot, np.array([guided.drives.now.position]), at)
    return now


def _try_directions(stopped: Stopped, rng: np.random.Generator, tally: Tally) -> tuple[str, str]:
    """Commands in all directions from a stopped state; what was unsafe, what else was wrong."""
    guided, at = stopped
    settings, robot = guided.settings, guided.supervisor.robot
    start, speed = np.array(guided.drives.now.position), np.array(settings.velocity_limit)
    kinds = _kinds(guided)
    most = DIP + PROBE + _uncertain(guided, kinds)
    unsafe = failed = ""
    for _ in range(DIRECTIONS):
        direction = rng.normal(size=len(start))
        direction /= np.abs(direction).max()
        tried = deepcopy(guided)
        way = [start]
        for _beat in range(TRIED_BEATS):
            tried.beat(tuple((speed * direction).tolist()))
            way.append(np.array(tried.drives.now.position))
        found = margins_along(robot, settings, np.array(way), at)[:, kinds]
        slopes = _slopes(stopped, direction)[kinds]
        lost = float((found[0] - found).max())
        tally.largest("most that was lost of a margin", lost)
        if not lost <= most:
            unsafe = unsafe or f"a margin fell by {lost:.4f} on the way out"
        if slopes.min() > CLEAR_SLOPE:
            moved = bool(np.abs(way[-1] - start).max() > 0.0)
            tally.add("away moved", float(moved))
            failed = failed or ("" if moved else "motion away was held")
        elif slopes.min() < -CLEAR_SLOPE:
            tally.add("toward blocked", float(lost <= most))
    return unsafe, failed


def _uncertain(guided: GuidedRobot, kinds: list[int]) -> float:
    """What the errors of the joints leave open of the margins that a stop is about: the gate keeps bounds of them."""
    settings, mechanism, view = guided.settings, guided.supervisor.robot.mechanism, guided.supervisor.view
    assert view is not None, "a stopped robot is known"
    errors = (position_error(settings),) * len(mechanism.joints)
    floor = floor_of(mechanism.guarantee(view.at, errors, settings.slack_m))
    return max(margins_of(view.at)[kind] - floor[kind] for kind in kinds)


def _lead_out(stopped: Stopped, tally: Tally) -> str:
    """Along the escape direction until the margins are good, then a reset. Returns what went wrong."""
    guided, at = stopped
    settings, robot = guided.settings, guided.supervisor.robot
    kinds = _kinds(guided)
    rates = tuple(v * e for v, e in zip(settings.velocity_limit, guided.now.escape, strict=True))
    enough = BACK * limits(settings, "warn")[kinds]

    def is_out() -> bool:
        here = np.array([guided.drives.now.position])
        return bool((margins_along(robot, settings, here, at)[0, kinds] >= enough).all())

    beats = 0
    while beats < ESCAPE_BEATS and not is_out():
        guided.beat(rates)
        at = _followed(guided, at)
        beats += 1
    for _ in range(REST_BEATS):
        guided.beat((0.0,) * len(rates))
    refusal = guided.reset()
    for _ in range(REST_BEATS):
        guided.drift()
    out = not guided.now.latched and guided.now.level <= Level.WARN
    tally.add("reached OK", float(out))
    tally.largest("longest way out [s]", beats * settings.heartbeat_s)
    since = dropwhile(lambda turn: turn.level != Level.STOP, guided.turns)
    levels = sum(1 for _level in groupby(turn.level for turn in since))
    tally.largest("most changes of level", float(levels))
    if not out:
        return f"not out after {beats} heartbeats: {refusal or guided.now.level.name}"
    return "" if levels <= MOST_LEVELS else f"the level changed {levels} times"


def _slopes(stopped: Stopped, direction: Array) -> Array:
    """(4,) how the true margins change along a direction, 1/rad or 1/m; 0 where the robot has none."""
    guided, at = stopped
    start = np.array(guided.drives.now.position)
    way = np.array([start - PROBE * direction, start, start + PROBE * direction])
    found = margins_along(guided.supervisor.robot, guided.settings, way, at)
    found = np.where(np.isfinite(found), found, 0.0)
    return np.asarray((found[2] - found[0]) / (2.0 * PROBE))


def _kinds(guided: GuidedRobot) -> list[int]:
    """The margins that the stop in force is about."""
    return [index for index, kind in enumerate(KINDS) if guided.now.causes & int(kind)]
