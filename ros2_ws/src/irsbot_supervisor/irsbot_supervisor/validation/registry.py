"""All rows of the fault campaign, in the order of their table."""

from __future__ import annotations

from irsbot_supervisor.validation import processes
from irsbot_supervisor.validation.harness.oracle import supervised
from irsbot_supervisor.validation.harness.rows import Entry
from irsbot_supervisor.validation.in_process import (
    adversary,
    approach,
    changes,
    clean,
    delivery,
    escape,
    garbage,
    loci,
    stamps,
    swings,
)
from irsbot_supervisor.validation.with_nodes import resets

EACH = 1000
"""Approaches per robot."""

ENTRIES: tuple[Entry, ...] = (
    Entry(
        approach.NAME,
        approach.MUST,
        max(EACH * len(supervised()), 10_000),
        2 * len(supervised()),
        approach.run,
        over_robots=True,
    ),
    Entry(swings.NAME, swings.MUST, 200 * len(supervised()), len(supervised()), swings.run, over_robots=True),
    Entry(
        adversary.NAME,
        adversary.MUST,
        2000 * len(supervised()),
        4 * len(supervised()),
        adversary.run,
        over_robots=True,
    ),
    Entry(clean.NAME, clean.MUST, 1_000_000, 20_000, clean.run, over_robots=True),
    Entry(escape.NAME, escape.MUST, 1000, len(supervised()), escape.run, over_robots=True),
    Entry(delivery.NAME, delivery.MUST, 5000, 50, delivery.run),
    Entry(stamps.NAME, stamps.MUST, 6000, 60, stamps.run),
    Entry(garbage.NAME, garbage.MUST, 10_000, 200, garbage.run, over_robots=True),
    Entry(loci.NAME, loci.MUST, 10_000, 4 * len(supervised()), loci.run, over_robots=True),
    Entry(changes.NAME, changes.MUST, 10_000, 100, changes.run),
    Entry(resets.NAME, resets.MUST, 10_000, 200, resets.run),
    *processes.ENTRIES,
)
