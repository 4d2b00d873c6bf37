"""`demo`: a simulated robot, supervised over DDS by separate processes, and stopped in front of a singularity."""

from __future__ import annotations

import time
from collections.abc import Callable
from datetime import datetime
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.text import Text

from irsbot_msgs_py.records import Cause, Level, SingularityState, Verdict, cause_names
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.cli.common import Failed, out, refuse
from irsbot_supervisor.cli.run_folder import BAG, LISTENERS, LOGS, prepare
from irsbot_supervisor.configuration.loading import read_settings, robot_of, shipped_values
from irsbot_supervisor.processes.suite import (
    JOINTS,
    KINEMATICS,
    RECORDER,
    SUPERVISOR,
    Node,
    Suite,
    free_domain,
)
from irsbot_supervisor.replay.recording import read_recording
from irsbot_supervisor.replay.run_summary import Outcome, outcome
from irsbot_supervisor.sim.scenario_file import read_scenario, scenario_names
from irsbot_supervisor.sim.scenarios import Scenario
from irsbot_supervisor.sim.scenarios import plan as plan_motion
from irsbot_supervisor.sim.simulation import simulation_from
from irsbot_supervisor.trajectory.joint_path import JointLimits

STARTING_S = 30.0
"""s after which a supervisor without verdicts, or joints without samples, count as stuck; each takes two on a quiet
machine."""

START_DELAY_S = 1.0
"""s for which the robot stands at first, until all nodes have discovered each other."""

AFTERWARDS_S = 1.0
"""s of recording after a stop or the end of the work; braking takes a small part of it."""

RESET_S, EARLY = 0.25, "stopped before the robot moved, as happens on a busy machine"
"""s between two requests to reset such a stop, and what the operator says."""

GRACE_S = 8.0
"""s beyond the planned motion after which a run counts as stuck."""

ENDLESS_S = 6.0
"""s of a scenario without end."""


def demo(
    scenario: Annotated[str, typer.Option(help=f"{', '.join(scenario_names())}, or a YAML file")] = "demo",
    robot: Annotated[str | None, typer.Option(help="preset or YAML file; the scenario's own if left out")] = None,
    seconds: Annotated[float | None, typer.Option(help="time for which the cycle is repeated, s")] = None,
    folder: Annotated[Path | None, typer.Option("--out", help="folder for the bag; a new one under runs/")] = None,
) -> None:
    """Watch a simulated robot being supervised over DDS, stopped in front of a singularity, and recorded.

    Exit code 0 only if the supervisor stopped the robot in time (or, for work without a singularity, never stopped it).

    Example: irsbot demo --scenario type2.
    """
    if seconds is not None and not 0.0 < seconds < inf:
        refuse(f"--seconds must be a positive, finite number, got {seconds:g}")
    machine = robot_of(robot) if robot else None
    plan = read_scenario(scenario, machine)
    machine = machine or robot_of(plan.robot)
    robot_name = robot or plan.robot
    read_settings(robot_name)  # refused here, in one sentence, rather than by a node
    target = folder or Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-{plan.name}"
    values: dict[str, Any] = {"robot": robot_name, "scenario": scenario, "start_delay_s": START_DELAY_S}
    values["listeners"] = LISTENERS
    if seconds is not None:
        values["cycle_s"] = seconds
    limit_s = _limit(plan, _length(plan, values, robot_name))
    prepare(target)
    out.print(f"{plan.name} with {machine.name}: {plan.description}")
    timeline = _Timeline()
    bag = target / BAG
    domain = free_domain()
    interrupted = False
    try:
        with Suite(target / LOGS, domain) as suite:
            from irsbot_supervisor.processes.listener import Watch  # needs ROS, which the other commands do not

            suite.start(Node("recorder", RECORDER, {"output": str(bag)}))
            suite.start(Node("kinematics", KINEMATICS, {"robot": robot_name}))
            suite.start(Node("supervisor", SUPERVISOR, {"robot": robot_name}))
            with Watch(domain, timeline.hear, timeline.begin) as watch:
                _await(suite, watch, lambda: timeline.verdict is not None, "no verdict has come")
                suite.start(Node("simulated_joints", JOINTS, values))
                _await(suite, watch, lambda: timeline.began, "no joint state was judged")
                _begin(suite, watch, timeline, limit_s)
                if timeline.worked:
                    _follow(suite, watch, timeline, limit_s)
    except KeyboardInterrupt:
        interrupted = True
    if not bag.exists():
        raise Failed(f"{'interrupted' if interrupted else 'ended'} before anything was recorded")
    from irsbot_supervisor.plots.run import draw_run  # matplotlib takes a second to load

    try:
        recording = read_recording(bag)
    except BagError:
        if interrupted:
            raise Failed("interrupted before a joint state was recorded") from None
        raise
    found = outcome(recording, plan.expect)
    _print_outcome(found, plan)
    picture = target / "run.png"
    draw_run(recording, found, picture)
    out.print(f"bag: {bag}   picture: {picture}")
    out.print(f"judge it again with: ./irsbot replay {bag}")
    if interrupted:
        raise Failed("interrupted; the bag contains the recording until then")
    if found.fault:
        raise Failed(found.fault)


class _Timeline:
    """Prints every change of level or cause, with the margin and its limit.

    Times are those of the robot, as in pictures and outcomes: from the first judged sample to the newest good sample of
    a verdict.
    """

    def __init__(self) -> None:
        self._begin_ns = 0
        self.began = False
        self.verdict: Verdict | None = None
        self.worked = False
        self.stopped_at: float | None = None
        out.print("time of the newest good sample, since the first sample that was judged")
        out.print(f"{'time':>9}  {'level':8}finding")

    def begin(self, state: SingularityState) -> None:
        """Set the time of the first judged sample."""
        self._begin_ns = state.stamp_ns
        self.began = True

    def hear(self, verdict: Verdict) -> None:
        last, self.verdict = self.verdict, verdict
        self.worked = self.worked or verdict.level < Level.STOP
        if self.worked and verdict.latched and self.stopped_at is None:
            self.stopped_at = time.monotonic()
        if last is not None and (last.level, last.causes) == (verdict.level, verdict.causes):
            return
        style = {Level.OK: "green", Level.WARN: "yellow", Level.STOP: "bold red", Level.UNKNOWN: "magenta"}
        known = self._begin_ns and verdict.stamp_ns
        when = f"{(verdict.stamp_ns - self._begin_ns) / NS_PER_S:7.3f} s" if known else f"{'-':>9}"
        worst = sorted(verdict.findings, key=lambda finding: -finding.level)
        text = worst[0].text if worst else "all margins above their limits"
        causes = cause_names(verdict.causes & ~int(Cause.LATCHED))
        line = Text(f"{when}  ").append(f"{verdict.level.name:8}", style[verdict.level]).append(text)
        out.print(line.append(f"  [{causes}]" if causes else ""))


def _await(suite: Suite, watch: Any, heard: Callable[[], bool], silence: str) -> None:
    """Wait for an event: on a busy machine a node takes long to start. Raises Failed."""
    deadline = time.monotonic() + STARTING_S
    while not heard():
        if time.monotonic() > deadline:
            raise Failed(f"{silence} in {STARTING_S:g} s")
        watch.look(0.05)
        suite.check()


def _begin(suite: Suite, watch: Any, timeline: _Timeline, limit_s: float) -> None:
    """Wait until the robot may move, for a limited time. A stop before that is reset, as an operator would."""
    asked_s, deadline = -inf, time.monotonic() + limit_s
    while not timeline.worked and time.monotonic() < deadline:
        stop, due = timeline.verdict, time.monotonic() > asked_s + RESET_S
        if stop is not None and stop.latched and due and watch.reset(stop.event, EARLY):
            if asked_s == -inf:
                out.print(f"{EARLY}: resets are requested, until one is accepted")
            asked_s = time.monotonic()
        watch.look(0.05)
        suite.check()


def _follow(suite: Suite, watch: Any, timeline: _Timeline, limit_s: float) -> None:
    """Watch until the robot had time to stand after a stop, its work is done, or nothing more can come."""
    deadline = time.monotonic() + limit_s
    while time.monotonic() < deadline:
        watch.look(0.05)
        suite.check()
        if timeline.stopped_at is not None:
            deadline = min(deadline, timeline.stopped_at + AFTERWARDS_S)


def _limit(plan: Scenario, length_s: float) -> float:
    """Seconds after the first judged sample in which a run of this planned length ends, if it is not stuck."""
    return START_DELAY_S + length_s + (GRACE_S if plan.expect.stop else AFTERWARDS_S)


def _length(plan: Scenario, values: dict[str, Any], robot_name: str) -> float:
    """Planned seconds of a run."""
    machine = robot_of(robot_name)
    shipped = shipped_values(machine)
    limited = ("velocity_limit", "deceleration_limit")
    limits: dict[str, Any] = {name: shipped[name] for name in limited if name in shipped}
    simulation = simulation_from({**limits, **values}, machine)
    drives = JointLimits(simulation.velocity_limit, simulation.acceleration_limit, simulation.deceleration_limit)
    motion = plan_motion(plan, machine.mechanism, drives, seconds=simulation.cycle_s or None)
    return motion.duration_s if isfinite(motion.duration_s) else ENDLESS_S


def _print_outcome(found: Outcome, plan: Scenario) -> None:
    def after(later_ns: int | None, earlier_ns: int | None) -> str:
        if later_ns is None or earlier_ns is None:
            return "-"
        return f"{(later_ns - earlier_ns) / NS_PER_S * 1e3:.1f} ms"

    if plan.expect.stop:
        out.print(f"first sample judged STOP -> STOP received: {after(found.stopped_ns, found.judged_ns)}")
        out.print(f"first sample judged STOP -> standstill: {after(found.stood_ns, found.judged_ns)}")
    for nearest in found.nearest:
        out.print(f"smallest {nearest}")
