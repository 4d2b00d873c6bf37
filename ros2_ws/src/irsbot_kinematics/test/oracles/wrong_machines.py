"""Every robot as a platform on rods, so that it can be closed with legs that are wrong.

From the drawings: where the rods' near ends are, how they go with the joints, and margins from the rods' directions.
Only the rods' directions and the attachments of the first posture are taken from the library.
"""

from __future__ import annotations

from typing import NamedTuple

import irsbot2_3d as space
import numpy as np
from irsbot2_3d import Design
from numpy.typing import NDArray
from rod_machines import Machine

import irsbot_kinematics as irs

Array = NDArray[np.float64]


class Driven(NamedTuple):
    """What joints do to the rods, N joint positions."""

    shift: Array
    """(N, n, m) m, of the near ends"""
    longer: Array
    """(N, n) m"""
    actuated: Array
    """(N, n, m) where the motors take the near ends, unit vectors; for actuated lengths NaN"""
    q: Array
    """(N, n) joints"""


def rods(robot: irs.Robot, at: irs.Posture) -> Machine:
    """The machine of a posture as the library gives it."""
    size = len(at.pose) - bool(at.attachments)
    r = np.array([screw[:size] for screw in at.screws])
    g = robot.mechanism.geometry
    length = {
        "irsbot2": lambda: g.l2eq,
        "rrr3": lambda: 2.0 * g.l * np.cos(0.5 * np.array(at.joints)),
        "rpr3": lambda: np.array(at.joints),
        "rails2": lambda: np.array([at.joints[0], g.L2, g.L3]),
    }.get(robot.mechanism.kind, lambda: getattr(g, "l2", None) or np.array(g.L))()
    return Machine(r, np.array(at.attachments) if at.attachments else np.zeros((len(r), 2)), length * np.ones(len(r)))


def rails(robot: irs.Robot) -> Array:
    """(n, m) unit vectors along which the slides move; NaN for a strut."""
    g, kind = robot.mechanism.geometry, robot.mechanism.kind
    if kind not in ("rpr3", "rails3", "rails2"):
        return np.array([rail.direction for rail in robot.mechanism.rails])
    ways = np.array([getattr(g, f"u{i}", (np.nan, np.nan)) for i in (1, 2, 3)], dtype=float)
    return ways / np.linalg.norm(ways, axis=1, keepdims=True)


def driven(robot: irs.Robot, at: irs.Posture, ahead: Array) -> Driven:
    """ahead: (N, n) by which the joints are ahead of the posture's."""
    g, now = robot.mechanism.geometry, np.array(at.joints)
    q, still = now + ahead, np.zeros(ahead.shape)
    if robot.mechanism.kind == "rrr3":
        longer = 2.0 * g.l * (np.cos(0.5 * q) - np.cos(0.5 * now))
        return Driven(np.zeros((*ahead.shape, 2)), longer, np.full((*ahead.shape, 2), np.nan), q)
    if robot.mechanism.joints[0].unit == "m":
        ways = np.broadcast_to(rails(robot), (*ahead.shape, rails(robot).shape[1]))
        struts = np.isnan(ways[..., 0])
        return Driven(np.nan_to_num(ahead[..., None] * ways), np.where(struts, ahead, 0.0), ways, q)
    down = len(now) == 2  # cranks in the x-z plane turn about +y, which takes x to -z
    size = len(at.pose) - bool(at.attachments)

    def vectors(x: Array, y: Array) -> Array:
        return np.stack([x, -y if down else y, 0.0 * x][:size], axis=-1)

    swing = vectors(np.cos(q), np.sin(q)) - vectors(np.cos(now), np.sin(now))
    return Driven(g.l1 * swing, still, vectors(-np.sin(q), np.cos(q)), q)


def margins(robot: irs.Robot, how: Driven, r: Array) -> tuple[Array, Array | None, Array]:
    """Type 1 (N, n), constraint (N,) or None, limbs (N, limbs), of rods along r (N, n, m)."""
    kind, g = robot.mechanism.kind, robot.mechanism.geometry
    if kind == "rrr3":
        return np.abs(np.sin(0.5 * how.q)), None, np.abs(np.cos(0.5 * how.q))
    along = np.abs(np.sum(how.actuated * r, axis=2))
    if kind in ("rpr3", "rails3", "rails2"):
        struts = np.isnan(along[0])
        longest = np.array([joint.upper for joint in robot.mechanism.joints])
        return np.where(struts, 1.0, along), None, np.minimum((how.q / longest)[:, struts], 1.0)
    limb = along[:, : robot.mechanism.limb_count]
    if kind == "irsbot2":
        d = Design(g.l1, g.l2eq, g.b, g.p, g.a1, g.a2, g.beta, g.e)
        return along, space.kappa(d, *np.arctan2(-r[..., 1], r[..., 0]).T), limb
    if kind == "ruu4":
        level = r[..., :2] / np.linalg.norm(r[..., :2], axis=2, keepdims=True)
        return along, np.linalg.svd(level, compute_uv=False)[:, 1] / np.sqrt(2.0), limb
    return along, None, limb
