"""Lengths of the IRSBot-2 and the inequalities they satisfy."""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, pi, sin, sqrt

from irsbot_kinematics.mechanisms.geometry_checks import require, require_finite
from irsbot_kinematics.numerics.tolerances import COINCIDENT_TOL_M


@dataclass(frozen=True)
class Irsbot2Geometry:
    """Lengths in metres, angle in radians, names as in [S0] and [S1]."""

    l1: float
    """Proximal arm."""
    l2eq: float
    """Equivalent distal rod."""
    b: float
    """Half distance of the motor axes."""
    p: float
    """Half platform width."""
    a1: float
    """Elbow arm."""
    a2: float
    """Platform arm."""
    beta: float
    """Inclination of the elbow arms, 0 < beta < pi/2."""
    e: float = 0.0
    """Distance by which the elbow frame lies below the end of the proximal arm; any sign."""

    def __post_init__(self) -> None:
        require_finite(self)
        for name in ("l1", "l2eq", "b", "p", "a1", "a2"):
            require(f"{name} > 0", getattr(self, name) > 0.0, getattr(self, name), 0.0)
        require("a1 > a2", self.a1 > self.a2, self.a1, self.a2)
        require("beta > 0", self.beta > 0.0, self.beta, 0.0)
        require("beta < pi/2", self.beta < pi / 2, self.beta, pi / 2)
        apart = f"|b0| > {COINCIDENT_TOL_M} (b0 = b - p - a1 sin(beta); else the elbows coincide at every q_1 = q_2)"
        require(apart, abs(self.b0) > COINCIDENT_TOL_M, abs(self.b0), COINCIDENT_TOL_M)
        limit = self.l1 + self.l2eq
        require("|b0| <= l1 + l2eq (assembly)", abs(self.b0) <= limit, abs(self.b0), limit)

    @property
    def b0(self) -> float:
        """Half base of the equivalent five-bar, m."""
        return self.b - self.p - self.a1 * sin(self.beta)

    @property
    def D(self) -> float:
        """(a1 - a2) sin(beta), m."""
        return (self.a1 - self.a2) * sin(self.beta)

    @property
    def mu(self) -> float:
        """a2 / (a1 - a2)."""
        return self.a2 / (self.a1 - self.a2)

    @property
    def ell(self) -> float:
        """mu l2eq, m."""
        return self.mu * self.l2eq

    @property
    def Lc(self) -> float:
        """Largest distance of the points P_I, P_II, m: divides the constraint moments to compare them with forces."""
        return 2.0 * (self.p + self.ell)

    @property
    def l2(self) -> float:
        """Length of each of the four distal rods, m ([S1] (1))."""
        return sqrt(self.l2eq**2 + ((self.a1 - self.a2) * cos(self.beta)) ** 2)
