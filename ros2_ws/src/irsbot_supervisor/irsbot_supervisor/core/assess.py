"""From joint positions to the posture: pose and margins, and whether the branch is still known.

Encoders cannot see a change of assembly mode. After contact with a Type 2 locus, or after a jump that no motion
explains, the branch is unknown until an operator confirms it. Where labels do not hold along a branch, the label of
the settings tells the branch of the first posture, which is then followed from sample to sample.
"""

from __future__ import annotations

from math import inf, nan
from typing import TYPE_CHECKING, NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.records import Floats

if TYPE_CHECKING:
    from irsbot_supervisor.core.settings import Settings

CONTACT_TOL_M = 1e-6
"""m: a gap to Type 2 smaller than this is contact: play and elasticity of any machine are larger."""

SOLVED = Status.SOLVED
"""Looking up a member of an enum takes as long as a sine, and every sample asks three times."""

PROBE = 1e-4
"""rad or m: step of the differences that give the slope of a margin; margins are smooth far beyond it."""

Margins = tuple[float, float, float, float]
"""Type 1 (smallest over the legs), Type 2, constraint, limb (smallest): 0..1, infinite where there is none."""


class Assessment(NamedTuple):
    """What one posture says."""

    at: Posture
    margins: Margins
    branch_fault: str  # empty, or why the branch is not known


class Assessor:
    """Solves the direct kinematics in the branch that the settings name, and watches that branch."""

    def __init__(self, settings: Settings, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._working = settings.working_mode
        self._assembly = settings.assembly_mode
        self._lost = ""
        self._before: Posture | None = None  # where the branch was seen last, if labels alone do not tell it
        self._gaps: Floats = ()  # of the last sample
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """New tolerances; a lost branch stays lost."""
        lever = max(self._mechanism.length_m if joint.is_angle else 1.0 for joint in self._mechanism.joints)
        self._contact = CONTACT_TOL_M + lever * settings.encoder_offset + settings.slack_m

    def assess(self, joints: Floats, lost_track: str, proved: bool = False) -> Assessment:
        """The posture of joint positions. A posture that is not assembled has NaN margins. lost_track: why nobody
        knows the branch from now on, or empty. proved: the way from the last posture has met no Type 2 singularity."""
        self._lost = self._lost or lost_track
        if proved:
            self._gaps = ()
        return self._judged(joints, lasting=True)

    def lose(self, why: str) -> None:
        """Nobody knows the branch from now on."""
        self._lost = self._lost or why

    @property
    def lost(self) -> bool:
        """Whether nobody knows the branch."""
        return bool(self._lost)

    def confirmed(self, joints: Floats, seen: Posture | None = None) -> Assessment:
        """The posture as it will be judged if an operator confirms the branch: what can be seen counts still.
        seen: the posture in which the operator sees the robot; left out, as the label of the settings says."""
        return self._judged(joints, lasting=False, at=seen)

    def confirm(self, seen: Posture | None = None) -> None:
        """An operator confirms that the robot is in the posture that was seen, or in the branch of the settings."""
        if self._lost:
            self._lost, self._before = "", seen  # None: as the label of the settings says, wherever the robot is now

    def _judged(self, joints: Floats, lasting: bool, at: Posture | None = None) -> Assessment:
        at = at or self._posture(joints)
        fault = self._lost if lasting else ""
        if not (at.status == SOLVED and min(at.gaps) > self._contact) or (lasting and self._has_touched(at.gaps)):
            # Between assembled and not assembled lies contact: nobody passes from one to the other without it.
            fault = fault or f"the robot touched a Type 2 singularity (gap {min(at.gaps):.2e} m)"
            if lasting:
                self._lost = fault
        if at.status != SOLVED:
            return Assessment(at, (nan,) * 4, fault)
        if not fault and at.working_mode != self._working:
            fault = self._mode_fault(at)
        if lasting and not self._mechanism.labels_hold:
            self._before = at
        return Assessment(at, margins_of(at), fault)

    def _has_touched(self, gaps: Floats) -> bool:
        """Whether a gap may have been closed between two samples: it is no larger than half of what it changed by."""
        before, self._gaps = self._gaps, gaps
        contact = self._contact
        return any(not gap - 0.5 * abs(gap - last) > contact for gap, last in zip(gaps, before, strict=False))

    def _posture(self, joints: Floats) -> Posture:
        if self._before is None or self._lost:
            return self._mechanism.posture(joints, self._assembly)
        return self._mechanism.track(joints, self._before)

    def _mode_fault(self, at: Posture) -> str:
        for leg, (now, usual) in enumerate(zip(at.working_mode, self._working, strict=True), 1):
            if now == -usual:
                return f"leg {leg} is in working mode {now:+d}, configured {usual:+d}"
        return ""  # a leg within the dead band of its sign: the Type 1 margin speaks for it


def margins_of(at: Posture) -> Margins:
    """The four margins of a solved posture."""
    constraint, limb = at.constraint, at.limb
    return (
        min(map(abs, at.sines)),
        min(at.cos_pressure),
        constraint if constraint == constraint else inf,
        min(limb) if limb else inf,
    )


def slopes(mechanism: Mechanism, at: Posture, kind: int) -> Floats:
    """How a margin grows with each joint, 1/rad or 1/m; central differences, 0 taken for the margin of no posture."""

    def margin(joint: int, step: float) -> float:
        moved = tuple([q + step if j == joint else q for j, q in enumerate(at.joints)])
        near = mechanism.track(moved, at)
        return margins_of(near)[kind] if near.status == SOLVED else 0.0

    return tuple([(margin(j, PROBE) - margin(j, -PROBE)) / (2.0 * PROBE) for j in range(len(at.joints))])
