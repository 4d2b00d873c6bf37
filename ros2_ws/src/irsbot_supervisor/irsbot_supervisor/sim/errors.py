"""Refusals of the simulation, each with a sentence that says what would be right."""

from __future__ import annotations


class SimulationError(ValueError):
    """Base of all exceptions that this package raises on purpose."""


class BadPath(SimulationError):
    """A path that cannot be followed."""


class BadScenario(SimulationError):
    """A scenario that cannot be read or run."""


class BadFault(SimulationError):
    """A fault line that cannot be read."""


class BadSetting(SimulationError):
    """A limit, mass, resolution or time that no robot can have."""
