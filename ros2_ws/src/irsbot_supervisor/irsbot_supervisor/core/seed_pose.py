"""The seed pose: an operator sees the platform and states its pose, which determines the branch; encoders do not."""

from __future__ import annotations

from math import remainder

import numpy as np

from irsbot_kinematics import Mechanism, Posture
from irsbot_kinematics.branches import nearest_solutions, tells_apart
from irsbot_kinematics.numerics.tolerances import FARTHEST, SAME_POSE_TOL
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.assessment import SOLVED


def seen_posture(
    mechanism: Mechanism, joints: Floats, seed_pose: Floats, assembly_mode: int, followed: Floats | None
) -> tuple[Posture | None, str]:
    """The posture that an operator sees, if it says more than the settings, and the reason to refuse it.

    joints: measured positions, rad or m. seed_pose: pose of the platform, task coordinates. assembly_mode: of the
    settings; the posture must have it if labels are invariant. followed: the pose on the followed branch; the posture
    must be on it if labels are not invariant; None if the branch is lost. Returns the posture, or None if the settings
    or the followed branch determine it already, and a text that is empty if it is accepted.
    """
    if len(seed_pose) != len(mechanism.task) or not all(abs(value) <= FARTHEST for value in seed_pose):
        return None, f"the seed pose must be {len(mechanism.task)} finite numbers, at most {FARTHEST:g}"
    poses, status, labels, _gaps = nearest_solutions(mechanism, np.array([joints]), np.array(seed_pose))
    if status[0] != SOLVED:
        return None, "the joints determine no pose to compare the seed pose with"
    if not tells_apart(mechanism, joints, seed_pose):
        return None, "the seed pose is too far from every pose of these joints to select one"
    label = int(labels[0])
    if mechanism.label_is_invariant:
        if label == assembly_mode:
            return None, ""
        return None, f"the seed pose is nearest to assembly mode {label:+d}, the settings say {assembly_mode:+d}"
    if followed is None:
        return mechanism.posture(joints, label), ""
    turns = [axis.turn for axis in mechanism.task]
    away = [abs(remainder(a - b, turn)) for a, b, turn in zip(followed, poses[0].tolist(), turns, strict=True)]
    return None, "" if all(way <= SAME_POSE_TOL for way in away) else "the seed pose is nearest to another branch"
