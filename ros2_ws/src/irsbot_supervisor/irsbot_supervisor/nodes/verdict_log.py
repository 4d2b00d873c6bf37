"""Logs verdicts: every latched stop, and the begin and end of STOP and UNKNOWN."""

from __future__ import annotations

from typing import Any

from irsbot_msgs_py.records import Level, Verdict
from irsbot_msgs_py.stamps import NS_PER_S

PAUSE_NS = NS_PER_S
"""ns between two lines about levels: a flickering level is logged once a second, and the last level always."""


class VerdictLog:
    """Takes in every verdict."""

    def __init__(self, logger: Any) -> None:
        self._logger = logger
        self._event = 0  # of the last logged stop
        self._level: Level | None = None  # last logged: OK also stands for WARN
        self._told_ns = 0

    def hear(self, verdict: Verdict, now_ns: int) -> None:
        """now_ns: steady clock."""
        level = verdict.level if verdict.level >= Level.STOP else Level.OK
        if verdict.latched and verdict.event != self._event:
            self._event = verdict.event
            self._logger.warning(
                f"a stop is latched, event {verdict.event}, level {verdict.level.name}: {verdict.text}"
            )
        elif level == self._level or (self._level is not None and now_ns - self._told_ns < PAUSE_NS):
            return
        elif level >= Level.STOP:
            self._logger.warning(f"{level.name}: {verdict.text}")
        else:
            self._logger.info(f"{verdict.level.name}: motion is allowed")
        self._level, self._told_ns = level, now_ns
