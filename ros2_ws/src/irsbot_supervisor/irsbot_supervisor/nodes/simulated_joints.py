"""simulated_joints_node: replaces the hardware. A shell around `sim.machine.Machine` and `sim.faults.FaultInjector`.

The robot moves in its own thread, paced by the steady clock without drift; callbacks only pass data to it.
"""

from __future__ import annotations

import sys
import time
from queue import SimpleQueue

from irsbot_msgs.msg import Verdict
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

from irsbot_kinematics import KinematicsError
from irsbot_msgs_py.cdr import decode_verdict, encode_joint_state
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.process.priority import LIMITS, MEANING, PARAMETER, PRIORITY
from irsbot_msgs_py.process.run import FAILED, run
from irsbot_msgs_py.records import JointSample, Level
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.nodes.commands import command_of
from irsbot_supervisor.nodes.declared import declare, descriptor
from irsbot_supervisor.nodes.endpoints import publisher, subscription
from irsbot_supervisor.nodes.pacing import Pacer, RosTime
from irsbot_supervisor.nodes.simulation_parameters import declare_simulation
from irsbot_supervisor.sim.errors import BadFault, SimulationError
from irsbot_supervisor.sim.faults import FaultInjector, parse_faults
from irsbot_supervisor.sim.simulation import build
from irsbot_supervisor.sim.stop_response import StopResponse
from irsbot_supervisor.trajectory.joint_path import BadTrajectory, Command

JOINT_STATES = QoSProfile(depth=1000, reliability=ReliabilityPolicy.RELIABLE)
LAST_VERDICT = QoSProfile(depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL)

TOO_LATE_NS = 50_000_000
"""ns: after a stall of the process, samples later than this are not sent any more; the robot has moved."""


LONELY_S = 5.0
"""s without a verdict after which this is logged; a supervisor takes two to start on a quiet machine."""

SETTLE_NS = 500_000_000
"""ns: least time from the creation of the publisher to its first sample, so that running nodes discover it first. For a
recorder that needs the first sample, set `listeners`."""

LISTENERS_NS = 10_000_000_000
"""ns from the creation of the publisher for which it waits for listeners."""


class SimulatedJointsNode(Node):
    """Moves as its scenario says while the verdict allows it, and publishes the readings of the encoders."""

    def __init__(self) -> None:
        super().__init__("simulated_joints")
        self.exit_code: int | None = None
        self.thread_priority = declare(self, PARAMETER, PRIORITY, descriptor(MEANING, LIMITS))
        self._simulation, self._robot = declare_simulation(self)
        self._machine, scenario = build(self._simulation, self._robot)
        self._stop_response = StopResponse(self._simulation.verdict_timeout_s, self._simulation.gated)
        text = "fault line, e.g. nan:count=10,at=2.0; see docs/how_to/simulation.md"
        line = declare(self, "fault", scenario.faults, descriptor(text, read_only=False))
        self._injector = self._new_injector(line)
        self._commands: SimpleQueue[Command] = SimpleQueue()
        self._rates: SimpleQueue[tuple[float, ...]] = SimpleQueue()
        self._outlets = [publisher(self, JointState, "joint_states", JOINT_STATES)]
        self._born_ns, self._begun = time.monotonic_ns(), False
        subscription(self, Verdict, "supervisor/verdict", self._on_verdict, LAST_VERDICT, raw=True)
        subscription(self, JointTrajectory, "joint_trajectory", self._on_trajectory, 10)
        subscription(self, Float64MultiArray, "joint_velocity", self._on_velocity, 10)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.add_post_set_parameters_callback(self._apply_parameters)
        self.get_logger().info(f"{self._robot.name}: {scenario.name}, {scenario.description}")
        self._heard, steady = False, Clock(clock_type=ClockType.STEADY_TIME)  # simulated time may stand still
        self._patience = self.create_timer(LONELY_S, self._tell_of_silence, clock=steady)
        self._ros_time = RosTime(self.get_clock())
        self._moves_ns = time.monotonic_ns() + round(self._simulation.start_delay_s * NS_PER_S)
        self._pacer = Pacer(self._simulation.rate_hz, self._cycle, self._fail)

    def close(self) -> None:
        """Called by the shell before the node is destroyed."""
        self._pacer.close()

    # --- the robot's thread ------------------------------------------------------------------------------------

    def _cycle(self, due_ns: int) -> None:
        while not self._commands.empty():
            self._follow(self._commands.get())
        while not self._rates.empty():
            self._jog(self._rates.get())
        allowed = self._allowed(due_ns)
        if self._simulation.gated and not allowed > 0.0:
            self._machine.drives.follow((), (), ())  # commands before a stop are dropped
        reading = self._machine.step(self._simulation.period_s, allowed)
        if not self._begins(due_ns) or time.monotonic_ns() - due_ns > TOO_LATE_NS:
            return
        stamp_ns = self._ros_time.of(due_ns)
        sample = JointSample(stamp_ns, stamp_ns, due_ns, self._simulation.joint_names, *reading)
        stream = self._injector.send(sample)
        self._open(1 + max((sent.publisher for sent in stream), default=0))
        for sent in stream:
            self._outlets[sent.publisher].publish(encode_joint_state(sent.sample))

    def _begins(self, due_ns: int) -> bool:
        """True if samples may be sent."""
        if not self._begun and due_ns >= self._born_ns + SETTLE_NS:
            heard, wanted = self._outlets[0].get_subscription_count(), self._simulation.listeners
            self._begun = heard >= wanted or due_ns >= self._born_ns + LISTENERS_NS
            if self._begun and heard < wanted:
                self.get_logger().warning(f"{heard} subscriptions of the joint states, {wanted} are expected")
        return self._begun

    def _open(self, outlets: int) -> None:
        """Create or destroy publishers until there are this many."""
        while len(self._outlets) < outlets:
            self._outlets.append(publisher(self, JointState, "joint_states", JOINT_STATES))
        while len(self._outlets) > outlets:
            self.destroy_publisher(self._outlets.pop())

    def _allowed(self, due_ns: int) -> float:
        if due_ns < self._moves_ns:
            return 0.0
        return self._stop_response.allowed(due_ns) if self._simulation.obey else 1.0

    def _fail(self, error: Exception) -> None:
        """End the process: a consumer sees the silence of a dead driver."""
        self.get_logger().fatal(f"{type(error).__name__}: {error}")
        self.exit_code = FAILED

    def _follow(self, command: Command) -> None:
        try:
            self._machine.drives.follow(*command)
        except BadTrajectory as error:
            self.get_logger().warning(f"command refused: {error}")

    def _jog(self, rates: tuple[float, ...]) -> None:
        try:
            self._machine.drives.jog(rates, self._simulation.command_timeout_s)
        except BadTrajectory as error:
            self.get_logger().warning(f"command refused: {error}", throttle_duration_sec=1.0)

    # --- callbacks ---------------------------------------------------------------------------------------------

    def _on_verdict(self, data: bytes) -> None:
        now_ns, self._heard = time.monotonic_ns(), True
        try:
            verdict = decode_verdict(data)
        except CdrError:
            self._stop_response.hear(Level.UNKNOWN, 0.0, now_ns)
        else:
            self._stop_response.hear(verdict.level, verdict.speed_scale, now_ns)

    def _tell_of_silence(self) -> None:
        """Log once that no verdict comes: a supervisor with another name publishes elsewhere."""
        self.destroy_timer(self._patience)
        if self._simulation.obey and not self._heard:
            topic = self.resolve_topic_name("supervisor/verdict")
            text = f"no verdict on {topic} in {LONELY_S:g} s, and without one the joints stand"
            self.get_logger().warning(f"{text}; for a supervisor of another name: -r supervisor/verdict:=NAME/verdict")

    def _on_trajectory(self, message: JointTrajectory) -> None:
        try:
            self._commands.put(command_of(message, self._simulation.joint_names))
        except BadTrajectory as error:
            self.get_logger().warning(f"command refused: {error}")

    def _on_velocity(self, message: Float64MultiArray) -> None:
        self._rates.put(tuple(message.data))

    def _check_parameters(self, parameters: list[Parameter]) -> SetParametersResult:
        try:
            for parameter in parameters:
                parse_faults(str(parameter.value) if parameter.name == "fault" else "")
        except BadFault as error:
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _apply_parameters(self, parameters: list[Parameter]) -> None:
        for parameter in parameters:
            if parameter.name == "fault":
                self._injector = self._new_injector(parameter.value)

    def _new_injector(self, line: str) -> FaultInjector:
        return FaultInjector(parse_faults(line), self._robot.mechanism, self._simulation.seed)


def main() -> None:
    """Entry point of `ros2 run irsbot_supervisor simulated_joints_node`."""
    sys.exit(run(SimulatedJointsNode, usage_errors=(SimulationError, BadTrajectory, KinematicsError)))


if __name__ == "__main__":
    main()
