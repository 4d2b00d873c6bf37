"""One rule for arguments: they are converted to plain numbers, or refused with BadInput in one sentence.

The sentence names the argument, the right value and the given one. A number is an int or a float of Python or numpy,
single or in a list, tuple or array; text, bool, complex numbers and other shapes are refused. The supervisor calls
`Mechanism` for every sample, which checks nothing and does not use this module.
"""

from __future__ import annotations

import functools
import inspect
import reprlib
import typing
from collections.abc import Callable, Mapping, Sequence
from math import inf
from types import UnionType
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike

from irsbot_kinematics.errors import BadInput
from irsbot_kinematics.mechanism import Coordinate, Floats, Legs, Mechanism, Signs
from irsbot_kinematics.numerics.arithmetic import FLOATS, Array
from irsbot_kinematics.numerics.tolerances import FARTHEST, LARGEST, PAIR_TOL_M

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])


def shown(value: object) -> str:
    """The given value on one short line."""
    try:
        return " ".join(reprlib.repr(value).split())
    except ValueError:  # an int of more digits than Python prints
        return f"a {type(value).__name__} too long to print"


def array(values: ArrayLike, what: str, wanted: str, error: type[ValueError] = BadInput, copy: bool = True) -> Array:
    """Numbers as an array of floats of any shape; also NaN and infinite ones. wanted: the right value, for the
    message. copy: False if an array of floats may be returned as it is."""
    try:
        given = np.asarray(values)
    except (TypeError, ValueError):  # rows of different lengths
        given = np.empty(0, dtype=object)
    if given.dtype.kind not in "iuf" and given.size:
        raise error(f"{what} must be {wanted}, got {shown(values)}")
    return given.astype(float, copy=copy)


def number(
    value: Any, what: str, low: float = -LARGEST, high: float = LARGEST, error: type[ValueError] = BadInput
) -> float:
    """A finite number, low <= value <= high."""
    if _is_number(value) and not abs(value) < inf:
        raise error(f"{what} must be finite, got {value}")
    if not (_is_number(value) and low <= value <= high):
        raise error(f"{what} must be a number{_range(low, high)}, got {shown(value)}")
    return float(value)


def positive(value: Any, what: str, high: float = LARGEST) -> float:
    """A finite number, 0 < value <= high."""
    if not (_is_number(value) and 0.0 < value <= high):
        raise BadInput(f"{what} must be a number > 0 and at most {high:g}, got {shown(value)}")
    return float(value)


def count(value: Any, what: str, low: float, high: float = LARGEST) -> int:
    """A whole number, low <= value <= high."""
    if not (_is_number(value) and isinstance(value, (int, np.integer)) and low <= value <= high):
        raise BadInput(f"{what} must be a whole number{_range(low, high)}, got {shown(value)}")
    return int(value)


def vector(values: ArrayLike, length: int, what: str, largest: float = LARGEST) -> Floats:
    """(length,) finite numbers of absolute value at most `largest`."""
    wanted = f"{length} finite numbers of at most {largest:g}"
    given = array(values, what, wanted)
    if given.shape != (length,):
        raise BadInput(f"{what} must be {wanted}, got {_form(given)} {shown(values)}")
    if not (np.abs(given) <= largest).all():
        raise BadInput(f"{what} must be {wanted}, got {shown(values)}")
    return tuple(given.tolist())


def matrix(values: ArrayLike, shape: tuple[int, ...], what: str) -> Array:
    """Finite numbers of a shape."""
    given = array(values, what, f"numbers of shape {shape}")
    if given.shape != shape or not (np.abs(given) <= LARGEST).all():
        raise BadInput(f"{what} must be finite numbers of shape {shape}, got {shown(values)}")
    return given


def table(values: ArrayLike, columns: int, what: str, copy: bool = True) -> Array:
    """(N, columns) numbers. NaN and infinite ones are allowed: their rows get a status. copy: as for `array`."""
    wanted = f"numbers of shape (N, {columns})"
    given = array(values, what, wanted, copy=copy)
    if given.ndim != 2 or given.shape[1] != columns:
        raise BadInput(f"{what} must be {wanted}, got shape {given.shape}")
    return given


def place(values: ArrayLike, coordinates: Sequence[Coordinate], what: str) -> Floats:
    """Joint positions or a pose: one finite number per coordinate, of absolute value at most FARTHEST."""
    return vector(
        values, len(coordinates), f"{what} ({', '.join(f'{c.name} [{c.unit}]' for c in coordinates)})", FARTHEST
    )


def interval(values: ArrayLike, what: str, low: float = -LARGEST, high: float = LARGEST) -> tuple[float, float]:
    """Two finite numbers, the first one smaller, low <= both <= high."""
    first, last = vector(values, 2, what)
    if not low <= first < last <= high:
        raise BadInput(f"{what} must be a range low < high{_range(low, high)}, got {first:.9g} to {last:.9g}")
    return first, last


def one_of(value: Any, known: Sequence[T], what: str) -> T:
    """The element of `known` that equals the value."""
    try:
        return known[known.index(value)]
    except (ValueError, TypeError):
        raise BadInput(f"{what} {shown(value)} is not one of {', '.join(map(str, known))}") from None


def instance(value: object, what: str, kind: type[T] | tuple[type[T], ...], wanted: str) -> T:
    """An instance of a class. wanted: the right value, for the message."""
    if not isinstance(value, kind):
        raise BadInput(f"{what} must be {wanted}, got {shown(value)}")
    return value


def signs(text: str) -> Signs:
    """A working mode such as `+-`."""
    if not text or set(text) - {"+", "-"}:
        raise BadInput(f"a working mode is a row of + and -, one per leg, such as +-; got {shown(text)}")
    return tuple(1 if sign == "+" else -1 for sign in text)


def working_mode(mechanism: Mechanism, mode: str | ArrayLike | None) -> Signs:
    """A working mode of the mechanism, from signs such as (1, -1) or text such as '+-'; None: its usual one."""
    if mode is None:
        return mechanism.usual_working_mode
    given: Sequence[Any]
    if isinstance(mode, str):
        given = signs(mode)
    else:
        given = tuple(array(mode, "working mode", "signs such as (1, -1) or '+-'").ravel().tolist())
    return one_of(given, mechanism.working_modes, "working mode")


def assembly_mode(mechanism: Mechanism, mode: int | None) -> int:
    """An assembly mode of the mechanism; None: its usual one."""
    if mode is None:
        return mechanism.usual_assembly_mode
    if not _is_number(mode):
        raise BadInput(f"assembly mode {shown(mode)} is not one of {', '.join(map(str, mechanism.assembly_modes))}")
    return one_of(mode, mechanism.assembly_modes, "assembly mode")


def closing_legs(mechanism: Mechanism, joints: Floats, pose: Floats) -> Legs[float]:
    """Legs at consistent joint positions and pose."""
    legs = mechanism.legs(FLOATS, joints, pose)
    errors = [abs(error) for error in legs.closure]
    if not all(error <= PAIR_TOL_M for error in errors):
        leg = max(range(len(errors)), key=lambda i: errors[i] if errors[i] >= 0.0 else inf)
        raise BadInput(
            f"pose and joints must belong together, got a pose that leg {leg + 1} misses by {errors[leg]:.3g} m; "
            "take the joints from inverse(pose) or the pose from direct(joints)"
        )
    return legs


def checked(function: F) -> F:
    """Decorator: checks arguments by their annotations, with the rules of `rule_of`; refuses others."""
    signature = inspect.signature(function)

    @functools.wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        given = signature.bind(*args, **kwargs)
        for name, rule in _rules(function).items():
            if name in given.arguments:
                given.arguments[name] = rule(given.arguments[name], name)
        return function(*given.args, **given.kwargs)

    return cast(F, call)


def check_fields(record: Any, error: type[ValueError] = BadInput) -> None:
    """The same for the fields of a new dataclass; numbers become plain ones. Defaults are not checked."""
    for name, rule in _rules(cast(Callable[..., Any], type(record))).items():
        value = getattr(record, name)
        default = getattr(type(record), name, record)
        if value is default or (isinstance(value, float) and value == default):
            continue
        try:
            object.__setattr__(record, name, rule(value, name))
        except BadInput as refused:
            raise error(str(refused)) from None


Rule = Callable[[Any, str], Any]


@functools.cache
def _rules(annotated: Callable[..., Any]) -> dict[str, Rule]:
    hints = typing.get_type_hints(annotated)
    found = {name: rule_of(hint) for name, hint in hints.items() if name != "return"}
    return {name: rule for name, rule in found.items() if rule is not None}


def rule_of(annotation: Any) -> Rule | None:
    """Check of an argument by its annotation; None: the function itself checks it.

    float: a finite number. int: a whole number. tuple[float, float]: that many of them. A class, bool, str, a mapping:
    an instance. A sequence: any sequence except text. None only if the annotation allows it.
    """
    origin, inner = typing.get_origin(annotation), typing.get_args(annotation)
    if annotation is float:
        return number
    if annotation is int:
        return functools.partial(count, low=-LARGEST)
    if origin in (typing.Union, UnionType):
        kinds = [kind for kind in inner if kind is not type(None)]
        if type(None) in inner and len(kinds) == 1:
            rule = rule_of(kinds[0])
            return rule and (lambda value, what: None if value is None else rule(value, what))
        if not all(inspect.isclass(kind) and typing.get_origin(kind) is None for kind in inner):
            return None
        return functools.partial(instance, kind=tuple(inner), wanted=" or ".join(kind.__name__ for kind in kinds))
    if origin is tuple and inner and inner[-1] is not Ellipsis:
        return functools.partial(_each, rules=[rule_of(kind) for kind in inner])
    if origin is not None and inspect.isclass(origin) and issubclass(origin, Mapping):
        return functools.partial(_mapping, rule=rule_of(inner[0]) if inner else None)
    if origin in (tuple, list, Sequence):
        return functools.partial(_sequence, rule=rule_of(inner[0]) if inner else None)
    if inspect.isclass(annotation) and origin is None and annotation not in (object, Any):
        return functools.partial(instance, kind=annotation, wanted=f"of {annotation.__name__}")
    return None


def _each(values: Any, what: str, rules: Sequence[Rule | None]) -> tuple[Any, ...]:
    found = _sequence(values, what, None)
    if len(found) != len(rules):
        raise BadInput(f"{what} must be {len(rules)} values, got {shown(values)}")
    return tuple(rule(value, what) if rule else value for rule, value in zip(rules, found, strict=True))


def _mapping(values: Any, what: str, rule: Rule | None) -> Any:
    for key in instance(values, what, Mapping, "a mapping"):
        if rule:
            rule(key, f"every name in {what}")
    return values


def _sequence(values: Any, what: str, rule: Rule | None) -> tuple[Any, ...]:
    array_like = isinstance(values, np.ndarray) and values.ndim > 0
    if isinstance(values, (str, bytes)) or not (array_like or isinstance(values, Sequence)):
        raise BadInput(f"{what} must be a sequence, got {shown(values)}")
    return tuple(rule(value, what) if rule else value for value in values)


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def _range(low: float, high: float) -> str:
    if high < LARGEST:
        return f" from {low:g} to {high:g}"
    return f" >= {low:g}" if low > -LARGEST else f" of at most {high:g} in size"


def _form(given: Array) -> str:
    return f"{given.size} in" if given.ndim == 1 else f"shape {given.shape} in"
