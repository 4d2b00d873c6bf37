"""Colours and names that the pictures of the algebraic analysis share."""

from __future__ import annotations

from irsbot_kinematics.algebra.model.system import System

COLOURS = {0: "#f2f2f2", 1: "#9ecae1", 2: "#4292c6", 4: "#f6c85f", 6: "#d95f4c", 8: "#6aa84f"}
"""Colours by number of solutions."""

BRANCHES = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#17becf", "#8c564b", "#e377c2")
"""Colours of irreducible polynomials, configurations and branches, in turn."""


def colour_of(count: int) -> str:
    """A colour for each number of solutions."""
    return COLOURS.get(count, BRANCHES[count % len(BRANCHES)])


def label_of(system: System, name: str) -> str:
    """A name with its unit; lengths of predefined manipulators have the unit of their lengths."""
    return f"{name} [{system.units.get(name, 'length')}]"
