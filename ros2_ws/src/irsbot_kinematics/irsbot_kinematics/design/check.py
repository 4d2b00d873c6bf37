"""The verdict on one design: whether it is free of singularities, their kinds and places, and the reasons."""

from __future__ import annotations

from dataclasses import dataclass

from irsbot_kinematics.arguments import checked
from irsbot_kinematics.design import proximal
from irsbot_kinematics.design.loci import LocusPart, type_2_parts
from irsbot_kinematics.design.proximal import QUESTIONS, ZONES
from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Signs
from irsbot_kinematics.mechanisms.irsbot2_space import distal
from irsbot_kinematics.mechanisms.irsbot2_space.designs import Designs
from irsbot_kinematics.mechanisms.irsbot2_space.geometry import Irsbot2Geometry
from irsbot_kinematics.mechanisms.irsbot2_space.singular_postures import (
    Reachability,
    SingularPosture,
    reachability,
    singular_postures,
)


@dataclass(frozen=True)
class Finding:
    """One question of the design space, with its answer."""

    name: str
    holds: bool
    larger: float
    """m: left side of the inequality; infinite where the distal loop cannot take the posture at all."""
    smaller: float
    """m."""

    @property
    def why(self) -> str:
        """The inequality with both values."""
        question = QUESTIONS[self.name]
        if self.larger == float("inf"):
            return "the distal loop cannot take it"
        stated = "holds" if self.holds else "fails"
        return f"{question.inequality} {stated}: {self.larger:.6g} against {self.smaller:.6g} m"


@dataclass(frozen=True)
class Step:
    """One box of the flow chart, [S0] Fig. 16, with step 5 added."""

    number: int
    question: str
    answer: bool
    because: str


@dataclass(frozen=True)
class Met:
    """A singularity that the robot reaches in one working mode, on one side of the line through the motors."""

    what: str
    working_mode: Signs
    below: bool


@dataclass(frozen=True)
class Verdict:
    """The complete result of `check`."""

    zone: str
    free: bool
    """True if the design is in the requested zone."""
    findings: tuple[Finding, ...]
    zones: dict[str, bool]
    printed: dict[str, bool]
    """The same zones as printed in [S0], if it prints them."""
    flow: tuple[Step, ...]
    postures: tuple[tuple[SingularPosture, Reachability], ...]
    loci: tuple[LocusPart, ...]

    def failed(self) -> tuple[Finding, ...]:
        """The questions of the zone with the answer no."""
        return tuple(f for f in self.findings if f.name in ZONES[self.zone] and not f.holds)

    def met(self) -> tuple[Met, ...]:
        """Singularities that are reached, by working mode and side. A posture that holds on the line counts on both
        sides."""
        found = [Met(f"psi_I = psi_II{' + pi' * part.opposite}", part.working_mode, part.below) for part in self.loci]
        for posture, where in self.postures:
            found += [
                Met(f"{posture.kind.value} at ({p.pose[0]:.4f}, {p.pose[1]:.4f})", p.working_mode, below)
                for p in where.placements
                for below in (True, False)
                if p.height * (-1.0 if below else 1.0) >= 0.0
            ]
        return tuple(dict.fromkeys(found))

    def free_in(self, mode: Signs, below: bool | None = None) -> bool:
        """True if no singularity is met in a working mode, on one side or on both. A posture on the boundary between
        two modes (sign 0) counts for both; a posture that holds anywhere counts for all."""
        if any(where.anywhere for _, where in self.postures):
            return False
        return not any(
            (below is None or met.below == below)
            and all(m in (0, w) for m, w in zip(met.working_mode, mode, strict=True))
            for met in self.met()
        )


@checked
def check(g: Irsbot2Geometry, zone: str = "strict") -> Verdict:
    """Judge a design by one of ZONES. Raises BadInput for an unknown zone."""
    if zone not in ZONES:
        raise BadInput(f"no zone '{zone}'; zones are {', '.join(ZONES)}")
    d = Designs.of(g)
    found = proximal.evaluate_questions(d)
    findings = tuple(
        Finding(name, bool(proximal.holds(name, sides)[0]), float(sides.larger[0]), float(sides.smaller[0]))
        for name, sides in found.items()
    )
    zones = {name: bool(proximal.in_zone(name, found)[0]) for name in ZONES}
    printed = {name: bool(flags[0]) for name, flags in proximal.evaluate_printed_zones(d).items() if name in ZONES}
    held = [(posture, reachability(g, posture)) for posture in singular_postures(g)]
    return Verdict(
        zone=zone,
        free=zones[zone],
        findings=findings,
        zones=zones,
        printed=printed,
        flow=_flow(d, zones, {finding.name: finding for finding in findings}),
        postures=tuple((posture, where) for posture, where in held if where.slack <= 0.0),
        loci=type_2_parts(g),
    )


def _flow(d: Designs, zones: dict[str, bool], found: dict[str, Finding]) -> tuple[Step, ...]:
    numbers = {kind.value: int(n[0]) for kind, n in zip(distal.Kind, distal.counts(d), strict=True)}
    cases = ", ".join(f"{n} of Case {kind}" for kind, n in numbers.items() if n and not kind.startswith("C1"))
    free = bool(distal.distal_free(d)[0])
    steps = [Step(1, "Table 1: the distal loop takes no posture of Cases I to III", free, cases or "none")]
    if free:
        steps.append(Step(2, "in Z_a and Z_wac", zones["wac"], _why(found, "assembled", "opposite")))
    else:
        reached = [name for name in ("I1", "I2", "II", "III", "legs") if not found[name].holds]
        because = f"reaches {', '.join(reached)}" if reached else "none of the postures can be assembled"
        steps.append(Step(3, "in Z: assembled, and in no singular posture", zones["z"], because))
        steps.append(Step(4, "in Z_wac too: Z_wps", zones["wps"], _why(found, "assembled", "opposite")))
    upright = f"{numbers['C1a'] + numbers['C1b']} postures of Condition 1; {_why(found, 'equal', 'C1a', 'C1b')}"
    steps.append(Step(5, "nor Condition 1 nor psi_I = psi_II: Z_wps_strict", zones["strict"], upright))
    return tuple(steps)


def _why(found: dict[str, Finding], *names: str) -> str:
    failing = [f"{QUESTIONS[name].inequality} fails" for name in names if not found[name].holds]
    return ", ".join(failing) or "all inequalities hold"
