"""Texts in JSON: what they say, or one sentence why they cannot be read."""

from __future__ import annotations

import json
from typing import Any

from irsbot_kinematics.errors import BadInput


def parsed(text: str | bytes, where: object = "") -> Any:
    """What a text of a user says. where: its file, for the message. Raises BadInput."""
    try:
        return json.loads(text)
    except ValueError as error:
        reason = str(error)
    except RecursionError:
        reason = "brackets are nested too deeply"
    raise BadInput(f"{where}: not JSON: {reason}" if where else f"not JSON: {reason}")
