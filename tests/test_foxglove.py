"""`up --foxglove` beside a real run, seen by a client of the protocol: every channel carries what is on its topic."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")
pytest.importorskip("foxglove", reason="needs foxglove-sdk")

from command import IRSBOT, PATIENCE_S, irsbot
from ports import free_port
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from websockets.sync.client import ClientConnection, connect

from irsbot_msgs_py.cdr import decode_state, decode_verdict
from irsbot_supervisor.cli import web
from irsbot_supervisor.live.foxglove import SHOWN
from irsbot_supervisor.processes.polling import NEWEST, Polling, taken
from irsbot_supervisor.processes.suite import FOXGLOVE, SUPERVISOR, free_domain

pytestmark = [pytest.mark.ros, pytest.mark.slow]

PROTOCOL: Any = "foxglove.sdk.v1"
PATIENT: Any = {"max_size": None, "ping_interval": None, "close_timeout": 1.0}
"""A busy machine is no reason to give up, and what is still on its way when a test has seen enough does not count."""

MESSAGE = 1
"""First byte of a message of a channel; behind it the number of the subscription, the time in ns, and the data."""

TOPICS = {"/supervisor/state", "/supervisor/verdict", "/supervisor/markers", "/diagnostics"}
LAYOUT = Path(__file__).parents[1] / "ros2_ws/src/irsbot_supervisor/layouts/foxglove.json"


class Served:
    """A running suite."""

    def __init__(self, process: subprocess.Popen[str], domain: int, port: int) -> None:
        self.process, self.domain, self.port = process, domain, port

    def node(self, module: str) -> psutil.Process:
        (found,) = [p for p in psutil.Process(self.process.pid).children() if module in p.cmdline()]
        return found

    def client(self) -> ClientConnection:
        """A connection, as soon as there is a server."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                return connect(f"ws://localhost:{self.port}", subprotocols=[PROTOCOL], **PATIENT)
            except OSError:
                assert time.monotonic() < deadline
                assert self.process.poll() is None
                time.sleep(0.1)  # nothing says that a port will open


class Client:
    """What a server says to one connection."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection = connection
        self.info: dict[str, Any] = {}
        self.channels: dict[str, dict[str, Any]] = {}
        self.status: dict[str, str] = {}
        self.heard: dict[str, list[bytes]] = {}
        self.until(lambda: bool(self.info) and self.channels.keys() >= TOPICS)

    def subscribe(self, topics: set[str]) -> None:
        wanted = [{"id": one["id"], "channelId": one["id"]} for name, one in self.channels.items() if name in topics]
        self.connection.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    def until(self, happened: Callable[[], bool]) -> None:
        """Take in messages until something has happened."""
        deadline = time.monotonic() + PATIENCE_S
        while not happened():
            assert time.monotonic() < deadline
            self._hear(self.connection.recv(timeout=PATIENCE_S))

    def _hear(self, said: str | bytes) -> None:
        if isinstance(said, bytes):
            assert said[0] == MESSAGE
            number = int.from_bytes(said[1:5], "little")
            (topic,) = [name for name, one in self.channels.items() if one["id"] == number]
            self.heard.setdefault(topic, []).append(said[13:])
            return
        told = json.loads(said)
        if told["op"] == "serverInfo":
            self.info = told
        elif told["op"] == "advertise":
            self.channels |= {one["topic"]: one for one in told["channels"]}
        elif told["op"] == "status":
            self.status[told["id"]] = told["message"]
        elif told["op"] == "removeStatus":
            for number in told["statusIds"]:
                self.status.pop(number, None)


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    domain, port, folder = free_domain(), free_port(), tmp_path_factory.mktemp("up")
    options = ["--domain", str(domain), "--out", str(folder / "run"), "--foxglove", "--foxglove-port", str(port)]
    with subprocess.Popen([*IRSBOT, "up", *options], stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert process.stdout.readline() == f"Foxglove: ws://localhost:{port}\n"
            yield Served(process, domain, port)
        finally:
            process.send_signal(signal.SIGINT)
            try:
                process.communicate(timeout=PATIENCE_S)
            finally:
                process.kill()


@pytest.fixture
def client(served: Served) -> Iterator[Client]:
    with served.client() as connection:
        yield Client(connection)


def test_a_client_is_offered_what_the_layout_shows_and_nothing_to_change(client: Client) -> None:
    assert client.connection.subprotocol == PROTOCOL
    assert client.info["capabilities"] == []
    assert set(client.channels) == TOPICS == {f"/{topic.lstrip('/')}" for topic in SHOWN}
    assert {one["encoding"] for one in client.channels.values()} == {"cdr"}
    layout = LAYOUT.read_text()
    shown = {f"/{name}" for name in re.findall(r'"/((?:\w+/)*\w+)[."]', layout)}
    assert shown == TOPICS
    for topic, name in re.findall(r'"(/supervisor/\w+)\.(\w+)', layout):
        assert re.search(rf"^\w+(\[\])? {name}\b", client.channels[topic]["schema"], re.MULTILINE), (topic, name)


def test_every_channel_carries_the_messages_of_its_topic(client: Client, served: Served) -> None:
    on_topic: dict[str, set[bytes]] = {topic: set() for topic in TOPICS}
    with Polling(served.domain, "", "beside") as beside:
        sources = {topic: beside.listen(SHOWN[topic], topic, NEWEST) for topic in SHOWN}

        def hear_beside() -> None:
            for topic, source in sources.items():
                on_topic[f"/{topic.lstrip('/')}"] |= {data for data, _arrived in taken(source)}

        client.subscribe(TOPICS)
        for wanted in range(1, 100):
            client.until(lambda: all(len(client.heard.get(topic, ())) >= wanted for topic in TOPICS))  # noqa: B023
            hear_beside()
            if all(on_topic[topic].intersection(client.heard[topic]) for topic in TOPICS):
                break
    assert all(on_topic[topic].intersection(client.heard[topic]) for topic in TOPICS)
    for topic, one in client.channels.items():
        types = get_typestore(Stores.EMPTY)
        types.register(get_types_from_msg(one["schema"], one["schemaName"]))
        told: Any = types.deserialize_cdr(client.heard[topic][-1], one["schemaName"])
        if topic == "/supervisor/state":
            assert len(told.type1_margin) == 2
            margin = decode_state(client.heard[topic][-1]).type2_margin  # NaN after a pause of the machine
            assert told.type2_margin == pytest.approx(margin, nan_ok=True)
        elif topic == "/supervisor/verdict":
            assert told.text == decode_verdict(client.heard[topic][-1]).text
        elif topic == "/supervisor/markers":
            assert len(told.markers) > 1
        else:
            assert any("supervisor" in one.name for one in told.status)


def test_nothing_is_heard_for_nobody(served: Served) -> None:
    with Polling(served.domain, "", "counting") as counting:

        def listeners() -> int:
            infos = counting.node.get_subscriptions_info_by_topic("/supervisor/markers")
            return sum(info.node_name == "foxglove" for info in infos)

        with served.client() as connection:
            client = Client(connection)
            client.subscribe({"/supervisor/markers"})
            client.until(lambda: "/supervisor/markers" in client.heard)
            until(lambda: listeners() == 1)
        until(lambda: listeners() == 0)


def until(happened: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not happened():
        assert time.monotonic() < deadline
        time.sleep(0.05)  # the graph tells nobody when it changes


def test_a_silent_supervisor_is_a_status_and_takes_it_back(client: Client, served: Served) -> None:
    supervisor = served.node(SUPERVISOR)
    supervisor.suspend()
    try:
        client.until(lambda: "a consumer brakes" in client.status.get("silence", ""))
        with served.client() as late:
            newcomer = Client(late)
            newcomer.until(lambda: "silence" in newcomer.status)
    finally:
        supervisor.resume()
    client.until(lambda: "silence" not in client.status)


def test_a_port_that_is_taken_is_one_line(served: Served) -> None:
    said = irsbot("up", "--foxglove", "--foxglove-port", served.port, "--domain", served.domain)
    assert said.code == 2
    assert "--foxglove-port" in said.refusal
    command = [sys.executable, "-m", FOXGLOVE, "--ros-args", "-p", f"port:={served.port}"]
    environment = {**os.environ, "ROS_DOMAIN_ID": str(free_domain())}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 2
    assert "nothing served at localhost" in done.stderr
    assert "Traceback" not in done.stderr


def test_its_death_is_reported_and_supervision_goes_on(tmp_path: Path) -> None:
    command = [*IRSBOT, "up", "--domain", str(free_domain()), "--out", str(tmp_path / "run")]
    command += ["--foxglove", "--foxglove-port", str(free_port())]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            served = Served(process, 0, 0)
            assert process.stdout is not None
            assert process.stderr is not None
            assert "up on DDS domain" in [process.stdout.readline() for _ in range(2)][-1]
            served.node(FOXGLOVE).kill()
            line = process.stderr.readline()
            assert "the node foxglove ended with exit code -9" in line
            assert "the others go on" in line
            assert served.node(SUPERVISOR).is_running()
            process.send_signal(signal.SIGINT)
            _out, printed = process.communicate(timeout=PATIENCE_S)
            assert process.returncode == 1
            assert "without foxglove" in printed
        finally:
            process.kill()


def test_a_machine_without_the_sdk_gets_one_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(web, "find_spec", lambda module: None if module == "foxglove" else module)
    for command in (("up", "--foxglove"), ("monitor", "--foxglove")):
        said = irsbot(*command)
        assert said.code == 2
        assert said.refusal == "irsbot: --foxglove needs foxglove-sdk: 'pip install foxglove-sdk'"
