"""From the results of the stages to the published record SingularityState."""

from __future__ import annotations

from math import acos, inf, nan
from typing import NamedTuple

from irsbot_kinematics import Mechanism, statics
from irsbot_kinematics.numerics.arithmetic import FLOATS
from irsbot_msgs_py.records import Floats, JointSample, Level, SingularityState, unknown_state
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.assessment import Assessment
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.margins import MARGIN_CAUSES, Margins
from irsbot_supervisor.core.reachable_box import position_error
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import limits_of


class Moment(NamedTuple):
    """The margins of a sample."""

    stamp_ns: int
    margins: Margins


class Reporter:
    """Fills in the published state of one robot."""

    def __init__(self, settings: Settings, mechanism: Mechanism, robot: str) -> None:
        self._mechanism = mechanism
        self._robot = robot
        self._stop = limits_of(settings, "stop")
        self._force = settings.load_force_n + settings.payload_kg * settings.gravity_m_s2
        self._moment = settings.load_moment_nm
        self._errors = (position_error(settings),) * len(mechanism.joints)
        self._slack_m = settings.slack_m
        n, m = len(mechanism.joints), len(mechanism.task)
        self._no_joints, self._no_pose = (nan,) * n, (nan,) * m
        self._sizes = m, mechanism.limb_count

    def rejected(self, sample: JointSample, sequence: int, cause: int) -> SingularityState:
        """The state of a rejected sample: UNKNOWN, all numbers NaN."""
        times = sample.stamp_ns, sample.received_ns, sample.seen_ns
        return unknown_state(times, self._robot, sequence, cause, (self._no_joints,) * 2, self._sizes)

    def unsolved(self, estimate: Estimate, sequence: int, cause: int) -> SingularityState:
        """The state of joint positions to which no pose belongs."""
        times = estimate.stamp_ns, estimate.received_ns, estimate.seen_ns
        joints = estimate.position, estimate.velocity
        return unknown_state(times, self._robot, sequence, cause, joints, self._sizes)

    def solved(
        self,
        estimate: Estimate,
        assessment: Assessment,
        certified: Margins,
        reaction: Floats,
        sequence: int,
        level: Level,
        causes: int,
        before: Moment | None,
    ) -> SingularityState:
        """The state of a solved posture. before: the margins of the solved posture before it."""
        at, now = assessment.at, assessment.margins
        stop = self._stop
        spare, kind = governing(certified, stop)
        rate = _shrinking(before, estimate.stamp_ns, now, kind)
        error = self._mechanism.certified_bounds(at, self._errors, self._slack_m)
        stamp_ns, received_ns, velocity = estimate.stamp_ns, estimate.received_ns, estimate.velocity
        drive = tuple([-(lever * rate) for lever, rate in zip(at.levers, velocity, strict=True)])
        type1 = tuple([abs(sine) for sine in at.normalised_levers])
        return SingularityState(
            stamp_ns=stamp_ns,
            robot=self._robot,
            sequence=sequence,
            received_ns=received_ns,
            seen_ns=estimate.seen_ns,
            level=level,
            causes=causes,
            joint_position=at.joints,
            joint_velocity=velocity,
            pose=at.pose,
            pose_rate=statics.twist(at.screws, drive) if at.det else self._no_pose,
            working_mode=at.working_mode,
            assembly_mode=at.assembly_mode,
            type1_margin=type1,
            type2_margin=now[1],
            constraint_margin=at.constraint,
            limb_margin=at.limb,
            type1_uncertainty=tuple([sine - least for sine, least in zip(type1, error.type1, strict=True)]),
            type2_uncertainty=now[1] - error.type2,
            constraint_uncertainty=at.constraint - error.constraint,
            clearance=self._mechanism.clearance(at),
            pressure_angle=tuple([acos(cosine) for cosine in at.cos_pressure]),
            reaction=reaction,
            reaction_max=statics.reaction_max(FLOATS, at.screws, self._force, self._moment, turns=bool(at.attachments)),
            stop_margin=certified[kind],
            stop_cause=MARGIN_CAUSES[kind],
            stop_limit=stop[kind],
            time_to_stop=_time_to_stop(spare, rate),
            approaching=rate > 0.0,
            closure_residual=at.residual,
            sample_age=(received_ns - stamp_ns) / NS_PER_S,
            compute_time=nan,  # the node measures it
        )


def governing(certified: Margins, stop: Margins) -> tuple[float, int]:
    """The margin that governs: smallest spare to its stop limit, and which of the margins it is."""
    type1, type2, constraint, limb = certified
    a, b, c, d = stop
    spare, kind = type1 - a, 0
    if type2 - b < spare:
        spare, kind = type2 - b, 1
    if constraint - c < spare:
        spare, kind = constraint - c, 2
    if limb - d < spare:
        spare, kind = limb - d, 3
    return spare, kind


def _shrinking(then: Moment | None, stamp_ns: int, now: Margins, kind: int) -> float:
    """Rate at which a margin decreases between two samples, 1/s."""
    if then is None or not stamp_ns > then.stamp_ns:
        return 0.0
    return (then.margins[kind] - now[kind]) * NS_PER_S / (stamp_ns - then.stamp_ns)


def _time_to_stop(spare: float, rate: float) -> float:
    """s until braking has to begin if the governing margin keeps decreasing at this rate: first order."""
    if not spare > 0.0:
        return 0.0
    return spare / rate if rate > 0.0 else inf
