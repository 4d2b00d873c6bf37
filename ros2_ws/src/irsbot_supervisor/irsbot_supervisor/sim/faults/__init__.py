"""Faults on the way from the encoders to the consumer, for rehearsals. `line` says how they are asked for."""

from .base import Fault, Sent
from .injector import FaultInjector
from .line import KINDS, describe, parse_faults

__all__ = ["KINDS", "Fault", "FaultInjector", "Sent", "describe", "parse_faults"]
