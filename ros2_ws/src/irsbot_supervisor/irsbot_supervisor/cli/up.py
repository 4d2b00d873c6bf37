"""`up`: the whole suite as separate processes, or as one, over DDS."""

from __future__ import annotations

import contextlib
from dataclasses import fields
from datetime import datetime
from pathlib import Path
from typing import Annotated, NoReturn

import typer

from irsbot_msgs_py.process.priority import PARAMETER
from irsbot_msgs_py.process.usage import USAGE
from irsbot_supervisor.cli.common import Failed, err, existing, namespace_from, out, refuse
from irsbot_supervisor.cli.run_folder import BAG, LISTENERS, LOGS, end_in_order_when_told_to, prepare
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
from irsbot_supervisor.configuration.loading import read_settings, robot_of
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
)
from irsbot_supervisor.sim.scenario_file import read_scenario
from irsbot_supervisor.sim.simulation import STANDING, Simulation

DDS_DOMAINS = range(233)
"""Numbers of the DDS domains that have ports (DDSI-RTPS 9.6.1)."""

BYSTANDERS = ("recorder", "kinematics", "live_page", "foxglove")
"""Nodes that supervision does not need."""


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
    place = namespace_from(namespace)
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
    prepare(target)
    end_in_order_when_told_to()
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


def _parameters(namespace: str) -> dict[str, list[str]]:
    """The nodes of a suite, by full name, and their parameters."""
    from irsbot_supervisor.nodes import recorder, supervisor  # need ROS, which the other commands do not

    found = {
        "recorder": recorder.PARAMETERS,
        "kinematics": ("robot",),
        "supervisor": (*supervisor.PARAMETERS, *(entry.name for entry in fields(Settings))),
        "live_page": ("host", "port"),
        "foxglove": ("host", "port"),
        "simulated_joints": ("fault", PARAMETER, *(entry.name for entry in fields(Simulation))),
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
