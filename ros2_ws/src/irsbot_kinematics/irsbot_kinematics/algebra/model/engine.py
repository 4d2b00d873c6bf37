"""The engine for exact arithmetic: python-flint, loaded on first use, because it is an optional extra."""

from __future__ import annotations

import importlib
from typing import Any

from irsbot_kinematics.errors import BadInput, KinematicsError


class AlgebraUnavailable(KinematicsError):
    """python-flint is not installed."""

    def __init__(self) -> None:
        super().__init__(
            "irsbot_kinematics.algebra needs python-flint, which is not installed; "
            "install it with: pip install 'irsbot_kinematics[algebra]' or pip install python-flint"
        )


class AlgebraError(BadInput):
    """A system, a box or a number that cannot be analysed; the message names it and says what would be right."""


class TooLarge(AlgebraError):
    """A computation that would take too long; the message has its size. `allow_large=True` starts it anyway."""


class _Flint:
    """The module `flint`, imported when one of its names is first used."""

    def __getattr__(self, name: str) -> Any:
        try:
            module = importlib.import_module("flint")
        except ImportError:
            raise AlgebraUnavailable from None
        value = getattr(module, name)
        setattr(self, name, value)
        return value


flint: Any = _Flint()
