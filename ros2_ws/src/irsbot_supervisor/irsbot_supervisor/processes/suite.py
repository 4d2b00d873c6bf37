"""Starts the nodes of the suite as processes on their own DDS domain, watches them, and always ends them."""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import json
import os
import random
import select
import signal
import socket
import subprocess
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

KINEMATICS = "irsbot_kinematics.nodes.kinematics"
SUPERVISOR = "irsbot_supervisor.nodes.supervisor"
JOINTS = "irsbot_supervisor.nodes.simulated_joints"
RECORDER = "irsbot_supervisor.nodes.recorder"
LIVE_PAGE = "irsbot_supervisor.live.server"
FOXGLOVE = "irsbot_supervisor.live.foxglove"
TOGETHER = "irsbot_supervisor.nodes.suite"

BYSTANDERS = ("recorder", "kinematics", "live_page", "foxglove")
"""Nodes that supervision does not need."""

GATED = {"joint_trajectory": "command_out", "joint_velocity": "velocity_out"}
"""Remaps of simulated joints that take their commands from the command gate."""

DOMAINS = range(1, 101)
"""DDS domains whose ports are free on an ordinary Linux machine; 0 is the common default."""

FIRST_PORT, PORTS_PER_DOMAIN = 7400, 250
"""UDP port of discovery in domain 0, and the distance to the next domain's (DDSI-RTPS 9.6.1)."""

PATIENCE_S = 5.0
"""s between asking a node to end and ending it by force, for a user who waits."""

_DIE_WITH_PARENT = 1
"""PR_SET_PDEATHSIG of prctl(2): no node outlives a command that was killed."""


class SuiteError(Exception):
    """A node did not start, or has ended by itself."""


class Node(NamedTuple):
    """One node to start. remaps: topic of the node -> topic it uses instead."""

    name: str
    module: str
    parameters: Mapping[str, Any]
    remaps: Mapping[str, str] = {}


class Suite:
    """Running nodes. Use as a context manager: it always ends them."""

    def __init__(
        self,
        logs: Path,
        domain: int,
        namespace: str = "",
        parameter_file: Path | None = None,
        *,
        patience_s: float = PATIENCE_S,
        environment: Mapping[str, str] = os.environ,
    ) -> None:
        """logs: folder for the output of the nodes, one file each. patience_s: s between asking a node to end and
        ending it by force. environment: variables of the nodes; those of the middleware are added."""
        self._logs, self._patience_s = logs, patience_s
        self._logs.mkdir(parents=True, exist_ok=True)
        self._arguments = ["-r", f"__ns:=/{namespace.strip('/')}"] if namespace.strip("/") else []
        if parameter_file is not None:
            self._arguments += ["--params-file", str(parameter_file)]
        self._environment = {
            **environment,
            "ROS_DOMAIN_ID": str(domain),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "PYTHONUNBUFFERED": "1",
        }
        self.processes: dict[str, subprocess.Popen[bytes]] = {}

    def start(self, node: Node) -> None:
        """Start a node; its output goes to its own log file."""
        given = [part for name, value in node.parameters.items() for part in ("-p", f"{name}:={json.dumps(value)}")]
        given += [part for topic, other in node.remaps.items() for part in ("-r", f"{topic}:={other}")]
        command = [sys.executable, "-m", node.module, "--ros-args", *self._arguments, *given]
        with (self._logs / f"{node.name}.log").open("wb") as log:
            self.processes[node.name] = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=log,
                stderr=subprocess.STDOUT,
                env=self._environment,
                start_new_session=True,  # Ctrl-C is ours: the nodes are asked to end in order
                preexec_fn=partial(end_with_parent, os.getpid()),
            )

    def end(self, name: str, how: signal.Signals = signal.SIGINT) -> int:
        """End one node and remove it from the suite; returns its exit code."""
        process = self.processes.pop(name)
        process.send_signal(how)
        try:
            return process.wait(self._patience_s)
        except subprocess.TimeoutExpired:
            process.kill()
            return process.wait()

    def check(self) -> None:
        """Raise SuiteError, with the last line of its log, if a node has ended."""
        for ended in self.ended().values():
            raise SuiteError(ended)

    def wait(self) -> None:
        """Wait until a node ends; returns at once if one has ended unnoticed. A signal interrupts it."""
        running = [os.pidfd_open(process.pid) for process in self.processes.values() if process.returncode is None]
        try:
            select.select(running, [], [])
        finally:
            for descriptor in running:
                os.close(descriptor)

    def ended(self) -> dict[str, str]:
        """The nodes that have ended by themselves, each with a sentence that has the last line of its log."""
        return {name: self._last_words(name, p) for name, p in self.processes.items() if p.poll() is not None}

    def _last_words(self, name: str, process: subprocess.Popen[bytes]) -> str:
        stated = (self._logs / f"{name}.log").read_text(errors="replace").strip().splitlines()
        return f"the node {name} ended with exit code {process.returncode}: {stated[-1] if stated else 'no output'}"

    def stop(self) -> dict[str, int]:
        """Ask every node to end, last started first, then kill the remaining ones. Returns the exit codes."""
        order = list(reversed(self.processes.items()))
        for _name, process in order:
            if process.poll() is None:
                process.send_signal(signal.SIGINT)
        deadline = time.monotonic() + self._patience_s
        for _name, process in order:
            try:
                process.wait(max(deadline - time.monotonic(), 0.0))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()
        return {name: process.returncode for name, process in order}

    def __enter__(self) -> Suite:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with _signals_held() as held:  # a node that is not waited for dies with this process, and its bag stays open
            self.stop()
        if kind is None:  # an error ends the command anyway
            for number in held:
                signal.raise_signal(number)


@contextlib.contextmanager
def _signals_held() -> Iterator[list[int]]:
    """Hold SIGINT and SIGTERM back, if they have handlers here. Yields the list of those that come."""
    held: list[int] = []
    main = threading.current_thread() is threading.main_thread()  # no other thread sees signals
    numbers = (signal.SIGINT, signal.SIGTERM) if main else ()
    handlers = {how: handler for how in numbers if callable(handler := signal.getsignal(how))}
    try:
        for how in handlers:
            signal.signal(how, lambda number, _frame: held.append(number))
        yield held
    finally:
        for how, handler in handlers.items():
            signal.signal(how, handler)


_claims: deque[socket.socket] = deque()
"""Claims of the domains chosen last."""

CLAIMS = 8
"""Number of claims: a claim lasts until the nodes bind their ports."""


def free_domain() -> int:
    """A DDS domain that no process on this machine uses or has just chosen. Raises SuiteError."""
    for domain in random.SystemRandom().sample(DOMAINS, len(DOMAINS)):  # seeded alike, two processes would race
        claim = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            try:
                claim.bind(f"\0irsbot-domain-{domain}")  # the kernel removes this name with the process
                probe.bind(("", FIRST_PORT + PORTS_PER_DOMAIN * domain))
            except OSError:
                claim.close()
                continue
        _claims.append(claim)
        if len(_claims) > CLAIMS:
            _claims.popleft().close()
        return domain
    raise SuiteError(f"every DDS domain from {DOMAINS[0]} to {DOMAINS[-1]} is in use on this machine")


@atexit.register
def _end_claims() -> None:
    while _claims:
        _claims.popleft().close()


def end_with_parent(parent: int) -> None:
    """For a process that was just started: it ends with the one that started it, whose number is given, or at once if
    that one is gone."""
    ctypes.CDLL(None, use_errno=True).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before it could be followed
        os._exit(1)
