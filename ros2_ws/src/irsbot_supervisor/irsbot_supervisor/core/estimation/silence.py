"""Where the joints may have been while no samples came, and near Type 2 between two samples:
docs/explanation/guarantee.md, "After a long interval" and "Between two samples near Type 2".

The drives brake when UNKNOWN is published, at the latest `stale_s` + `heartbeat_s` after the last sample. They were
free for longer if the supervisor itself was silent then, or if its settings were others.
"""

from __future__ import annotations

from dataclasses import replace
from enum import Enum, auto
from typing import Any

from irsbot_kinematics.mechanism import Coordinate
from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Estimate, Silence
from irsbot_supervisor.core.reachable_box import ReachableBox
from irsbot_supervisor.core.settings import Settings

LARGEST = ("latency_s", "recovery_share", "standstill_speed", "encoder_resolution", "encoder_offset", "stamp_jitter_s")
"""Settings of which the larger lets the joints get farther."""


class Known(Enum):
    """What is known of the motion since the earlier sample, besides the limits of the drives."""

    COVERED = auto()  # no Type 2 singularity is in the reachable box
    STOPPED = auto()  # one may be; the robot is in the last box without one, or moves at recovery speed
    SPEEDS = auto()  # only the speeds
    NOTHING = auto()  # not even them: a joint seems to have moved harder than its acceleration limit allows


class Silences:
    """Computes the region of a silence, from its begin and its end."""

    def __init__(self, settings: Settings, joints: tuple[Coordinate, ...]) -> None:
        self._turns = tuple(joint.turn for joint in joints)
        self._units = tuple(joint.unit for joint in joints)
        self._since_ns = -1  # begin of the silence for which what follows is kept
        self._kept = settings  # the worst limits that were in force in it
        self._noticed_s = self._covered_s = 0.0  # when the drives braked; least latency
        self.configure(settings)

    def configure(self, settings: Settings) -> None:
        """Take in new limits, for the silences that begin from now on."""
        self._settings, self._box = settings, ReachableBox(settings)

    def keep(self, since_ns: int) -> None:
        """Keep the present settings for a silence that lasts: others are about to come into force."""
        settings, same = self._settings, since_ns == self._since_ns
        noticed_s = settings.stale_s + settings.heartbeat_s
        self._noticed_s = max(noticed_s, self._noticed_s) if same else noticed_s
        self._covered_s = min(settings.latency_s, self._covered_s) if same else settings.latency_s
        self._kept = _worst(settings, self._kept) if same else settings
        self._since_ns = since_ns

    def free_until(self, since_ns: int, brakes_ns: int) -> None:
        """Take in that no verdict has made the drives brake before `brakes_ns`."""
        self.keep(since_ns)
        self._noticed_s = max(self._noticed_s, (brakes_ns - since_ns) / NS_PER_S)

    def region(self, since: Estimate, passed_s: float, moved: Floats, held: bool, known: Known) -> Silence | None:
        """Region in which the joints may have been since an earlier sample; None if its reachable box covers the time.

        passed_s: s since then. moved: rad or m, the displacement that is seen now. held: a latched stop held the robot
        then, and holds it still.

        The joints brake as soon as a silence is noticed, and not before. Between the two end positions, no joint was
        farther beyond them than half of the difference between the longest possible path and their distance, unless it
        may have turned the other way. A robot that a stop held stays there, except for motion at recovery speed; if it
        is seen to be faster, nothing holds it.
        """
        settings, box = self._settings, self._box
        noticed_s, covered_s = settings.stale_s + settings.heartbeat_s, settings.latency_s
        if since.seen_ns == self._since_ns:
            noticed_s, covered_s = max(noticed_s, self._noticed_s), min(covered_s, self._covered_s)
            settings = _worst(settings, self._kept)
            box = ReachableBox(settings)
        covered_s += since.expected_s  # after the first sample nothing is expected yet
        stale_s, latency_s = self._settings.stale_s, settings.latency_s
        in_time = passed_s <= (min(covered_s, stale_s) if since.expected_s else stale_s)
        if in_time and known == Known.COVERED:
            return None
        age_s = since.prediction_delay_s - since.expected_s  # when it came
        free_s = age_s + min(passed_s, noticed_s) + latency_s
        longest = box.longest(age_s + passed_s)
        slow = box.slowly(age_s + passed_s) if in_time else box.recovering(free_s)
        rows = zip(moved, slow, box.errors, strict=True)
        fast = held and passed_s <= stale_s and not all(abs(way) <= most + 2.0 * e for way, most, e in rows)
        if known == Known.NOTHING:
            ahead = back = longest
        elif in_time and known == Known.STOPPED and not fast:
            ahead = back = longest = slow
        elif not in_time and held and not fast:
            ahead = back = slow
        elif passed_s <= stale_s:  # nobody has noticed anything
            ahead, back = box.going(since.speeds, age_s + passed_s)
        else:
            ahead, back = box.until_rest(since.speeds, free_s)
        fault = self._too_far(moved, ahead, back) if passed_s > stale_s else ""
        low, high = [], []
        joints = zip(since.position, moved, ahead, back, longest, self._turns, box.errors, strict=True)
        for q, way, up, down, most, turn, e in joints:
            beyond = max(0.5 * (most - abs(way)), 0.0) if most + abs(way) < turn - 2.0 * e else most
            low.append(q + max(min(way, 0.0) - beyond, min(-down, way)) - e)
            high.append(q + min(max(way, 0.0) + beyond, max(up, way)) + e)
        return Silence(tuple(low), tuple(high), fault, in_time, fast)

    def _too_far(self, moved: Floats, ahead: list[float], back: list[float]) -> str:
        """Why the joints cannot have moved as they did; empty if they can, also by more than half a turn."""
        rows = zip(moved, ahead, back, self._turns, self._box.errors, strict=True)
        for j, (way, up, down, turn, e) in enumerate(rows):
            up, down = up + 2.0 * e, down + 2.0 * e
            if not (-down <= way <= up or way + turn <= up or way - turn >= -down):
                name, unit, most = self._settings.joint_names[j], self._units[j], up if way > 0.0 else down
                return (
                    f"joint '{name}' moved by {way:.4g} {unit} while no samples came, and until it stands it can move "
                    f"by {most:.4g} {unit} at most"
                )
        return ""


def _worst(settings: Settings, others: Settings) -> Settings:
    """Settings with the limits of both that let the joints get farthest."""
    values: dict[str, Any] = {name: max(getattr(settings, name), getattr(others, name)) for name in LARGEST}
    for name, worse in (("velocity_limit", max), ("acceleration_limit", max), ("deceleration_limit", min)):
        values[name] = tuple(map(worse, getattr(settings, name), getattr(others, name)))
    return replace(settings, **values)
