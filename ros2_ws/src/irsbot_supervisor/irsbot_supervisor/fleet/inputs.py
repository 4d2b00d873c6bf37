"""Inputs of jobs as workers on other machines see them."""

from __future__ import annotations

import platform
from pathlib import Path


def fault_of(path: str, name: str, kind: str) -> str:
    """Why a worker cannot read an input; empty if its file is there. name: of the input, and kind: of all, for the
    text."""
    if Path(path).exists():
        return ""
    return f"{name} does not exist on {platform.node()}; every machine must see the {kind} under the same path"
