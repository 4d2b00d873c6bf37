"""Copies of the modules of equations, which also take numbers that record what is done to them."""

from __future__ import annotations

import builtins
import math
from collections.abc import Callable, Mapping, Sequence
from functools import reduce
from itertools import chain
from types import SimpleNamespace
from typing import Any

from irsbot_kinematics.bounds.box_code import EQUATIONS, source_of
from irsbot_kinematics.machine_code.branching import Recorder, Trace, all_of
from irsbot_kinematics.machine_code.symbols import Symbol

PACKAGE = "irsbot_kinematics"


class Copies:
    """The modules of the equations, executed once more, with functions that also take the numbers of a trace."""

    def __init__(self, trace: Recorder) -> None:
        self._trace = trace
        self._modules: dict[str, SimpleNamespace] = {}
        own = {"min": self._folded("min", "smaller"), "max": self._folded("max", "larger"), "all": all_of}
        self._builtins = {**vars(builtins), **own, "__import__": self._import}
        functions = {name: self._function(name) for name in ("sqrt", "copysign")}
        self._math = SimpleNamespace(**{**vars(math), **functions})

    def module(self, name: str) -> SimpleNamespace:
        """A copy of one of `EQUATIONS`."""
        if name not in self._modules:
            file = source_of(name)
            names: dict[str, Any] = {"__name__": f"recorded.{name}", "__builtins__": self._builtins}
            exec(compile(file.read_text(encoding="utf-8"), file, "exec"), names)
            if name == "bounds.quadratics":
                names["least"] = self._least(names["least"])
            if name == "bounds.boxes" and isinstance(self._trace, Trace):
                names["room_within"] = self._room(names["room_within"])
            self._modules[name] = SimpleNamespace(**names)
        return self._modules[name]

    def _import(
        self,
        name: str,
        given: Mapping[str, object] | None = None,
        local: Mapping[str, object] | None = None,
        wanted: Sequence[str] = (),
        level: int = 0,
    ) -> Any:
        if name == "math":
            return self._math
        if name.startswith(PACKAGE):
            short = name[len(PACKAGE) + 1 :]
            if short in EQUATIONS:
                return self.module(short)
            inner = {one: f"{short}.{one}" if short else one for one in wanted or ()}
            if inner and set(inner.values()) <= set(EQUATIONS):
                return SimpleNamespace(**{one: self.module(path) for one, path in inner.items()})
        return builtins.__import__(name, given, local, wanted, level)

    def _folded(self, name: str, recorded: str) -> Callable[..., Any]:
        """`min` or `max`."""
        usual: Callable[..., Any] = getattr(builtins, name)

        def function(*given: Any) -> Any:
            parts = list(given[0]) if len(given) == 1 else given
            if not any(isinstance(part, Symbol) for part in parts):
                return usual(parts)
            return reduce(lambda one, other: self._trace.value(recorded, one, other), parts)

        return function

    def _function(self, name: str) -> Callable[..., Any]:
        usual: Callable[..., Any] = getattr(math, name)

        def function(*given: Any) -> Any:
            if any(isinstance(part, Symbol) for part in given):
                return self._trace.value(name, *given)
            return usual(*given)

        return function

    def _least(self, usual: Callable[..., float]) -> Callable[..., Any]:
        def function(n: int, a: Sequence[Any]) -> Any:
            if any(isinstance(part, Symbol) for part in a):
                return self._trace.value("least", *a)
            return usual(n, a)

        return function

    def _room(self, usual: Callable[..., list[float] | None]) -> Callable[..., Any]:
        """`room_within`: one operation of the trace, which finds a room or not."""

        def function(shares: Any, sizes: Any, start: Sequence[Any], legs: Any, dims: int) -> Any:
            parts = [*chain(*shares), *chain(*sizes), *start, *chain(*legs)]
            if not any(isinstance(part, Symbol) for part in parts):
                return usual(shares, sizes, start, legs, dims)
            found = self._trace.value("room", *parts)
            return [self._trace.input(f"{found.name}_is[{k}]") for k in range(len(start))] if found > 0.0 else None

        return function
