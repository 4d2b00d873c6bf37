"""Hypothesis is repeatable, writes nothing to disk, and asks nobody how long an example took."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("irsbot", max_examples=30, deadline=None, derandomize=True, database=None)
settings.load_profile("irsbot")
