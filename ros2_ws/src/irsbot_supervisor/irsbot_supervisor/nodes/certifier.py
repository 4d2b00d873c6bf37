"""The thread that certifies commanded trajectories, only the newest one, so that samples and heartbeats go on."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from queue import Empty, SimpleQueue
from threading import Thread
from typing import NamedTuple

from irsbot_msgs_py.gate_status import GateReason
from irsbot_msgs_py.process.priority import step_behind
from irsbot_supervisor.gate.answer import Answer, held
from irsbot_supervisor.gate.trajectory_gate import GatedMotion, MotionGate, Situation
from irsbot_supervisor.trajectory.joint_path import Command, JointPath

END_S = 1.0
"""s: longest time that the end of the node waits for a trajectory that is being certified."""


class Outcome(NamedTuple):
    """Result of a trajectory command."""

    path: JointPath | None
    """The motion that passed; None: the robot is held."""
    answer: Answer
    stops: int = 0
    """Number of the gate's stops when the motion passed."""


class Task(NamedTuple):
    """A trajectory command that waits to be certified."""

    command: Command
    situation: Situation
    stops: int
    """Number of the gate's stops when the command came."""
    answered: Callable[[Outcome], None]
    """Called once with the outcome, by the thread, unless another command comes first."""


class Certifier:
    """Certifies the newest trajectory command in its own thread."""

    def __init__(self, motions: MotionGate, done: Callable[[Task, GatedMotion], None]) -> None:
        """motions: the gate that certifies. done: called by the thread with every result; its errors are kept for
        `failed`."""
        self.motions = motions
        self._done = done
        self._work: SimpleQueue[Task | None] = SimpleQueue()
        self._failed: SimpleQueue[tuple[Task, Exception]] = SimpleQueue()
        self._thread = Thread(target=self._run, name="command gate", daemon=True)
        self._thread.start()

    def put(self, task: Task) -> None:
        """Certify this command next; waiting commands are dropped."""
        self.drop()
        self._work.put(task)

    def drop(self) -> None:
        """Drop the waiting commands."""
        with suppress(Empty):  # the thread takes from the same queue: to wait for a command could mean for ever
            while True:
                self._work.get_nowait()

    def failed(self) -> list[tuple[Task, Exception]]:
        """Commands whose results were not handled since the last call, and why. For the executor's thread."""
        failed = []
        with suppress(Empty):
            while True:
                failed.append(self._failed.get_nowait())
        return failed

    def end(self) -> None:
        """End the thread; a command that is still being certified is dropped."""
        self.drop()
        self._work.put(None)
        self._thread.join(END_S)

    def _run(self) -> None:
        while (task := self._work.get()) is not None:
            step_behind()
            try:
                motion = self.motions.motion(task.command, task.situation)
            except Exception as error:  # an error inside holds the robot
                motion = GatedMotion(None, held(GateReason.INTERNAL, f"{type(error).__name__}: {error}"))
            try:
                self._done(task, motion)
            except Exception as error:  # the thread goes on, and the executor's thread reports it
                self._failed.put((task, error))
