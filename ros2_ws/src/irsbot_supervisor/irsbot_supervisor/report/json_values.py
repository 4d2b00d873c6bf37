"""Values for JSON."""

from __future__ import annotations

import math
from enum import Enum
from pathlib import Path
from typing import Any


def plain(value: Any) -> Any:
    """The same as lists, texts and numbers; NaN and infinite numbers become None, because JSON does not have them."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return str(value) if isinstance(value, Path) else value
