"""All settings of one simulated robot in one frozen object, and the machine built from it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from math import isfinite
from typing import Any

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S
from irsbot_supervisor.sim.errors import BadSetting
from irsbot_supervisor.sim.joints import Drives
from irsbot_supervisor.sim.machine import Encoder, Machine, Payload
from irsbot_supervisor.sim.scenario_file import read_scenario
from irsbot_supervisor.sim.scenarios import Scenario, plan
from irsbot_supervisor.trajectory.joint_path import JointLimits

STANDING = "stand"
"""The scenario without motion."""


def _setting(default: Any, unit: str, text: str, limits: tuple[float, float] | None = None) -> Any:
    return field(default=default, metadata={"unit": unit, "text": text, "limits": limits})


@dataclass(frozen=True)
class Simulation:
    """Settings of the simulated joints. Field metadata: unit, text, limits.

    One value of a per-joint setting applies to all joints.
    """

    robot: str = _setting("irsbot2", "", "preset name or YAML file of the robot")
    scenario: str = _setting("pick_and_place", "", "name or YAML file of the scenario")
    joint_names: tuple[str, ...] = _setting((), "", "names in JointState, robot order; empty: the robot's own")
    velocity_limit: tuple[float, ...] = _setting((), "rad/s or m/s", "largest speed of each joint")
    acceleration_limit: tuple[float, ...] = _setting(
        (), "rad/s2 or m/s2", "of planned motion, each joint; empty: as braking"
    )
    deceleration_limit: tuple[float, ...] = _setting((), "rad/s2 or m/s2", "braking of each joint")
    speed: float = _setting(1.0, "1", "factor on all speeds of the scenario", (0.0, 1.0))
    cycle_s: float = _setting(0.0, "s", "time for which the cycle is repeated; 0: as in the scenario")
    start_delay_s: float = _setting(0.0, "s", "rest before the motion begins")
    listeners: int = _setting(0, "1", "number of subscriptions to wait for before the first sample", (0, 100))
    rate_hz: float = _setting(1000.0, "Hz", "samples per second", (1.0, 20000.0))
    latency_s: float = _setting(0.0, "s", "time from a verdict's arrival to its effect on the drives", (0.0, 10.0))
    obey: bool = _setting(True, "", "brake on STOP, UNKNOWN and silence; false: the supervisor is ignored")
    gated: bool = _setting(False, "", "commands come through the command gate, which also leads out of a STOP")
    command_timeout_s: float = _setting(0.1, "s", "time for which a commanded velocity is valid", (1e-3, 10.0))
    verdict_timeout_s: float = _setting(CONSUMER_TIMEOUT_S, "s", "silence of the supervisor that means stop")
    platform_mass_kg: float = _setting(1.0, "kg", "mass at the platform point, included in the efforts")
    encoder_resolution: float = _setting(0.0, "rad or m", "step of the measured positions; 0: none")
    encoder_noise: float = _setting(0.0, "rad or m", "standard deviation of the measured positions")
    seed: int = _setting(0, "", "seed of noise and faults")

    @property
    def period_s(self) -> float:
        return 1.0 / self.rate_hz


def simulation_from(values: Mapping[str, Any], robot: Robot) -> Simulation:
    """Settings completed for a robot and checked. Raises BadSetting."""
    known = {entry.name for entry in fields(Simulation)}
    if unknown := sorted(set(values) - known):
        raise BadSetting(f"no setting '{unknown[0]}'; known are {', '.join(sorted(known))}")
    joints = robot.mechanism.joints
    given = dict(values)
    given["joint_names"] = tuple(values.get("joint_names") or (joint.name for joint in joints))
    given["acceleration_limit"] = values.get("acceleration_limit") or values.get("deceleration_limit") or ()
    for name in ("velocity_limit", "acceleration_limit", "deceleration_limit"):
        each = tuple(float(value) for value in given.get(name) or ())
        given[name] = each * len(joints) if len(each) == 1 else each
        if len(given[name]) != len(joints):
            raise BadSetting(f"{name} has {len(each)} values, must have {len(joints)}, one per joint")
    simulation = Simulation(**given)
    names = simulation.joint_names
    if len(names) != len(joints) or len(set(names)) != len(names):
        raise BadSetting(f"joint_names {list(names)} must be {len(joints)} different names")
    for entry in fields(Simulation):
        value, limits = getattr(simulation, entry.name), entry.metadata["limits"]
        if limits and not limits[0] <= value <= limits[1]:
            raise BadSetting(f"{entry.name} is {value!r}, must be in {limits[0]:g}..{limits[1]:g}")
    if not (simulation.start_delay_s >= 0.0 and isfinite(simulation.start_delay_s)):
        raise BadSetting(f"start_delay_s must be finite and not negative, got {simulation.start_delay_s!r}")
    return simulation


def build(simulation: Simulation, robot: Robot) -> tuple[Machine, Scenario]:
    """The machine at the start of its scenario. Raises SimulationError."""
    mechanism = robot.mechanism
    scenario = read_scenario(simulation.scenario, robot)
    if simulation.gated and not scenario.stands:
        raise BadSetting(
            f"gated joints move by command alone: the scenario must be {STANDING!r} or one that only waits"
        )
    limits = JointLimits(simulation.velocity_limit, simulation.acceleration_limit, simulation.deceleration_limit)
    motion = plan(scenario, mechanism, limits, speed=simulation.speed, seconds=simulation.cycle_s or None)
    encoder = Encoder(simulation.encoder_resolution, simulation.encoder_noise, simulation.seed)
    payload = Payload(mechanism, simulation.platform_mass_kg, mechanism.usual_assembly_mode)
    return Machine(Drives(motion, limits, simulation.latency_s), encoder, payload), scenario
