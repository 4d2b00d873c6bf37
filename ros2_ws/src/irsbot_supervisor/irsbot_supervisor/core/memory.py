"""What a supervisor remembers between samples, for whoever judges many samples at once."""

from __future__ import annotations

from typing import NamedTuple

from irsbot_kinematics import Posture
from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.estimation.estimator import EstimatorMemory
from irsbot_supervisor.core.stopping import StoppingPredictor
from irsbot_supervisor.core.validation import IntakeMemory


class Memory(NamedTuple):
    """What a supervisor remembers of the last samples when it is `quiet`."""

    intake: IntakeMemory
    estimator: EstimatorMemory
    predictor: StoppingPredictor
    at: Posture | None  # where the last good sample was
    contact_m: float  # an assembly clearance below this counts as contact
    gaps: Floats  # m: assembly clearances of the last sample
    samples: int  # number of the last sample
