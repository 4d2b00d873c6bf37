"""All rows of the fault campaign, in the order of their table."""

from __future__ import annotations

from irsbot_supervisor.campaign.rows import Entry

ENTRIES: tuple[Entry, ...] = ()
