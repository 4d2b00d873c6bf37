"""`up`: the whole suite as separate processes, or as one, over DDS."""

from __future__ import annotations

import contextlib
from dataclasses import fields
from datetime import datetime
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer

from irsbot_msgs_py.process.priority import PARAMETER
from irsbot_msgs_py.process.usage import USAGE
from irsbot_supervisor.cli.common import Failed, err, existing, namespace_from, out, refuse
from irsbot_supervisor.cli.run_folder import BAG, LISTENERS, LOGS, prepare
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
from irsbot_supervisor.configuration.ros_parameter_file import read_parameters, require_agreement, robot_in
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.processes.suite import (
    BYSTANDERS,
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


def up(
    robot: Annotated[str | None, typer.Option(help="preset or YAML file; that of --params, or irsbot2")] = None,
    namespace: Annotated[str, typer.Option(help="namespace of all nodes and topics")] = "",
    params: Annotated[Path | None, typer.Option(help="ROS parameter file for all nodes")] = None,
    scenario: Annotated[
        str | None,
        typer.Option(help="scenario of the simulated joints; that of --params, pick_and_place, or stand with --gate"),
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
    if domain not in DDS_DOMAINS:
        refuse(f"the DDS domain must be in {DDS_DOMAINS[0]}..{DDS_DOMAINS[-1]}, got {domain}")
    place = namespace_from(namespace)
    above, told = f"/{place}" if place else "", dict[str, dict[str, Any]]()
    if params is not None:
        known = _parameters(above)
        told = read_parameters(existing(params, "the parameter file"), known)
        robot = robot or robot_in(params, known)
        scenario = scenario or told[f"{above}/simulated_joints"].get("scenario")
    robot = robot or Settings.robot
    machine = robot_of(robot)
    scenario = scenario or (STANDING if gate else Simulation.scenario)
    if not read_scenario(scenario, machine).stands and gate:
        refuse(f"with --gate the joints move by command alone: '{scenario}' moves them, give stand or none")
    if web:
        check_page(web_host, web_port)
    if foxglove:
        check_foxglove(foxglove_host, foxglove_port)
        if web and web_port == foxglove_port:
            refuse(f"the page and Foxglove need a port each, both are {web_port}: --foxglove-port gives another")
    target = folder or Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-up"
    bag = {"output": str(target / BAG)}
    drives = {"robot": robot, "scenario": scenario, "gated": gate, "listeners": LISTENERS}
    page, server = {"host": web_host, "port": web_port}, {"host": foxglove_host, "port": foxglove_port}
    nodes = [
        Node("recorder", RECORDER, bag),
        Node("kinematics", KINEMATICS, {"robot": robot}),
        Node("supervisor", SUPERVISOR, {"robot": robot}),
        Node("simulated_joints", JOINTS, drives, GATED if gate else {}),
    ]
    guests = [Node("live_page", LIVE_PAGE, page)] * web + [Node("foxglove", FOXGLOVE, server)] * foxglove
    if params is not None:
        require_agreement(params, {f"{above}/{node.name}": node.parameters for node in (*nodes, *guests)})
        names = {entry.name for entry in fields(Settings)} - {"robot"}
        of_supervisor = told[f"{above}/supervisor"]
        read_settings(robot, {name: value for name, value in of_supervisor.items() if name in names}, params)
    if together:
        remaps = {f"simulated_joints:{topic}": other for topic, other in GATED.items()} if gate else {}
        nodes = [Node("suite", TOGETHER, {**bag, **drives}, remaps)]
    prepare(target)
    with contextlib.suppress(KeyboardInterrupt), Suite(target / LOGS, domain, place, params) as suite:
        for node in (*nodes, *guests):
            suite.start(node)
        if web:
            out.print(f"live page: http://{web_host}:{web_port}")
        if foxglove:
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
