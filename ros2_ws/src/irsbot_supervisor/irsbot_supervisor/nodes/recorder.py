"""recorder_node: writes all data needed to judge a run again into a bag that survives the death of this process."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

from diagnostic_msgs.msg import DiagnosticArray
from irsbot_msgs.msg import GateStatus, SingularityState, Verdict
from irsbot_msgs.msg import RecorderHealth as RecorderHealthMsg
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String
from trajectory_msgs.msg import JointTrajectory
from visualization_msgs.msg import MarkerArray

from irsbot_msgs_py.cdr import decode_string
from irsbot_msgs_py.convert import health_msg
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.health import RecorderHealth, RecorderState
from irsbot_msgs_py.process.run import FAILED, run
from irsbot_msgs_py.process.usage import UsageError
from irsbot_supervisor.bag.bag_writer import BagWriter, claimed
from irsbot_supervisor.bag.blackbox import BlackBox, Kept, StopWatch
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.journal import Configuration, JournalError, read_entry
from irsbot_supervisor.bag.topics import installed_topic
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.nodes.declared import Limits, declare, descriptor
from irsbot_supervisor.nodes.endpoints import publisher
from irsbot_supervisor.nodes.polled_subscriptions import PolledSubscriptions, Source, Taken

MIB = 1024 * 1024
HEALTH_PERIOD_S = 1.0

# Parameter below `topics.`, its default, type, and whether it is offered transient local. A topic without default is
# recorded on request.
TOPICS: dict[str, tuple[str, Any, bool]] = {
    "joint_states": ("joint_states", JointState, False),
    "state": ("supervisor/state", SingularityState, False),
    "verdict": ("supervisor/verdict", Verdict, True),
    "journal": ("supervisor/journal", String, True),
    "joint_trajectory": ("joint_trajectory", JointTrajectory, False),
    "command_in": ("command_in", JointTrajectory, False),
    "command_out": ("command_out", JointTrajectory, False),
    "velocity_in": ("velocity_in", Float64MultiArray, False),
    "velocity_out": ("velocity_out", Float64MultiArray, False),
    "gate": ("supervisor/gate", GateStatus, True),
    "diagnostics": ("/diagnostics", DiagnosticArray, False),
    "markers": ("", MarkerArray, False),  # drawn for whoever listens: 0.1 MB/s and time of the supervisor
}
# Parameter, its default, description and range. All are read at the start alone.
PARAMETERS: dict[str, tuple[Any, str, Limits | None]] = {
    "output": ("", "new directory, or file with the suffix .mcap; empty: here, named after namespace and time", None),
    "numbered": (False, "if output exists, the bag goes to output_2, output_3 and so on, as if output is empty", None),
    "mode": ("all", "'all', or 'blackbox': only the time around a stop", None),
    "flush_s": (0.02, "messages are taken and written this often [s]", (0.001, 0.25)),
    "keep_s": (10.0, "how much before a stop is kept in mode blackbox [s]", (0.1, 3600.0)),
    "after_s": (5.0, "how much after a stop is kept in mode blackbox [s]", (0.0, 3600.0)),
    "keep_mib": (64, "memory for the messages before a stop [MiB]", (1, 4096)),
    "depth": (2000, "messages per topic that the middleware holds for us", (10, 100_000)),
    "reserve_mib": (64, "recording ends before less is free [MiB]", (0, 10**6)),
    "compression": ("", "of the chunks: '' or 'zstd'", None),
    **{
        f"topics.{name}": (default, f"topic to record{'' if default else '; empty: none'}", None)
        for name, (default, _kind, _latched) in TOPICS.items()
    },
}
VERDICT, JOURNAL = list(TOPICS).index("verdict"), list(TOPICS).index("journal")


class RecorderNode(Node):
    """Takes the arrived messages 50 times per second and hands them to the operating system at once."""

    def __init__(self) -> None:
        super().__init__("recorder")
        self.exit_code: int | None = None
        self.bystander = True
        given = {
            name: declare(self, name, default, descriptor(text, limits))
            for name, (default, text, limits) in PARAMETERS.items()
        }
        mode, self._reserve_bytes = given["mode"], MIB * given["reserve_mib"]
        if mode not in ("all", "blackbox"):
            raise UsageError(f"mode is 'all' or 'blackbox', not '{mode}'")
        keep_ns, after_ns = int(given["keep_s"] * 1e9), int(given["after_s"] * 1e9)
        self._box = BlackBox(keep_ns, after_ns, given["keep_mib"] * MIB) if mode == "blackbox" else None
        self._stops = StopWatch()
        sources = [
            Source(self.resolve_topic_name(given[f"topics.{name}"]), kind, latched)
            for name, (default, kind, latched) in TOPICS.items()
            if given[f"topics.{name}"] or default
        ]
        target = Path(given["output"] or self._dated())
        if lack := self._lack_of_space(target):
            raise UsageError(f"cannot record to '{target}': {lack}")
        if given["numbered"] or not given["output"]:
            target = claimed(target)
        self._tape = BagWriter(target, given["compression"])
        self._channels = [self._tape.channel(installed_topic(s.topic, _type(s.type), s.latched)) for s in sources]
        self._state, self._text, self._slowest_s = RecorderState.RECORDING, "", 0.0
        latest = QoSProfile(
            depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
        )
        self._health = publisher(self, RecorderHealthMsg, "~/health", latest)
        self._taps = PolledSubscriptions(self, sources, given["depth"])
        steady = Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self.create_timer(given["flush_s"], self._write, clock=steady)
        self.create_timer(HEALTH_PERIOD_S, self._report, clock=steady)
        self._report()
        self.get_logger().info(f"recording to {self._tape.file.path}")

    def _dated(self) -> str:
        place = self.get_namespace().strip("/").split("/")
        return "_".join(filter(None, ("irsbot", *place, time.strftime("%Y%m%d_%H%M%S"))))

    def close(self) -> None:
        """Write what has arrived until now and finish the bag."""
        if self._state == RecorderState.RECORDING:
            self._write()
        if self._state == RecorderState.RECORDING:
            self._finish(RecorderState.STOPPED, "")
        self._taps.close()

    def _write(self) -> None:
        """One turn: take, write, hand over; end before the disk is full."""
        if self._state != RecorderState.RECORDING:
            return
        begin = time.perf_counter()
        try:
            for message in self._taps.take():
                self._keep(message)
            self._tape.flush()
        except Exception as error:  # BagError, or an error of ours: either way nothing more can be promised
            self._finish(RecorderState.WRITE_ERROR, str(error) if isinstance(error, BagError) else repr(error))
            return
        self._slowest_s = max(self._slowest_s, time.perf_counter() - begin)
        if lack := self._lack_of_space(self._tape.file.path):
            self._finish(RecorderState.DISK_FULL, lack)

    def _keep(self, taken: Taken) -> None:
        received_ns, sent_ns, source, data = taken
        channel = self._channels[source]
        if source == JOURNAL:
            self._keep_configuration(taken)
        if self._box is None or source == JOURNAL:
            self._tape.write(channel, received_ns, sent_ns, data)
            return
        wanted = self._box.pass_on(Kept(received_ns, sent_ns, channel, data))
        if source == VERDICT and self._stops.is_new_stop(data):
            wanted = self._box.stop(received_ns) or wanted
        for kept in wanted:
            self._tape.write(kept.channel, kept.log_ns, kept.publish_ns, kept.data)

    def _keep_configuration(self, message: Taken) -> None:
        """The configuration also goes into the file as YAML, for readers that do not know the journal."""
        try:
            entry = read_entry(decode_string(message.data))
            if isinstance(entry, Configuration):
                values = {"settings": entry.values, "machine": entry.machine}
                self._tape.add_configuration(values, Settings(**entry.values).config_hash, message.received_ns)
        except (CdrError, JournalError, TypeError) as error:  # TypeError: settings of another version
            self.get_logger().warning(f"journal: {error}", throttle_duration_sec=1.0)

    def _lack_of_space(self, path: Path) -> str:
        """A sentence when less than the reserve is free, else nothing."""
        free = _free(path)
        if free >= self._reserve_bytes:
            return ""
        return f"{free // MIB} MiB free, less than the reserve of {self._reserve_bytes // MIB} MiB"

    def _finish(self, state: RecorderState, text: str) -> None:
        """Close the bag, report it, and exit with the matching code."""
        try:
            self._tape.close()
        except BagError as error:
            state, text = RecorderState.WRITE_ERROR, text or str(error)
        self._state, self._text = state, text
        self._report()
        if state != RecorderState.STOPPED:
            self.get_logger().fatal(f"recording ended: {text}")
            self.exit_code = FAILED

    def _report(self) -> None:
        file = self._tape.file
        overflowed = self._box.overflowed if self._box is not None else 0
        record = RecorderHealth(
            stamp_ns=self.get_clock().now().nanoseconds,
            state=self._state,
            file=str(file.path),
            messages_written=file.message_count,
            messages_dropped=self._taps.lost + overflowed,
            bytes_written=file.bytes_written,
            bytes_free=_free(file.path),
            write_time_max=self._slowest_s,
            text=self._text,
        )
        self._slowest_s = 0.0
        self._health.publish(health_msg(record))


def _type(kind: Any) -> str:
    return f"{kind.__module__.split('.')[0]}/msg/{kind.__name__}"


def _free(path: Path) -> int:
    """Free bytes on the file system of a path, whose last parts may not exist yet."""
    while not path.exists() and path != path.parent:
        path = path.parent
    status = os.statvfs(path)
    return status.f_bavail * status.f_frsize


def main() -> None:
    """Entry point of `ros2 run irsbot_supervisor recorder_node`."""
    sys.exit(run(RecorderNode, usage_errors=(BagError,)))


if __name__ == "__main__":
    main()
