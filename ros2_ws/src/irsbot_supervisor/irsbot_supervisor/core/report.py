"""From the stages' results to the record that is published: the one bridge from mathematics to SingularityState."""

from __future__ import annotations

from math import acos, inf, nan
from operator import mul, neg, sub

from irsbot_kinematics import Mechanism, statics
from irsbot_kinematics.arithmetic import FLOATS
from irsbot_msgs_py.records import Floats, JointSample, Level, SingularityState, unknown_state
from irsbot_supervisor.core.assess import Assessment, Margins
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.intake import S
from irsbot_supervisor.core.policy import KINDS, OBSERVABLE
from irsbot_supervisor.core.reach import position_error
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import limits_of

_NOTHING = (nan, nan, nan, nan)


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
        self._last_margins: Margins | None = None
        self._last_stamp_ns = 0

    def reaction(self, estimate: Estimate, assessment: Assessment) -> Floats:
        """Leg forces, N, from measured efforts: R = -tau / B, NaN near Type 1 or without efforts (sheet section 10)."""
        if not estimate.effort:
            return self._no_joints
        at = assessment.at
        return tuple(map(_leg_force, estimate.effort, at.levers, at.sines))

    def rejected(self, sample: JointSample, sequence: int, cause: int) -> SingularityState:
        """The state of a sample that says nothing: UNKNOWN, all numbers NaN."""
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
        floor: Margins | None,
        reaction: Floats,
        sequence: int,
        level: Level,
        causes: int,
    ) -> SingularityState:
        """The state of a solved posture."""
        at, now = assessment.at, assessment.margins
        floor, stop = floor or _NOTHING, self._stop
        spares = tuple(map(sub, floor, stop))
        spare = min(spares)
        kind = spares.index(spare)  # the margin that governs; the first if nothing is known
        rate = self._shrinking(estimate.stamp_ns, now, kind)
        error = self._mechanism.guarantee(at, self._errors, self._slack_m)
        stamp_ns, received_ns, seen_ns, _, velocity, *_ = estimate
        drive = tuple(map(neg, map(mul, at.levers, velocity)))
        type1 = tuple(map(abs, at.sines))
        return SingularityState(
            stamp_ns,
            self._robot,
            sequence,
            received_ns,
            seen_ns,
            level,
            causes,
            at.joints,
            velocity,
            at.pose,
            statics.twist(at.screws, drive) if at.det else self._no_pose,
            at.working_mode,
            at.assembly_mode,
            type1,
            now[1],
            at.constraint,
            at.limb,
            tuple(map(sub, type1, error.type1)),
            now[1] - error.type2,
            at.constraint - error.constraint,
            self._mechanism.clearance(at),
            tuple(map(acos, at.cos_pressure)),
            reaction,
            statics.reaction_max(FLOATS, at.screws, self._force, self._moment, turns=bool(at.arms)),
            floor[kind],
            KINDS[kind],
            stop[kind],
            _time_to_stop(spare, rate),
            rate > 0.0,
            at.residual,
            (received_ns - stamp_ns) / S,
        )

    def _shrinking(self, stamp_ns: int, now: Margins, kind: int) -> float:
        """How fast the governing margin shrinks, 1/s, between this sample and the one before."""
        last, last_ns = self._last_margins, self._last_stamp_ns
        self._last_margins, self._last_stamp_ns = now, stamp_ns
        if last is None or not stamp_ns > last_ns:
            return 0.0
        return (last[kind] - now[kind]) * S / (stamp_ns - last_ns)


def _leg_force(effort: float, lever: float, sine: float) -> float:
    return -effort / lever if abs(sine) >= OBSERVABLE else nan


def _time_to_stop(spare: float, rate: float) -> float:
    """s until braking has to begin if the governing margin goes on shrinking at this rate: first order."""
    if not spare > 0.0:
        return 0.0 if spare == spare else nan
    return spare / rate if rate > 0.0 else inf
