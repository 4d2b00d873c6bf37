"""A manipulator as a system of equations: F(pose, joints, passive; parameters) = 0 and inequalities."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from itertools import starmap
from typing import Any

from irsbot_kinematics.algebra.model.engine import AlgebraError
from irsbot_kinematics.algebra.model.exact import angle_pair, exact
from irsbot_kinematics.algebra.model.finite import check_denominator, check_finite
from irsbot_kinematics.algebra.model.parse import Reader, cosine_of, generators, positive_side, sine_of, two_sides
from irsbot_kinematics.algebra.model.polynomial import rational
from irsbot_kinematics.algebra.model.substitution import substituted
from irsbot_kinematics.arguments import check_fields

Value = Fraction | tuple[Fraction, Fraction]
"""Value of a length, or (cos, sin) of an angle."""


@dataclass(frozen=True)
class Drawing:
    """Drawing of a configuration: points by name as expressions, lines through them, and usual ranges."""

    points: Mapping[str, Sequence[str]] = field(default_factory=dict)
    chains: Sequence[Sequence[str]] = ()
    loops: Sequence[Sequence[str]] = ()
    actuators: Sequence[str | Sequence[str]] = ()
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True)
class System:
    """A manipulator. Every value is exact; nothing changes after creation.

    equations: texts such as '(x - 1)^2 + y^2 = rho1^2'. inequalities: strict, such as 'rho1 > 0'. Both may divide;
    common factors cancel, and an equation that would be 0/0 somewhere is refused.
    pose, joints, passive: names of the variables X, Q and P of [S4]. angles: those of them, and of the parameters, that
    are angles; they occur as cos(a), sin(a) and own their circle cos^2 + sin^2 = 1.
    parameters: name -> value, or None for one that has no value yet. Angles take (cos, sin) or rad.
    units: name -> unit, for pictures. check=False skips the test of generic finiteness (not that of names and counts).
    Raises AlgebraError in one sentence.
    """

    equations: Sequence[str]
    pose: Sequence[str]
    joints: Sequence[str]
    passive: Sequence[str] = ()
    angles: Sequence[str] = ()
    parameters: Mapping[str, Any] = field(default_factory=dict)
    inequalities: Sequence[str] = ()
    name: str = "mechanism"
    description: str = ""
    units: Mapping[str, str] = field(default_factory=dict)
    drawing: Drawing = field(default_factory=Drawing)
    structure: Any = None
    """Known structure of the equations of a predefined manipulator; see `planar` and `delta`."""
    check: bool = True

    def __post_init__(self) -> None:
        for group in ("equations", "inequalities", "pose", "joints", "passive", "angles"):
            stated = getattr(self, group)
            if isinstance(stated, str):
                raise AlgebraError(f"{group} must be a list of texts, got the text '{stated}'")
        check_fields(self, AlgebraError)
        for group in ("equations", "inequalities", "pose", "joints", "passive", "angles"):
            object.__setattr__(self, group, tuple(getattr(self, group)))
        names = self.names
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise AlgebraError(f"{', '.join(twice)}: declared more than once")
        bad = [name for name in names if not name.isidentifier() or name in ("cos", "sin", "tan")]
        if bad:
            raise AlgebraError(f"'{bad[0]}' is no name; use letters, digits and _")
        lost = [name for name in self.angles if name not in names]
        if lost:
            raise AlgebraError(f"the angle {lost[0]} is no variable and no parameter")
        for group, stated in (("pose", self.pose), ("joints", self.joints), ("equations", self.equations)):
            if not stated:
                raise AlgebraError(f"{group} is empty")
        values = {name: self._value(name, value) for name, value in self.parameters.items() if value is not None}
        reader = Reader(names, self.angles)
        object.__setattr__(self, "_values", values)
        object.__setattr__(self, "_reader", reader)
        object.__setattr__(self, "_generic", tuple(starmap(self._zero, enumerate(self.equations, 1))))
        object.__setattr__(self, "_positive", tuple(starmap(self._sign, enumerate(self.inequalities, 1))))
        self._check_counts()
        if self.check and self.assigned:
            check_finite(self)

    # --- names and values ----------------------------------------------------------------------------------------

    @property
    def names(self) -> tuple[str, ...]:
        """Pose, joints, passive variables and parameters."""
        return (*self.pose, *self.joints, *self.passive, *self.parameters)

    @property
    def values(self) -> dict[str, Value]:
        """Exact values of the parameters that have a value."""
        found: dict[str, Value] = dict(self._values)  # type: ignore[attr-defined]
        return found

    @property
    def assigned(self) -> bool:
        """True if every parameter has a value."""
        return len(self.values) == len(self.parameters)

    @property
    def reader(self) -> Reader:
        """Reader of further expressions in the names of this system."""
        return self._reader  # type: ignore[attr-defined,no-any-return]

    @property
    def generic(self) -> tuple[Any, ...]:
        """The equations with parameters as symbols, flint's fmpq_mpoly."""
        return self._generic  # type: ignore[attr-defined,no-any-return]

    def gens(self, names: Iterable[str]) -> tuple[str, ...]:
        """Names of the ring's generators for these variables."""
        return generators(tuple(names), self.angles)

    def circles(self, names: Iterable[str]) -> list[Any]:
        """cos^2 + sin^2 - 1 for each angle among them."""
        found = []
        for name in names:
            if name in self.angles:
                c, s = (self.reader.gen(g) for g in (cosine_of(name), sine_of(name)))
                found.append(c * c + s * s - 1)
        return found

    def point(self, values: Mapping[str, Any]) -> dict[str, Fraction]:
        """Exact values of generators from values of variables; angles in rad or as pairs. Raises AlgebraError."""
        found: dict[str, Fraction] = {}
        for name, value in values.items():
            if name not in self.names:
                raise AlgebraError(f"'{name}' is no variable of {self.name}; it has {', '.join(self.names)}")
            known = self._value(name, value)
            if isinstance(known, tuple):
                found[cosine_of(name)], found[sine_of(name)] = known
            else:
                found[name] = known
        return found

    def polys(self, fixed: Mapping[str, Fraction] | None = None) -> list[Any]:
        """The equations with the parameters' values and further generators fixed."""
        return [self.evaluated(poly, fixed) for poly in self.generic]

    def positive(self, fixed: Mapping[str, Fraction] | None = None) -> list[Any]:
        """The polynomials that the inequalities require to be positive, evaluated in the same way."""
        return [self.evaluated(poly, fixed) for poly in self._positive]  # type: ignore[attr-defined]

    def evaluated(self, poly: Any, fixed: Mapping[str, Fraction] | None = None) -> Any:
        """A polynomial of this system's ring with the parameters' values and further generators fixed."""
        known = {**self.point(self.values), **(fixed or {})}
        return poly.subs({name: rational(value) for name, value in known.items()}) if known else poly

    def expression(self, text: str, what: str = "the expression") -> Any:
        """A polynomial in the names of this system, with the parameters' values. Raises AlgebraError."""
        return self.evaluated(self.reader.polynomial(text, what))

    # --- other systems -------------------------------------------------------------------------------------------

    def assign(self, **values: Any) -> System:
        """The same system with values of parameters. Raises AlgebraError for a name that is not a parameter."""
        self._known_parameters(values)
        return replace(self, parameters={**self.parameters, **values})

    def unassign(self, *names: str) -> System:
        """The same system with parameters without value: symbols again."""
        self._known_parameters(names or self.parameters)
        return replace(self, parameters={**self.parameters, **dict.fromkeys(names or self.parameters)})

    def substitute(self, replaced: Mapping[str, Any], check: bool | None = None) -> System:
        """The system with variables replaced: a value, or an expression; angles keep cos and sin together.

        {'a': 'a1 + a2'} expands cos(a) and sin(a); new names in the expression take the place and kind of `a`.
        {'a': (3/5, 4/5)} or {'a': 0.7} sets both. A variable that gets a value becomes a parameter.
        """
        return replace(self, **substituted(self, replaced), check=self.check if check is None else check)

    # --- checks --------------------------------------------------------------------------------------------------

    def _known_parameters(self, names: Iterable[str]) -> None:
        for name in names:
            if name not in self.parameters:
                known = ", ".join(self.parameters) or "none"
                raise AlgebraError(f"'{name}' is no parameter of {self.name}; parameters are {known}")

    def _value(self, name: str, value: Any) -> Value:
        if name in self.angles:
            return angle_pair(value, name)
        return exact(value, name)

    def _zero(self, i: int, text: str) -> Any:
        """The polynomial that is zero where an equation holds."""
        what = f"equation {i}"
        left, right = two_sides(str(text), what)
        top, bottom = self.reader.ratio(f"({left}) - ({right})", what)
        if top.is_constant():
            raise AlgebraError(f"{what} '{text}' has no variable")
        check_denominator(self, top, bottom, f"{what} '{text}'")
        return top

    def _sign(self, i: int, text: str) -> Any:
        """The polynomial that is positive where an inequality holds: a ratio has the sign of its product."""
        what = f"inequality {i}"
        top, bottom = self.reader.ratio(positive_side(text, what), what)
        if self.evaluated(bottom) == 0:
            raise AlgebraError(f"{what} '{text}' divides by zero")
        return top * bottom

    def _check_counts(self) -> None:
        n, X, Q, P = len(self.equations), len(self.pose), len(self.joints), len(self.passive)
        if n != X + P:
            raise AlgebraError(
                f"{n} equations for {X} pose and {P} passive variables: direct kinematics needs {X + P} "
                "(the circle of each angle counts by itself)"
            )
        if Q > X:
            raise AlgebraError(f"{Q} joints for {X} pose variables: redundant actuation is not analysed")
