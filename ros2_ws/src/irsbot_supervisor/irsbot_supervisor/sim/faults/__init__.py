"""Faults between the encoders and the consumer, for tests. `line` describes their syntax."""

from irsbot_supervisor.sim.faults.base import Fault, Sent
from irsbot_supervisor.sim.faults.injector import FaultInjector
from irsbot_supervisor.sim.faults.line import FAULTS, describe, parse_faults

__all__ = ["FAULTS", "Fault", "FaultInjector", "Sent", "describe", "parse_faults"]
