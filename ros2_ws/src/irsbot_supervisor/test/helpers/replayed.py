"""A recorded run, and copies of it with changes."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.replay.comparison import against_recording
from irsbot_supervisor.replay.judged import Judged
from irsbot_supervisor.replay.recording import Recording
from irsbot_supervisor.sim.closed_loop import cycles, record
from irsbot_supervisor.sim.simulation import simulation_from

Change = Callable[[object], object]
SECONDS = 1.0
RATE_HZ = 500.0


def record_work(target: Path) -> Path:
    """Record work with a NaN, silence, a jump that is latched, and a reset that is refused."""
    settings, robot = read_settings("irsbot2")
    shipped = {key: shipped_values(robot)[key] for key in ("velocity_limit", "deceleration_limit")}
    simulation = simulation_from({**shipped, "rate_hz": RATE_HZ}, robot)
    faults = "nan:at=0.27,count=1; drop:at=0.45,lasting=0.1; glitch:by=0.5,at=0.8,lasting=0.1"
    record(cycles(simulation, robot, settings, faults, (0.95,)), SECONDS, robot, settings, target)
    return target


def copied(bag: Path, target: Path, change: Change) -> Path:
    """The bag with some of its records changed, or left out where the change returns None."""
    with Bag(bag) as opened, BagWriter(target) as writer:
        for entry in opened.records():
            record = change(entry.record)
            if record is not None:
                writer.add(entry.topic, record, entry.log_ns)
    return target


def faults_of(recording: Recording, judged: Judged) -> dict[str, tuple[str, ...]]:
    return {check.name: check.faults for check in against_recording(recording, judged)}


def samples_of(bag: Path, target: Path) -> Path:
    """The joint states of a bag alone."""
    return copied(bag, target, lambda record: record if isinstance(record, JointSample) else None)
