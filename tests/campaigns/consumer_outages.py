"""The supervisor is killed, frozen and started again while a consumer obeys it: does motion end, and begin only anew?

    nice ./irsbot python tests/campaigns/consumer_outages.py --times 100

The consumer is asked every millisecond, as a drive would. Printed: how long motion was still allowed after the
supervisor was gone, which is at most the consumer's timeout and what the machine takes to ask.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import rclpy
from irsbot_msgs.msg import Verdict
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile

from irsbot_msgs_py.cdr import decode_verdict
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.consumer import Consumer
from irsbot_supervisor.sim.simulation import STANDING
from irsbot_supervisor.suite import JOINTS, SUPERVISOR, Node, Suite, free_domain

PATIENCE_S = 60.0
STEP_S = 0.001
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Station:
    """Simulated joints, a supervisor, and a consumer that obeys it."""

    def __init__(self, suite: Suite, domain: int) -> None:
        self.suite, self.consumer = suite, Consumer()
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node("consumer", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.node.create_subscription(Verdict, "supervisor/verdict", self._hear, LATCHED, raw=True)
        suite.start(Node("simulated_joints", JOINTS, {"scenario": STANDING, "rate_hz": 200.0}))

    def _hear(self, data: bytes) -> None:
        verdict = decode_verdict(data)
        age_s = (time.time_ns() - verdict.stamp_ns) / NS_PER_S
        self.consumer.hear(verdict.level, verdict.sequence, verdict.speed_scale, time.monotonic_ns(), age_s)

    def until(self, happened: Callable[[float], Any], what: str) -> float:
        """Ask what is allowed until it is as wanted; returns how long that took, s."""
        begin = time.monotonic()
        while not happened(self.consumer.allowed(time.monotonic_ns())):
            if time.monotonic() - begin > PATIENCE_S:
                raise RuntimeError(f"in vain: {what}")
            self.executor.spin_once(timeout_sec=STEP_S)
        return time.monotonic() - begin

    def begin(self) -> None:
        self.suite.start(Node("supervisor", SUPERVISOR, {}))
        self.until(lambda share: share > 0.0, "motion")

    def outage(self, how: str) -> float:
        """One outage from motion to motion; returns how long motion was still allowed, s."""
        brakes, process = self.consumer.brakes, self.suite.processes["supervisor"]
        if how == "freeze":
            process.send_signal(signal.SIGSTOP)
        elif how == "kill":
            self.suite.end("supervisor", signal.SIGKILL)
        else:
            process.send_signal(signal.SIGTERM)
        took_s = self.until(lambda share: share == 0.0, "brakes")
        if how == "freeze":
            process.send_signal(signal.SIGCONT)
            self.until(lambda share: share > 0.0, "motion again")
        else:
            if how == "end":
                self.suite.end("supervisor")
            self.begin()
        if self.consumer.brakes == brakes:
            raise RuntimeError("motion began again without having ended")
        return took_s

    def close(self) -> None:
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def run(times: int, kinds: tuple[str, ...] = ("kill", "freeze", "end")) -> dict[str, list[float]]:
    """Outages of every kind, `times` each; how long motion was still allowed after each, s."""
    found: dict[str, list[float]] = {kind: [] for kind in kinds}
    domain = free_domain()
    with tempfile.TemporaryDirectory() as logs, Suite(Path(logs), domain) as suite:
        station = Station(suite, domain)
        try:
            station.begin()
            for number in range(times):
                for how, delays in found.items():
                    delays.append(station.outage(how))
                longest = ", ".join(f"{how} {max(delays) * 1e3:.0f} ms" for how, delays in found.items())
                print(f"{number + 1} of {times}, longest: {longest}", flush=True)
        finally:
            station.close()
    return found


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--times", type=int, default=100, help="outages of every kind")
    run(parser.parse_args().times)
    sys.exit()
