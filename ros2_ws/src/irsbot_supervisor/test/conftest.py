"""Helpers are importable by their own names; hypothesis is repeatable and writes nothing to disk."""

from __future__ import annotations

import sys
from pathlib import Path

from hypothesis import HealthCheck, settings

sys.path.insert(0, str(Path(__file__).parent / "helpers"))

settings.register_profile(
    "irsbot",
    max_examples=30,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.filter_too_much],
)
settings.load_profile("irsbot")
