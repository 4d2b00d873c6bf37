"""Ways out of a stop through the command gate: motion away passes, no margin is lost, OK is reached, levels do not
flicker.

A robot moves beyond a limit, past the gate, and is stopped. From there, velocity commands in many directions go through
the gate, each for a while. Then the robot follows the escape direction until its margins are large again, and is
reset. Differences of the true margins decide what is away and what is towards.
"""

from __future__ import annotations

from collections.abc import Iterator
from copy import deepcopy
from itertools import dropwhile, groupby
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Posture, Robot
from irsbot_msgs_py.records import Level
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import release_of
from irsbot_supervisor.sim.closed_loop import GuidedRobot
from irsbot_supervisor.validation.harness.oracle import (
    ROUNDING,
    Array,
    followed,
    good_postures,
    limits,
    margins_along,
    supervised,
)
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally

NAME = "escape"
MUST = "away moves, no margin is lost, robots held at rest are led out, OK is reached, no chatter"

DIRECTIONS = 16
"""Number of commands that are tried from every stopped state."""
TRIED_BEATS = 10
"""Number of heartbeats for which each is tried."""
SPEEDS = (0.3, 1.0)
"""1: share of full speed with which a robot moves to a limit, lowest and highest."""
RUN_BEATS = 200
"""Number of heartbeats after which a run that has met no limit is given up."""
REST_BEATS = 16
"""Number of heartbeats in which dwell times pass and a slow robot comes to rest."""
FOLLOWED_BEATS = 1000
"""Number of heartbeats for which the escape direction is followed at most."""
ESCAPE_BEATS = 1500
"""Number of heartbeats in which a robot at recovery speed has crossed any margin."""
BACK_BEATS = 50
"""Number of heartbeats for which a robot is moved towards its start after a reset that was refused."""
CLEAR_SLOPE = 0.02
"""1/rad or 1/m: directions in which a margin changes less than this count as neither away nor towards."""
LOST = 0.003
"""1: what a margin may lose on the way out, of 0.15 that it has: a gate that keeps bounds over the way knows margins to
about this, errors of the joints included."""
PROBES = (1e-5, 1e-3)
"""rad or m: steps of the differences. Away is where a margin grows from the first: where two legs are nearly equal, the
other one may soon be the worst."""
LED_NOWHERE = 0.5
"""1: of the runs that hold a robot at rest, the largest share in which a reset is still refused at the end of the
escape direction: where two margins grow in opposite directions, there is none."""
FEW = 2
"""Number of such runs of one robot that is tolerated whatever the share."""
MOST_LEVELS = 4
"""Largest number of levels from a stop on: STOP, and after the reset at most WARN, OK, WARN. Earlier warnings belong to
the run."""


class Stopped(NamedTuple):
    """A robot that moved beyond a limit and stands, latched."""

    guided: GuidedRobot
    start: Array  # where it was OK, rad or m
    at: Posture  # where it truly is: on the branch on which it began, which not every robot can tell by a label


def run(job: Job) -> Row:
    """The row: a case is a stopped state, the same number for every robot."""
    tally = Tally(NAME, job)
    names = job.robots or supervised()
    tally.figures.update(
        dict.fromkeys(("away moved", "toward without loss", "held at rest", "moved back", "reached OK"), 0.0)
    )
    for k, name in enumerate(names):
        rng = np.random.default_rng([job.seed, k])
        settings, robot = read_settings(name)
        before = {what: tally.figures[what] for what in ("held at rest", "moved back")}
        for stopped in stopped_robots(robot, settings, -(-job.amount // len(names)), rng):
            unsafe, failed = _try_directions(stopped, rng, tally)
            failed = failed or _lead_out(deepcopy(stopped), tally)
            tally.case(f"{name}: {unsafe}" if unsafe else "", f"{name}: {failed}" if failed else "")
        held, back = (int(tally.figures[what] - before[what]) for what in before)
        if led_nowhere(held, back):
            tally.many(0, 1, f"{name}: {back} of {held} runs that held it at rest did not lead it out")
    return tally.row()


def led_nowhere(held: int, back: int) -> bool:
    """True if too many of the runs that held a robot at rest ended with a refused reset."""
    return back > max(LED_NOWHERE * held, FEW)


def stopped_robots(robot: Robot, settings: Settings, number: int, rng: np.random.Generator) -> Iterator[Stopped]:
    """Stopped robots, each with another run."""
    found = 0
    while found < number:
        for start in good_postures(robot, settings, number - found, rng):
            guided = GuidedRobot(robot, settings, tuple(start.tolist()))
            at = robot.mechanism.posture(tuple(start.tolist()), settings.assembly_mode)
            for _ in range(REST_BEATS):
                guided.drift()
            if guided.now.level >= Level.STOP:
                continue  # a robot at rest there could not be stopped: there is nowhere to return to
            direction = rng.uniform(-1.0, 1.0, len(start))
            speed = rng.uniform(*SPEEDS) * np.array(settings.velocity_limit)
            rates = tuple((speed * direction / np.abs(direction).max()).tolist())
            for _ in range(RUN_BEATS):
                guided.rush(rates)
                at = _followed(guided, at)
                if guided.now.level >= Level.STOP:
                    break
            for _ in range(2 * REST_BEATS):  # the commands continue, now through the gate
                guided.beat(rates)
                at = _followed(guided, at)
            if guided.now.latched and guided.now.level == Level.STOP and _kinds(guided):
                found += 1
                yield Stopped(guided, start, at)


def _followed(guided: GuidedRobot, at: Posture) -> Posture:
    """True present posture of the robot."""
    robot = guided.supervisor.robot
    if robot.mechanism.label_is_invariant:
        return at
    *_, now = followed(robot, np.array([guided.drives.now.position]), at)
    return now


def _try_directions(stopped: Stopped, rng: np.random.Generator, tally: Tally) -> tuple[str, str]:
    """Commands in all directions from a stopped state; returns what was unsafe, and what failed."""
    guided, _start, at = stopped
    settings, robot = guided.settings, guided.supervisor.robot
    start, speed = np.array(guided.drives.now.position), np.array(settings.velocity_limit)
    kinds = _kinds(guided)
    others = [kind for kind in range(len(MARGIN_CAUSES)) if kind not in kinds]
    stop = limits(settings, "stop")
    unsafe = failed = ""
    for _ in range(DIRECTIONS):
        direction = rng.normal(size=len(start))
        direction /= np.abs(direction).max()
        tried = deepcopy(guided)
        way, held = [start], [kinds]
        for _beat in range(TRIED_BEATS):
            tried.beat(tuple((speed * direction).tolist()))
            way.append(np.array(tried.drives.now.position))
            now = _kinds(tried)
            held.append([kind for kind in held[-1] if kind in now])  # what is no cause any more may fall to its limit
        found = margins_along(robot, settings, np.array(way), at)
        best = np.minimum(found[0], release_of(settings))  # a margin above its warning limit may fall to it
        lost = max([float((best[left] - now[left]).max()) for now, left in zip(found, held, strict=True) if left])
        beyond = float((np.minimum(found[0], stop) - found)[:, others].max(initial=0.0))
        slopes = _slopes(stopped, direction)[kinds]
        tally.largest("most that was lost of a margin", lost)
        tally.largest("most that another margin fell below its stop limit", beyond)
        if not lost <= LOST:
            unsafe = unsafe or f"a margin fell by {lost:.4f} on the way out"
        if not beyond <= ROUNDING:
            unsafe = unsafe or f"a margin that had not caused the stop fell {beyond:.4f} below its limit on the way out"
        if slopes.min() > CLEAR_SLOPE:
            moved = bool(np.abs(way[-1] - start).max() > 0.0)
            tally.add("away moved", float(moved))
            failed = failed or ("" if moved else "motion away was held")
        elif slopes.min() < -CLEAR_SLOPE:
            tally.add("toward without loss", float(lost <= LOST))
    return unsafe, failed


def _lead_out(stopped: Stopped, tally: Tally) -> str:
    """Follow the escape direction until there is none, then reset. If that is refused, or the direction leads nowhere,
    move towards the start. Returns the fault, or empty."""
    guided, start, _at = stopped
    settings = guided.settings
    speed, beats = np.array(settings.velocity_limit), 0
    while beats < FOLLOWED_BEATS and (way := guided.way_out):
        guided.beat(tuple((speed * way).tolist()))
        beats += 1
    refusal = _reset(guided)
    tally.add("held at rest", float(beats > 0 or bool(refusal)))
    tally.add("moved back", float(bool(refusal)))
    while refusal and beats < ESCAPE_BEATS:
        for _ in range(BACK_BEATS):
            guided.beat(tuple((speed * (start - guided.drives.now.position)).tolist()))
        beats += BACK_BEATS
        refusal = _reset(guided)
    for _ in range(REST_BEATS):
        guided.drift()
    out = not guided.now.latched and guided.now.level <= Level.WARN
    tally.add("reached OK", float(out))
    tally.largest("longest way out [s]", beats * settings.heartbeat_s)
    since = dropwhile(lambda turn: turn.level != Level.STOP, guided.transitions)
    levels = sum(1 for _level in groupby(turn.level for turn in since))
    tally.largest("most changes of level", float(levels))
    if not out:
        return f"not out after {beats} heartbeats: {refusal or guided.now.level.name}"
    return "" if levels <= MOST_LEVELS else f"the level changed {levels} times"


def _reset(guided: GuidedRobot) -> str:
    """Let the robot stand, then reset the stop. Returns the reason for a refusal, or empty."""
    for _ in range(REST_BEATS):
        guided.beat((0.0,) * len(guided.settings.velocity_limit))
    return guided.reset()


def _slopes(stopped: Stopped, direction: Array) -> Array:
    """(4,) least change of the true margins along a direction, 1/rad or 1/m; 0 if the robot does not have the
    margin."""
    guided, _start, at = stopped
    start = np.array(guided.drives.now.position)
    way = np.array([start, *[start + step * direction for step in PROBES]])
    found = margins_along(guided.supervisor.robot, guided.settings, way, at)
    found = np.where(np.isfinite(found), found, 0.0)
    return np.asarray(((found[1:] - found[0]) / np.array(PROBES)[:, None]).min(axis=0))


def _kinds(guided: GuidedRobot) -> list[int]:
    """The margins that caused the stop in force."""
    return [index for index, kind in enumerate(MARGIN_CAUSES) if guided.now.causes & int(kind)]
