"""The motion of all measurements: pick and place, as the encoders of a driver report it."""

from __future__ import annotations

from typing import Any

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.sim.machine import Machine
from irsbot_supervisor.sim.simulation import build, simulation_from

SCENARIO = "pick_and_place"
RATE_HZ = 1000.0

_BEGIN_NS = 10**18
"""ns of both clocks at the first sample of `recorded`."""


def machine_of(robot: Robot, name: str) -> Machine:
    """A robot at the start of pick and place. Raises SimulationError if the scenario has no numbers for it."""
    shipped = shipped_values(robot)
    values: dict[str, Any] = {key: shipped[key] for key in ("velocity_limit", "deceleration_limit") if key in shipped}
    resolution = read_settings(name)[0].encoder_resolution
    simulation = simulation_from(
        {"robot": name, "scenario": SCENARIO, "encoder_resolution": resolution, **values}, robot
    )
    return build(simulation, robot)[0]


def recorded(name: str, number: int) -> tuple[Settings, Robot, list[JointSample]]:
    """Shipped settings, the robot, and its first samples of pick and place, 1 kHz, each with a small age on arrival."""
    settings, robot = read_settings(name)
    machine = machine_of(robot, name)
    samples = []
    for k in range(number):
        stamp_ns = _BEGIN_NS + round(k * NS_PER_S / RATE_HZ)
        arrival_ns = stamp_ns + 300_000  # ns of transport
        reading = machine.step(1.0 / RATE_HZ, 1.0)
        samples.append(JointSample(stamp_ns, arrival_ns, arrival_ns, settings.joint_names, *reading))
    return settings, robot, samples
