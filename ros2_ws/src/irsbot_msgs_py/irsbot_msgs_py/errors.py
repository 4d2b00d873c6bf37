"""Errors of messages."""

from __future__ import annotations


class CdrError(ValueError):
    """Bytes that are not the expected message, or a record that does not fit its message."""
