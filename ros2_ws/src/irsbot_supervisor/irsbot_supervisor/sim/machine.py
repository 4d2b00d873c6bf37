"""The simulated robot's readings: encoders, and the efforts of the motors."""

from __future__ import annotations

import random
from math import isfinite, nan
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status, statics
from irsbot_kinematics.mechanism import Floats
from irsbot_supervisor.sim.errors import BadSetting
from irsbot_supervisor.sim.joints import Drives
from irsbot_supervisor.trajectory.joint_path import JointPoint

STANDARD_GRAVITY = 9.80665
"""m/s2, ISO 80000-3."""


class Payload:
    """A mass at the platform point of a massless mechanism; gravity acts along -z if the task has a z."""

    def __init__(self, mechanism: Mechanism, mass_kg: float, assembly: int) -> None:
        if not 0.0 <= mass_kg < float("inf"):
            raise BadSetting(f"platform mass must be finite and not negative, got {mass_kg!r} kg")
        self._mechanism = mechanism
        self._assembly = assembly
        self._before: Posture | None = None
        self._mass_kg = mass_kg
        self._weight = tuple(-mass_kg * STANDARD_GRAVITY if c.name == "z" else 0.0 for c in mechanism.task)
        self._inertia = tuple(0.0 if c.is_angle else mass_kg for c in mechanism.task)

    def efforts(self, joints: JointPoint) -> Floats:
        """Motor efforts, N m or N: tau = -B R with A^T R + w = 0, w = m (g - a). NaN if they are not determined."""
        if self._before is None:
            at = self._mechanism.posture(joints.position, self._assembly)
        else:
            at = self._mechanism.track(joints.position, self._before)
        self._before = at if at.status == Status.SOLVED else None
        if at.status != Status.SOLVED or at.det == 0.0:
            return (nan,) * len(joints.position)
        rates = statics.twist(at.screws, [-b * v for b, v in zip(at.levers, joints.velocity, strict=True)])
        bias = self._mechanism.bias(at, joints.velocity, rates)
        drive = [-b * a - c for b, a, c in zip(at.levers, joints.acceleration, bias, strict=True)]
        acceleration = statics.twist(at.screws, drive)
        wrench = [w - m * a for w, m, a in zip(self._weight, self._inertia, acceleration, strict=True)]
        efforts = statics.efforts(at.levers, statics.reactions(at.screws, wrench))
        return efforts if isfinite(sum(efforts)) else (nan,) * len(efforts)


class Encoder:
    """Reads positions with Gaussian noise, then in steps of its resolution. 0 means perfect."""

    def __init__(self, resolution: float = 0.0, noise: float = 0.0, seed: int = 0) -> None:
        """resolution, noise (one standard deviation): rad or m."""
        if not (0.0 <= resolution < float("inf") and 0.0 <= noise < float("inf")):
            raise BadSetting(f"resolution and noise must be finite and not negative, got {resolution!r}, {noise!r}")
        self._resolution, self._noise = resolution, noise
        self._random = random.Random(seed)

    def read(self, position: Floats) -> Floats:
        """Encoder readings of joint positions."""
        if self._noise > 0.0:
            position = tuple([self._random.gauss(value, self._noise) for value in position])
        if self._resolution > 0.0:
            position = tuple([round(value / self._resolution) * self._resolution for value in position])
        return position


class Reading(NamedTuple):
    """One cycle of a driver."""

    position: Floats
    velocity: Floats
    effort: Floats


class Machine:
    """Drives, encoders and payload of one robot."""

    def __init__(self, drives: Drives, encoder: Encoder, payload: Payload) -> None:
        self.drives, self._encoder, self._payload = drives, encoder, payload

    def step(self, seconds: float, allowed: float) -> Reading:
        """Advance by a period (see `Drives.step`) and read the robot."""
        joints = self.drives.step(seconds, allowed)
        return Reading(self._encoder.read(joints.position), joints.velocity, self._payload.efforts(joints))
