"""Mistakes of those who start a node."""

from __future__ import annotations

USAGE = 2
"""Exit code."""


class UsageError(Exception):
    """The node cannot start as requested: exit code 2 and this sentence."""
