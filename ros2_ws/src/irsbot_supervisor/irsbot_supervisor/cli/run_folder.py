"""What `demo` and `up` share: the folder of a run, and an end in order."""

from __future__ import annotations

from pathlib import Path

from irsbot_supervisor.bag.errors import BagError

LISTENERS = 2
"""Supervisor and recorder: the simulated joints wait for both, so that they receive the run from its first sample."""

LOGS, BAG = "logs", "bag"
"""Names of the parts of a run's folder."""


def prepare(target: Path) -> None:
    """Make the folders for logs and bag. Raises OSError if they cannot be made, BagError if there is a bag already."""
    (target / LOGS).mkdir(parents=True, exist_ok=True)
    if (target / BAG).exists():
        raise BagError(f"'{target / BAG}' exists already: a run needs a folder without a bag")
