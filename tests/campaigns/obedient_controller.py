"""A velocity controller with the consumer's half, for consumer_outages.py: a process between command gate and drives.

Like forward_command_controller it keeps the last command for ever, unless the consumer's half says that it is void. It
writes one line whenever what the drives are told changes: steady clock in ns, rate of the first joint, the longest time
between two of its cycles since the last line, when it heard a verdict last.
"""

from __future__ import annotations

import ctypes
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from irsbot_msgs.msg import Verdict
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import Float64MultiArray

from irsbot_msgs_py.cdr import decode_verdict
from irsbot_msgs_py.process.run import run
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.consumer import TIMEOUT_S, Consumer, LastCommand

CYCLE_S = 0.005
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
HEADER = Path(__file__).parents[2] / "docs" / "examples" / "cpp" / "consumer.hpp"

SHIM = """
#include "consumer.hpp"
static irsbot::Consumer consumer(%r, true);
extern "C" {
void hear(int level, unsigned long long sequence, double scale, long long now, double age) {
  consumer.hear(level, sequence, scale, now, age);
}
double allowed(long long now) { return consumer.allowed(now); }
unsigned long long brakes() { return consumer.brakes(); }
}
"""


class HeaderConsumer:
    """The consumer's half in C++, compiled from the header of the examples."""

    def __init__(self) -> None:
        with tempfile.TemporaryDirectory() as folder:
            source, library = Path(folder) / "shim.cpp", Path(folder) / "shim.so"
            source.write_text(SHIM % TIMEOUT_S)
            options = ["-std=c++17", "-shared", "-fPIC", f"-I{HEADER.parent}"]
            subprocess.run(["c++", *options, str(source), "-o", str(library)], check=True, timeout=60)
            self._shim = ctypes.CDLL(str(library))
        self._shim.allowed.restype = ctypes.c_double
        self._shim.brakes.restype = ctypes.c_ulonglong

    def hear(self, level: int, sequence: int, speed_scale: float, now_ns: int, age_s: float) -> None:
        numbers = ctypes.c_double(speed_scale), ctypes.c_longlong(now_ns), ctypes.c_double(age_s)
        self._shim.hear(ctypes.c_int(level), ctypes.c_ulonglong(sequence), *numbers)

    def allowed(self, now_ns: int) -> float:
        return float(self._shim.allowed(ctypes.c_longlong(now_ns)))

    @property
    def brakes(self) -> int:
        return int(self._shim.brakes())


class Controller(Node):
    """`velocity_out` of the gate in, `joint_velocity` of the drives out."""

    def __init__(self) -> None:
        super().__init__("controller")
        self._log = os.open(self.declare_parameter("log", "").value, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        header = self.declare_parameter("header", False).value
        self._consumer: Any = HeaderConsumer() if header else Consumer(gated=True)
        self._last: LastCommand[list[float]] = LastCommand(self._consumer)
        self._joints = 0
        self._told: list[float] = []
        self._heard_ns = self._cycle_ns = time.monotonic_ns()
        self._longest_ns = 0
        self._drives = self.create_publisher(Float64MultiArray, "joint_velocity", 10)
        self.create_subscription(Verdict, "supervisor/verdict", self._hear, LATCHED, raw=True)
        self.create_subscription(Float64MultiArray, "velocity_out", self._take, 10)
        self.create_timer(CYCLE_S, self._cycle)

    def _hear(self, data: bytes) -> None:
        verdict = decode_verdict(data)
        self._heard_ns = time.monotonic_ns()
        age_s = (time.time_ns() - verdict.stamp_ns) / NS_PER_S
        self._consumer.hear(int(verdict.level), verdict.sequence, verdict.speed_scale, self._heard_ns, age_s)

    def _take(self, message: Float64MultiArray) -> None:
        self._joints = len(message.data)
        self._last.take(list(message.data), time.monotonic_ns())

    def _cycle(self) -> None:
        now_ns = time.monotonic_ns()
        self._longest_ns, self._cycle_ns = max(self._longest_ns, now_ns - self._cycle_ns), now_ns
        rates = self._last.now(now_ns) or [0.0] * self._joints
        if rates:
            self._drives.publish(Float64MultiArray(data=rates))
        if rates != self._told:
            line = f"{now_ns} {rates[0] if rates else 0.0!r} {self._longest_ns} {self._heard_ns}\n"
            os.write(self._log, line.encode())
            self._told, self._longest_ns = rates, 0


if __name__ == "__main__":
    sys.exit(run(Controller))
