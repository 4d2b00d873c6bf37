"""The recorder as a process, over real DDS: what it keeps, what it says of itself, and how it ends."""

from __future__ import annotations

import os
import re
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("irsbot_msgs", reason="needs the built workspace")

import rclpy
from irsbot_msgs.msg import RecorderHealth as RecorderHealthMsg
from irsbot_msgs.msg import SingularityState as StateMessage
from irsbot_msgs.msg import Verdict as VerdictMsg
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from visualization_msgs.msg import Marker, MarkerArray

from irsbot_msgs_py.cdr import encode_joint_state, encode_verdict
from irsbot_msgs_py.convert import health_record
from irsbot_msgs_py.health import RecorderHealth, RecorderState
from irsbot_msgs_py.records import Cause, JointSample, Level, Verdict
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.journal import configured, write_entry
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.processes.listener import Watch
from irsbot_supervisor.processes.suite import RECORDER, SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.replay.recording import read_recording

pytestmark = pytest.mark.ros

PATIENCE_S = 120.0
MIB = 1024 * 1024
LATCHED = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Scene:
    """A recorder process, and what it records and says of itself."""

    def __init__(self, folder: Path) -> None:
        self.bag = folder / "bag"
        self.health: list[RecorderHealth] = []
        self._domain = free_domain()
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=self._domain)
        self.node = rclpy.create_node("scene", namespace="cell", context=self._context)
        self.samples = self.node.create_publisher(JointState, "joint_states", 1000)
        self.verdicts = self.node.create_publisher(VerdictMsg, "guard/verdict", LATCHED)
        self.journal = self.node.create_publisher(String, "supervisor/journal", LATCHED)
        self.node.create_subscription(
            RecorderHealthMsg, "recorder/health", lambda m: self.health.append(health_record(m)), LATCHED
        )
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._process: subprocess.Popen[str] | None = None

    def start(self, *parameters: str, largest_file: int = resource.RLIM_INFINITY) -> None:
        """Start the recorder in the namespace of the robot, its verdicts remapped."""
        given = [part for parameter in (f"output:={self.bag}", *parameters) for part in ("-p", parameter)]
        names = ["-r", "__ns:=/cell", "-r", "supervisor/verdict:=guard/verdict"]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "irsbot_supervisor.nodes.recorder", "--ros-args", *names, *given],
            env={**os.environ, "ROS_DOMAIN_ID": str(self._domain)},
            cwd=self.bag.parent,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file)),
        )

    def until(self, happened: Callable[[], Any]) -> None:
        """Serve callbacks until something has happened."""
        end = time.monotonic() + PATIENCE_S
        while not happened():
            assert time.monotonic() < end, f"nothing happened; the recorder last said {self.health[-1:]}"
            self._executor.spin_once(0.02)

    def until_listening(self) -> None:
        """Until the recorder is connected to everything that is published here."""
        self.until(lambda: all(p.get_subscription_count() for p in (self.samples, self.verdicts, self.journal)))

    def send(self, numbers: range, level: Level = Level.OK, event: int = 0) -> None:
        """One sample per number, and with every tenth a verdict."""
        for k in numbers:
            sample = JointSample(k, 0, 0, ("joint_1", "joint_2"), (0.001 * k, 0.0))
            self.samples.publish(encode_joint_state(sample))
            if k % 10 == 0:
                verdict = Verdict(k, level, Cause.NONE, False, event, (), "", k, "", 0, 1.0, ())
                self.verdicts.publish(encode_verdict(verdict))
            self._executor.spin_once(0.0005)

    def end(self, number: signal.Signals | None = None) -> tuple[int, str]:
        """Exit code and what was printed on stderr, after a signal or of its own accord."""
        assert self._process is not None
        if number is not None:
            self._process.send_signal(number)
        _, printed = self._process.communicate(timeout=PATIENCE_S)
        return self._process.returncode, printed

    def recorded(self, has_end: bool = True) -> list[int]:
        """The numbers of the recorded samples. has_end: False if the record that ends the messages may be missing."""
        with Bag(self.bag) as opened:
            numbers = [entry.record.stamp_ns for entry in opened.records("joint_states")]
            assert not (opened.loss if has_end else replace(opened.loss, cut=False))
        return numbers

    def close(self) -> None:
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)
        if self._process is not None:
            self._process.kill()
            self._process.communicate()


@pytest.fixture
def scene(tmp_path: Path) -> Iterator[Scene]:
    scene = Scene(tmp_path)
    yield scene
    scene.close()


@pytest.mark.parametrize(
    ("number", "parameters"),
    [
        (signal.SIGINT, []),
        (signal.SIGTERM, ["keep_s:=10"]),  # for ROS an integer
        (signal.SIGINT, ["use_sim_time:=true"]),  # with a clock that stands
    ],
)
def test_everything_that_was_sent_is_in_the_bag_when_a_signal_closes_it(
    scene: Scene, number: signal.Signals, parameters: list[str]
):
    settings, robot = read_settings("irsbot2", {})
    line = write_entry(configured(settings, robot, 1, 2))
    scene.journal.publish(String(data=line))  # before the recorder is there
    scene.start(*parameters)
    scene.until_listening()
    scene.send(range(500))
    scene.until(lambda: scene.health and scene.health[-1].messages_written >= 500 + 50 + 1)
    code, printed = scene.end(number)

    assert code == 0
    assert "Traceback" not in printed
    assert scene.recorded() == list(range(500))
    with Bag(scene.bag) as opened:
        topics = {entry.topic for entry in opened.records()}
        assert topics == {"/cell/joint_states", "/cell/guard/verdict", "/cell/supervisor/journal"}
        assert [entry.record for entry in opened.records("journal")] == [line]
        times = [entry.log_ns for entry in opened.records()]
        assert times == sorted(times)
        configuration = opened.configuration()
        assert configuration is not None
        assert configuration["settings"]["type2_stop"] == settings.type2_stop
        hashes = [stated.metadata["config_hash"] for reader in opened.readers for stated in reader.metadata]
        assert hashes == [settings.config_hash]
    with Reader(scene.bag) as reader:
        assert reader.message_count == 500 + 50 + 1
    last = scene.health[-1]
    assert (last.state, last.messages_dropped, last.file) == (RecorderState.RECORDING, 0, f"{scene.bag}/bag_0.mcap")
    assert last.bytes_free > 0


def test_samples_that_are_offered_best_effort_alone_are_recorded(scene: Scene):
    scene.node.destroy_publisher(scene.samples)
    scene.start()
    scene.until(lambda: scene.health)  # the recorder is there before the driver
    best_effort = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
    scene.samples = scene.node.create_publisher(JointState, "joint_states", best_effort)
    scene.until_listening()
    scene.send(range(300))
    scene.node.destroy_publisher(scene.samples)
    scene.samples = scene.node.create_publisher(JointState, "joint_states", 1000)  # it comes back, and is reliable
    scene.until_listening()
    scene.send(range(300, 600))
    scene.until(lambda: scene.health[-1].messages_written >= 400)  # best effort may lose some
    assert scene.end(signal.SIGINT)[0] == 0
    recorded = scene.recorded()
    assert min(recorded) < 300 <= max(recorded)
    assert recorded == sorted(set(recorded))


@pytest.mark.parametrize(
    ("parameter", "place"),
    [("numbered:=true", "bag_2/bag_2_0.mcap"), ("output:=''", r"(irsbot_cell_\d{8}_\d{6})/\1_0.mcap")],
)
def test_a_bag_that_may_choose_its_name_takes_that_of_no_other_one(scene: Scene, parameter: str, place: str):
    scene.bag.mkdir()
    (scene.bag / "of_an_earlier_run").touch()
    scene.start(parameter)
    scene.until(lambda: scene.health)
    file = Path(scene.bag.parent, scene.health[-1].file)
    assert re.fullmatch(place, str(file.relative_to(scene.bag.parent)))
    assert file.exists()
    assert scene.end(signal.SIGINT)[0] == 0


def test_the_black_box_keeps_only_the_time_around_a_stop(scene: Scene):
    scene.start("mode:=blackbox", "keep_s:=0.4", "after_s:=0.2")
    scene.until_listening()
    scene.send(range(1000), Level.OK)
    scene.send(range(1000, 1010), Level.STOP, event=1)
    scene.until(lambda: scene.health and scene.health[-1].messages_written > 0)
    stop = time.monotonic()
    scene.until(lambda: time.monotonic() > stop + 0.4)  # the box closes
    scene.send(range(2000, 2100), Level.STOP, event=1)
    assert scene.end(signal.SIGINT)[0] == 0
    numbers = scene.recorded()
    assert numbers[0] < 1000  # the first, if most of them arrived at once, on a busy machine: their times tell
    assert 1000 <= numbers[-1] < 1010  # 0.2 s may be over before the last one, on a busy machine
    assert numbers == list(range(numbers[0], numbers[-1] + 1))
    with Bag(scene.bag) as opened:
        times = {entry.record.stamp_ns: entry.log_ns for entry in opened.records("joint_states")}
    before_s = (times[1000] - times[numbers[0]]) * 1e-9
    assert 0.0 < before_s <= 0.4


def test_a_full_disk_ends_the_recording_properly_and_is_reported(scene: Scene):
    disk = os.statvfs(scene.bag.parent)
    free_mib = disk.f_bavail * disk.f_frsize // MIB
    margin_mib = min(2048, free_mib // 4)  # what other processes may write meanwhile
    reserve_mib = free_mib - margin_mib
    scene.start(f"reserve_mib:={reserve_mib}")
    scene.until_listening()
    scene.send(range(200))
    scene.until(lambda: scene.health and scene.health[-1].messages_written >= 220)
    with (scene.bag.parent / "others").open("wb") as others:
        os.posix_fallocate(others.fileno(), 0, 2 * margin_mib * MIB)
        scene.until(lambda: scene.health[-1].state == RecorderState.DISK_FULL)
        code, printed = scene.end()
    (scene.bag.parent / "others").unlink()
    assert code == 1
    assert "less than the reserve" in printed
    assert "less than the reserve" in scene.health[-1].text
    assert scene.recorded() == list(range(200))
    with Reader(scene.bag) as reader:
        assert reader.message_count == 220


def test_a_write_that_fails_ends_the_recording_with_a_readable_bag(scene: Scene):
    scene.start(largest_file=120_000)
    scene.until_listening()
    scene.send(range(1500))
    scene.until(lambda: scene.health[-1].state == RecorderState.WRITE_ERROR)
    code, printed = scene.end()
    assert code == 1
    assert "cannot write" in printed
    numbers = scene.recorded(has_end=False)  # the last chunk may leave no room for one more record
    assert 100 < len(numbers) < 1500
    assert numbers == list(range(len(numbers)))


def test_velocities_on_their_way_through_the_gate_are_recorded_and_passed_over_by_replays(scene: Scene):
    topics = ("velocity_in", "velocity_out")
    commands = [scene.node.create_publisher(Float64MultiArray, topic, 10) for topic in topics]
    scene.start()
    scene.until_listening()
    scene.until(lambda: all(publisher.get_subscription_count() for publisher in commands))
    scene.send(range(10))
    for factor, publisher in enumerate(commands, 1):
        publisher.publish(Float64MultiArray(data=[0.5 * factor, -0.25 * factor]))
    scene.until(lambda: scene.health and scene.health[-1].messages_written >= 13)
    assert scene.end(signal.SIGINT)[0] == 0
    with Reader(scene.bag) as reader:
        store = get_typestore(Stores.ROS2_JAZZY)
        wanted = [connection for connection in reader.connections if "velocity" in connection.topic]
        found = {
            connection.topic: store.deserialize_cdr(data, connection.msgtype).data.tolist()
            for connection, _time, data in reader.messages(connections=wanted)
        }
    assert found == {"/cell/velocity_in": [0.5, -0.25], "/cell/velocity_out": [1.0, -0.5]}
    assert scene.recorded() == list(range(10))
    assert read_recording(scene.bag).loss == ""


def test_a_second_publisher_for_a_moment_is_no_loss(scene: Scene):
    scene.start("flush_s:=0.25")  # it is gone by the time its messages are looked at
    scene.until_listening()
    scene.send(range(300))
    second = scene.node.create_publisher(JointState, "joint_states", 1000)
    scene.until(lambda: second.get_subscription_count())
    for k in range(200):
        second.publish(encode_joint_state(JointSample(10**6 + k, 0, 0, (), ())))
        scene.send(range(300 + k, 301 + k))
    scene.node.destroy_publisher(second)
    scene.send(range(500, 1000))
    scene.until(lambda: scene.health[-1].messages_written >= 1200 + 100)
    assert scene.health[-1].messages_dropped == 0
    assert scene.end(signal.SIGINT)[0] == 0


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        (["output:=/proc/bag", "reserve_mib:=0"], "cannot create '/proc/bag'"),  # where nobody may create anything
        (["output:=/proc/bag"], "less than the reserve of 64 MiB"),
        (["mode:=sometimes"], "'all' or 'blackbox', not 'sometimes'"),
        (["flush_s:=10.0"], "flush_s"),
    ],
)
def test_a_recorder_that_cannot_record_gives_its_reason_in_one_line(parameters: list[str], words: str):
    given = [part for parameter in parameters for part in ("-p", parameter)]
    done = subprocess.run(
        [sys.executable, "-m", "irsbot_supervisor.nodes.recorder", "--ros-args", *given],
        env={**os.environ, "ROS_DOMAIN_ID": str(free_domain())},
        capture_output=True,
        text=True,
        timeout=PATIENCE_S,
        check=False,
    )
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert words in done.stderr


def test_markers_are_recorded_on_request(scene: Scene) -> None:
    markers = scene.node.create_publisher(MarkerArray, "supervisor/markers", 1)
    scene.start("topics.markers:=supervisor/markers")
    scene.until_listening()
    scene.until(lambda: markers.get_subscription_count())
    markers.publish(MarkerArray(markers=[Marker(ns="here", text="drawn")]))
    scene.until(lambda: scene.health and scene.health[-1].messages_written > 0)
    assert scene.end(signal.SIGINT)[0] == 0
    with Bag(scene.bag) as opened:
        (kept,) = [message for message in opened.messages() if message.topic == "/cell/supervisor/markers"]
    assert deserialize_message(kept.data, MarkerArray).markers[0].text == "drawn"


def test_a_recorder_without_processor_time_for_600_states_misses_none(tmp_path: Path) -> None:
    """Half a second of a fast robot. Without the states a replay does not know when the samples were judged."""
    domain, heard = free_domain(), list[int]()

    def numbers() -> list[int]:
        return [state.sequence for state in read_recording(tmp_path / "bag").states]

    with Suite(tmp_path / "logs", domain) as suite, Watch(domain, lambda verdict: None) as watch:
        watch.node.create_subscription(StateMessage, "supervisor/state", lambda m: heard.append(m.sequence), 100)
        samples = watch.node.create_publisher(JointState, "joint_states", 100)

        def until(happened: Callable[[], bool]) -> None:
            deadline = time.monotonic() + PATIENCE_S
            while not happened():
                assert time.monotonic() < deadline, f"{len(heard)} states came"
                suite.check()
                watch.look(0.02)

        def judged(count: int) -> None:
            """So many samples, each sent when the one before has its state: however slow we are, no more states."""
            for _ in range(count):
                before, stamp_ns = len(heard), watch.node.get_clock().now().nanoseconds
                samples.publish(encode_joint_state(JointSample(stamp_ns, 0, 0, ("joint_1", "joint_2"), (0.5, 2.5))))
                until(lambda before=before: len(heard) > before)

        suite.start(Node("recorder", RECORDER, {"output": str(tmp_path / "bag")}))
        suite.start(Node("supervisor", SUPERVISOR, {"robot": "five_bar"}))
        until(lambda: samples.get_subscription_count() == 2)
        judged(300)
        until(lambda: numbers()[-1:] == heard[-1:])
        suite.processes["recorder"].send_signal(signal.SIGSTOP)
        judged(600)
        suite.processes["recorder"].send_signal(signal.SIGCONT)
        judged(300)
        until(lambda: numbers()[-1] == heard[-1])
    found = numbers()
    assert found[-1] > 900
    assert found == list(range(found[0], heard[-1] + 1))
