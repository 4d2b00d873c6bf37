"""`demo` and `up`: the whole suite as separate processes over DDS."""

from __future__ import annotations

import contextlib
import re
import signal
import time
from collections.abc import Callable
from dataclasses import fields
from datetime import datetime
from math import inf, isfinite
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from rich.text import Text

from irsbot_msgs_py.process.run import USAGE
from irsbot_msgs_py.records import Cause, Level, SingularityState, Verdict, cause_names
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.mcap_writer import BagError
from irsbot_supervisor.cli.common import Failed, err, existing, out, refuse
from irsbot_supervisor.cli.web import (
    FOXGLOVE_PORT,
    WEB_HOST,
    WEB_PORT,
    FoxgloveHost,
    FoxglovePort,
    WebHost,
    WebPort,
    check_foxglove,
    check_page,
)
from irsbot_supervisor.configuration.loading import read_settings, robot_of, shipped_values
from irsbot_supervisor.configuration.ros_parameter_file import read_parameters
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.processes.suite import (
    FOXGLOVE,
    GATED,
    JOINTS,
    KINEMATICS,
    LIVE_PAGE,
    RECORDER,
    SUPERVISOR,
    TOGETHER,
    Node,
    Suite,
    SuiteError,
    free_domain,
)
from irsbot_supervisor.replay.rejudge import read_recording
from irsbot_supervisor.replay.run_summary import Outcome, outcome
from irsbot_supervisor.sim.scenario_file import read_scenario, scenario_names
from irsbot_supervisor.sim.scenarios import Scenario
from irsbot_supervisor.sim.scenarios import plan as plan_motion
from irsbot_supervisor.sim.simulation import STANDING, Simulation, simulation_from
from irsbot_supervisor.trajectory.joint_path import JointLimits

LISTENERS = 2
"""Supervisor and recorder: the simulated joints wait for both, so that they receive the run from its first sample."""

STARTING_S = 30.0
"""s after which a supervisor without verdicts, or joints without samples, count as stuck; each takes two on a quiet
machine."""

START_DELAY_S = 1.0
"""s for which the robot stands at first, until all nodes have discovered each other."""

AFTERWARDS_S = 1.0
"""s of recording after a stop or the end of the work; braking takes a small part of it."""

GRACE_S = 8.0
"""s beyond the planned motion after which a run counts as stuck."""

LOGS, BAG = "logs", "bag"
"""Names of the parts of a run's folder."""

DDS_DOMAINS = range(233)
"""Numbers of the DDS domains that have ports (DDSI-RTPS 9.6.1)."""

NAMESPACE = r"[A-Za-z_]\w*(/[A-Za-z_]\w*)*"
"""Pattern of a ROS namespace without leading and trailing slash."""

BYSTANDERS = ("recorder", "kinematics", "live_page", "foxglove")
"""Nodes that supervision does not need."""

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
    limit_s = _length(plan, values, robot_name) + START_DELAY_S + GRACE_S
    _prepare(target)
    out.print(f"{plan.name} with {machine.name}: {plan.description}")
    _end_in_order_when_told_to()
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
                _follow(suite, watch, timeline, plan.expect.stop, limit_s)
    except KeyboardInterrupt:
        interrupted = True
    if not bag.exists():
        raise Failed("ended before anything was recorded")
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


def up(
    robot: Annotated[str, typer.Option(help="preset or YAML file")] = "irsbot2",
    namespace: Annotated[str, typer.Option(help="namespace of all nodes and topics")] = "",
    params: Annotated[Path | None, typer.Option(help="ROS parameter file for all nodes")] = None,
    scenario: Annotated[
        str | None, typer.Option(help="scenario of the simulated joints; pick_and_place, or stand with --gate")
    ] = None,
    folder: Annotated[Path | None, typer.Option("--out", help="folder for the bag; a new one under runs/")] = None,
    domain: Annotated[int, typer.Option(help="DDS domain", envvar="ROS_DOMAIN_ID")] = 0,
    gate: Annotated[
        bool, typer.Option("--gate", help="the joints take commands only through the command gate")
    ] = False,
    together: Annotated[bool, typer.Option("--single-process", help="all nodes in one process")] = False,
    web: Annotated[bool, typer.Option("--web", help="serve a live page for browsers, as monitor --web does")] = False,
    web_host: WebHost = WEB_HOST,
    web_port: WebPort = WEB_PORT,
    foxglove: Annotated[bool, typer.Option("--foxglove", help="serve Foxglove, as monitor --foxglove does")] = False,
    foxglove_host: FoxgloveHost = WEB_HOST,
    foxglove_port: FoxglovePort = FOXGLOVE_PORT,
) -> None:
    """Run the suite until Ctrl-C: simulated joints, kinematics, supervisor, recorder.

    If a recorder node, a kinematics node, the page or the server for Foxglove ends, the command reports it and
    supervision goes on; the exit code is then 1. If any other node ends, the suite ends.

    With --single-process the nodes are threads of one process, suite_node; a crash ends all of them.

    With --gate the robot stands and waits for commands on `command_in` (trajectories) or `velocity_in`.

    Example: irsbot up --robot irsbot2 --namespace left.
    """
    machine = robot_of(robot)
    scenario = scenario or (STANDING if gate else "pick_and_place")
    if not read_scenario(scenario, machine).stands and gate:
        refuse(f"with --gate the joints move by command alone: '{scenario}' moves them, give stand or none")
    if domain not in DDS_DOMAINS:
        refuse(f"the DDS domain must be in {DDS_DOMAINS[0]}..{DDS_DOMAINS[-1]}, got {domain}")
    place = namespace.strip("/")
    if place and not re.fullmatch(NAMESPACE, place):
        refuse(f"the namespace must be names of letters, digits and _ with / between them, got '{namespace}'")
    if params is not None:
        told = read_parameters(existing(params, "the parameter file"), _parameters(f"/{place}" if place else ""))
        names = {entry.name for entry in fields(Settings)} - {"robot"}
        (of_supervisor,) = [values for node, values in told.items() if node.endswith("/supervisor")]
        read_settings(robot, {name: value for name, value in of_supervisor.items() if name in names}, params)
    if web:
        check_page(web_host, web_port)
    if foxglove:
        check_foxglove(foxglove_host, foxglove_port)
        if web and web_port == foxglove_port:
            refuse(f"the page and Foxglove need a port each, both are {web_port}: --foxglove-port gives another")
    target = folder or Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-up"
    _prepare(target)
    _end_in_order_when_told_to()
    with Suite(target / LOGS, domain, place, params) as suite, contextlib.suppress(KeyboardInterrupt):
        drives = {"robot": robot, "scenario": scenario, "gated": gate, "listeners": LISTENERS}
        bag = {"output": str(target / BAG)}
        if together:
            remaps = {f"simulated_joints:{topic}": other for topic, other in GATED.items()} if gate else {}
            suite.start(Node("suite", TOGETHER, {**bag, **drives}, remaps))
        else:
            suite.start(Node("recorder", RECORDER, bag))
            suite.start(Node("kinematics", KINEMATICS, {"robot": robot}))
            suite.start(Node("supervisor", SUPERVISOR, {"robot": robot}))
            suite.start(Node("simulated_joints", JOINTS, drives, GATED if gate else {}))
        if web:
            suite.start(Node("live_page", LIVE_PAGE, {"host": web_host, "port": web_port}))
            out.print(f"live page: http://{web_host}:{web_port}")
        if foxglove:
            suite.start(Node("foxglove", FOXGLOVE, {"host": foxglove_host, "port": foxglove_port}))
            out.print(f"Foxglove: ws://{foxglove_host}:{foxglove_port}")
        out.print(f"up on DDS domain {domain}, logs and bag under {target}; Ctrl-C ends it")
        _watch_over(suite)
    if together and suite.processes["suite"].returncode:
        raise Failed(f"a node failed; its last lines are in {target / LOGS / 'suite.log'}")


def _prepare(target: Path) -> None:
    """Make the folders for logs and bag. Raises OSError if they cannot be made, BagError if there is a bag already."""
    (target / LOGS).mkdir(parents=True, exist_ok=True)
    if (target / BAG).exists():
        raise BagError(f"'{target / BAG}' exists already: a run needs a folder without a bag")


def _parameters(namespace: str) -> dict[str, list[str]]:
    """The nodes of a suite, by full name, and their parameters."""
    from irsbot_supervisor.nodes import recorder, supervisor  # need ROS, which the other commands do not

    found = {
        "recorder": recorder.PARAMETERS,
        "kinematics": ("robot",),
        "supervisor": (*supervisor.PARAMETERS, *(entry.name for entry in fields(Settings))),
        "live_page": ("host", "port"),
        "foxglove": ("host", "port"),
        "simulated_joints": ("fault", *(entry.name for entry in fields(Simulation))),
    }
    return {f"{namespace}/{node}": list(names) for node, names in found.items()}


def _watch_over(suite: Suite) -> NoReturn:
    """Watch the suite until Ctrl-C, or until a node that supervision needs ends or does not start.

    The end of another node is reported once; Ctrl-C then ends in Failed.
    """
    lost: list[str] = []
    try:
        while True:
            for name, text in suite.ended().items():
                if name not in BYSTANDERS or suite.processes[name].returncode == USAGE:
                    raise SuiteError(text)
                if name not in lost:
                    lost.append(name)
                    err.print(f"irsbot: {text}; the others go on")
            suite.wait()
    except KeyboardInterrupt:
        if lost:
            raise Failed(f"the last part of the run was without {' and '.join(lost)}") from None
        raise


def _end_in_order_when_told_to() -> None:
    """Treat SIGTERM, from a service manager or a container, as Ctrl-C: the recorder closes its bag."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)


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


def _follow(suite: Suite, watch: Any, timeline: _Timeline, stops: bool, limit_s: float) -> None:
    """Watch until the robot had time to stand after a stop, its work is done, or nothing more can come."""
    deadline = time.monotonic() + limit_s - (0.0 if stops else GRACE_S - AFTERWARDS_S)
    while time.monotonic() < deadline:
        watch.look(0.05)
        suite.check()
        if timeline.stopped_at is not None:
            deadline = min(deadline, timeline.stopped_at + AFTERWARDS_S)


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
        out.print(f"limit crossed -> STOP received: {after(found.stopped_ns, found.crossed_ns)}")
        out.print(f"limit crossed -> standstill: {after(found.stood_ns, found.crossed_ns)}")
    for nearest in found.nearest:
        out.print(f"smallest {nearest}")
