"""The view of the robot that the gates use: its present state and the age of that state."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_kinematics import Posture
from irsbot_msgs_py.records import Floats
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.latch import Judgement


class View(NamedTuple):
    """The present state of the robot."""

    at: Posture
    velocity: Floats  # rad/s or m/s, NaN where not known
    speeds: Speeds  # certain
    prediction_delay_s: float  # age of the sample, and until the next can be expected
    expected_s: float  # of these until the next can be expected
    standing: bool  # True if no joint has moved for `stale_s`
    judgement: Judgement
    seen_ns: int  # when the sample came, steady clock

    def aged(self, now_ns: int) -> View:
        """The same at a later time: the information is older by then."""
        return self._replace(prediction_delay_s=self.prediction_delay_s + max(now_ns - self.seen_ns, 0) / NS_PER_S)
