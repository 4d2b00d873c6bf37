"""What a supervisor remembers between samples, for whoever judges many samples at once."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_kinematics import Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.estimation.estimate import Estimate
from irsbot_supervisor.core.estimation.frozen import Still
from irsbot_supervisor.core.estimation.observer import ObserverMemory
from irsbot_supervisor.core.estimation.sample_interval import IntervalMemory
from irsbot_supervisor.core.stopping import StoppingPredictor
from irsbot_supervisor.core.validation import Accepted, IntakeMemory


class Standstill(NamedTuple):
    """Since when the joints stand."""

    rest: Floats  # rad or m: positions since which no joint has moved faster than the standstill speed
    rest_ns: int  # time of these positions
    stood_ns: int  # time since which no joint has moved faster


class EstimatorMemory(NamedTuple):
    """What `Estimator` remembers, as long as it is `quiet`."""

    last: Estimate | None
    before: Estimate | None  # the one before the last
    observer: ObserverMemory
    reported: tuple[Accepted, ...]
    intervals: IntervalMemory
    still: dict[int, Still]  # joints whose position may be frozen, by number
    standstill: Standstill


class Memory(NamedTuple):
    """What a supervisor remembers of the last samples when it is `quiet`."""

    intake: IntakeMemory
    estimator: EstimatorMemory
    predictor: StoppingPredictor
    at: Posture | None  # where the last good sample was
    contact_m: float  # an assembly clearance below this counts as contact
    samples: int  # number of the last sample
