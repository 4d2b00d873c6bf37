"""What a live page is told: the last seconds as rows, and the newest look. Without ROS and without a clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import isfinite
from typing import Any

import orjson

from irsbot_kinematics import KinematicsError
from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S, Floats, SingularityState, Verdict, cause_names
from irsbot_supervisor.core.margins import MARGIN_CAUSES
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.live.scene import Scene
from irsbot_supervisor.processes.observed import Change, Seen
from irsbot_supervisor.replay.run_summary import margin_of
from irsbot_supervisor.report.json_values import plain
from irsbot_supervisor.report.sections import AGAIN_S, elsewhere

HISTORY_S = 30.0
"""s that a page shows."""

CHANGES = 8
"""Changes of the verdict that a page lists."""

BOX_EVERY = 3
"""Looks between two drawings of the reachable box: it takes longer than the rest, and is drawn for pages alone."""

Draw = Callable[[Scene, SingularityState], None]
"""Asked for a robot, with its first known pose, to find what stands still, and again with one at which the loci have
another section; it answers with `Feed.show`."""


@dataclass
class Known:
    """What one page has been told."""

    setup: int = 0
    row: int = 0
    change: Change | None = None
    verdict: Any = ()  # none was told; it may be told that there is none
    box: list[Any] | None = None


class Feed:
    """Remembers looks at one suite, and tells a page what it does not know yet."""

    def __init__(self, draw: Draw) -> None:
        self._draw = draw
        self._rows: deque[list[Any]] = deque()
        self._count = 0  # rows until now
        self._seen: tuple[Seen, SingularityState | None, float] | None = None  # the newest look, and when
        self._now: dict[str, Any] = {}  # what is told of it; empty until a page asks
        self._changes: list[dict[str, Any]] = []
        self._change: Change | None = None  # the newest of them
        self._setup: dict[str, Any] = {}
        self._number = 0  # of the setup: it changes when the setup does
        self._scene: Scene | None = None
        self._configured: tuple[Mapping[str, Any], Mapping[str, Any]] = {}, {}
        self._asked: tuple[Floats, float] | None = None  # pose and time of the newest drawing
        self._box: list[Any] = []
        self._told = False  # since the newest box

    def hear(self, seen: Seen, now_s: float) -> None:
        """A new look."""
        if (seen.limits, seen.machine) != self._configured:
            self._configure(seen)
        scene, state = self._scene, seen.state if seen.state_age_s <= CONSUMER_TIMEOUT_S else None
        if scene is None or state is None or len(state.joint_position) != len(scene.mechanism.joints):
            state = None
        elif all(map(isfinite, state.pose)) and self._is_elsewhere(scene, state.pose, now_s):
            self._asked = state.pose, now_s
            self._draw(scene, state)
        self._rows.append(self._row(seen, state, now_s))
        self._count += 1
        while now_s - self._rows[0][0] > HISTORY_S:
            self._rows.popleft()
        if scene is None or state is None:
            self._box = self._box and []
        elif self._count % BOX_EVERY == 0:
            lines = scene.reachable(state, 1.0 / max(seen.state_hz, 1.0)) if self._told else []
            self._box, self._told = lines, False
        self._seen, self._now = (seen, state, now_s), {}
        if seen.changes[-1:] != (self._change,) and seen.changes:
            self._change = seen.changes[-1]
            self._changes = [
                {"t": one.time_s, "level": one.level.name, "causes": cause_names(one.causes), "text": one.text}
                for one in seen.changes[-CHANGES:]
            ]

    def show(self, scene: Scene, view: dict[str, Any]) -> None:
        """What stands still of a robot, unless another one is supervised by now."""
        if scene is self._scene:
            self._set({**self._setup, "view": view})

    def answer(self, known: Known, left: int = 0) -> str:
        """JSON: `setup`, `changes`, `verdict` and `box` if the page has others, `rows` since the last, and `now`; null
        for numbers that are not finite.

        left: frames that the page will be told without asking again.
        """
        self._told = True
        if not self._now and self._seen is not None:
            self._now = self._told_of(*self._seen)
        told: dict[str, Any] = {"now": self._now, "left": left}
        if known.setup != self._number:
            told["setup"] = self._setup
        if known.change is not self._change:
            told["changes"] = self._changes
        new = min(self._count - known.row, len(self._rows))
        verdict = _shown(self._seen[0].verdict) if self._seen is not None else None
        if known.verdict != verdict:
            told["verdict"] = verdict
        if known.box is not self._box:
            told["box"] = self._box
        told["rows"] = [self._rows[place] for place in range(len(self._rows) - new, len(self._rows))]
        known.setup, known.row, known.change = self._number, self._count, self._change
        known.verdict, known.box = verdict, self._box
        return orjson.dumps(told, option=orjson.OPT_SERIALIZE_NUMPY).decode()  # floats of numpy, too

    def _configure(self, seen: Seen) -> None:
        before, self._configured = self._scene, (seen.limits, seen.machine)
        try:
            self._scene = Scene(seen.limits, seen.machine)
            setup = self._scene.setup()
        except (KinematicsError, InvalidSettings) as error:  # of another version, or of a file that is not here
            self._scene, setup = None, {"robot": str(seen.machine.get("name", "")), "note": str(error)}
        if before is None or self._scene is None or before.record != self._scene.record:
            self._asked = None
        else:
            setup["view"] = self._setup.get("view")  # other limits, the same robot
        self._set(setup)

    def _is_elsewhere(self, scene: Scene, pose: Floats, now_s: float) -> bool:
        """Whether a drawing is due: the first one, and for somebody who looks each whose section is another."""
        if self._asked is None:
            return True
        before, asked_s = self._asked
        due = self._told and scene.has_sections and now_s - asked_s >= AGAIN_S
        return due and elsewhere(scene.mechanism, pose, before)

    def _set(self, setup: dict[str, Any]) -> None:
        self._setup = plain(setup)
        self._number += 1

    def _told_of(self, seen: Seen, state: SingularityState | None, now_s: float) -> dict[str, Any]:
        joints = self._scene.joints(state) if self._scene is not None and state is not None else {}
        return {"t": now_s, **_now(seen, state), "joints": joints}

    def _row(self, seen: Seen, state: SingularityState | None, now_s: float) -> list[Any]:
        """Time, worst level since the last row, columns, pose, smallest and largest values of the columns since the
        last row; not finite for what is not known."""
        columns: list[float] = []
        if state is not None and state.type1_margin:
            columns = [*[margin_of(state, kind) for kind in MARGIN_CAUSES], state.stop_margin]
        extremes = (seen.smallest, seen.largest) if self._scene is not None else ((), ())
        return [now_s, seen.worst.name, columns, state.pose if state else (), *extremes]


def _shown(verdict: Verdict | None) -> dict[str, Any] | None:
    """What a page shows of a verdict."""
    if verdict is None:
        return None
    return {
        "level": verdict.level.name,
        "causes": cause_names(verdict.causes),
        "text": verdict.text,
        "findings": [finding.text for finding in verdict.findings],
        "latched": verdict.latched,
        "event": verdict.event,
        "speed_scale": verdict.speed_scale,
    }


def _now(seen: Seen, state: SingularityState | None) -> dict[str, Any]:
    """The newest look. Ages in s, infinite for what was never heard."""
    return {
        "level": seen.level.name,
        "stop_limit": state.stop_limit if state else None,
        "time_to_stop": state.time_to_stop if state else None,
        "sample_age_s": state.sample_age if state else None,
        "compute_s": state.compute_time if state else None,
        "silent": seen.verdict_age_s > CONSUMER_TIMEOUT_S,
        "verdict_age_s": seen.verdict_age_s,
        "state_age_s": seen.state_age_s,
        "verdict_hz": seen.verdict_hz,
        "state_hz": seen.state_hz,
    }
