"""From joint positions to the posture: pose, margins, and whether the branch is still known.

Encoders do not show a change of assembly mode. After contact with a Type 2 locus, or after a jump that no motion
explains, the branch is unknown until an operator confirms it. Where labels are not invariant along a branch, the label
of the settings selects the branch of the first posture; then the branch is followed from sample to sample.
"""

from __future__ import annotations

from math import nan
from typing import NamedTuple

from irsbot_kinematics import Mechanism, Posture, Status
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.margins import Margins, margins_of
from irsbot_supervisor.core.settings import Settings

CONTACT_TOL_M = 1e-6
"""m: an assembly clearance to Type 2 below this counts as contact: play and elasticity of any machine are larger."""

SOLVED = Status.SOLVED
"""Local copy: looking up a member of an enum takes as long as a sine, and every sample needs it three times."""


class Assessment(NamedTuple):
    """Posture, margins and branch of one sample."""

    at: Posture
    margins: Margins
    branch_fault: str  # empty, or why the branch is not known


class Assessor:
    """Solves the direct kinematics in the configured branch, and detects the loss of that branch."""

    def __init__(self, settings: Settings, mechanism: Mechanism) -> None:
        self._mechanism = mechanism
        self._working = settings.working_mode
        self._assembly = settings.assembly_mode
        self._lost = ""
        self._before: Posture | None = None  # where the branch was seen last, if labels alone do not tell it
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """New tolerances; a lost branch stays lost."""
        lever = max(self._mechanism.length_m if joint.is_angle else 1.0 for joint in self._mechanism.joints)
        self.contact_m = CONTACT_TOL_M + lever * settings.encoder_offset + settings.slack_m
        """m: an assembly clearance below this counts as contact."""

    def assess(self, joints: Floats, lost_track: str) -> Assessment:
        """The posture of joint positions. A posture that is not assembled has NaN margins. lost_track: why the branch
        is unknown from now on, or empty."""
        self._lost = self._lost or lost_track
        return self._judged(joints, lasting=True)

    @property
    def steady(self) -> bool:
        """True if the branch is known by its label, so that a posture without fault leaves nothing to remember."""
        return not self._lost and self._before is None

    def passed(self, joints: Floats) -> Posture:
        """The posture of joint positions that are known to have no fault; the assessor is `steady`."""
        return self._mechanism.posture(joints, self._assembly)

    def lose(self, why: str) -> None:
        """Mark the branch as lost."""
        self._lost = self._lost or why

    @property
    def lost(self) -> bool:
        """True if the branch is not known."""
        return bool(self._lost)

    def confirmed(self, joints: Floats, seen: Posture | None = None) -> Assessment:
        """The posture after an operator has confirmed the branch; visible faults still count. seen: the posture that
        the operator sees; None: the label of the settings."""
        return self._judged(joints, lasting=False, at=seen)

    def confirm(self, seen: Posture | None = None) -> None:
        """Take in that an operator confirms the posture that was seen, or the branch of the settings."""
        if self._lost:
            self._lost, self._before = "", seen  # None: as the label of the settings says, wherever the robot is now

    def _judged(self, joints: Floats, lasting: bool, at: Posture | None = None) -> Assessment:
        at = at or self._posture(joints)
        fault = self._lost if lasting else ""
        if not (at.status == SOLVED and min(at.gaps) > self.contact_m):
            # Contact lies between assembled and not assembled: every transition passes it.
            fault = fault or f"the robot touched a Type 2 singularity (assembly clearance {min(at.gaps):.2e} m)"
            if lasting:
                self._lost = fault
        if at.status != SOLVED:
            return Assessment(at, (nan,) * 4, fault)
        if not fault and at.working_mode != self._working:
            fault = self._mode_fault(at)
        if lasting and not self._mechanism.label_is_invariant:
            self._before = at
        return Assessment(at, margins_of(at), fault)

    def _posture(self, joints: Floats) -> Posture:
        if self._before is None or self._lost:
            return self._mechanism.posture(joints, self._assembly)
        return self._mechanism.track(joints, self._before)

    def _mode_fault(self, at: Posture) -> str:
        for leg, (now, usual) in enumerate(zip(at.working_mode, self._working, strict=True), 1):
            if now == -usual:
                return f"leg {leg} is in working mode {now:+d}, configured {usual:+d}"
        return ""  # a leg within the dead band of its sign: the Type 1 margin speaks for it
