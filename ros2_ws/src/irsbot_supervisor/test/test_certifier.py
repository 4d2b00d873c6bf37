"""The thread that certifies trajectories: what its callers never wait for, and what it survives."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from threading import Thread
from types import SimpleNamespace
from typing import Any

import pytest

from irsbot_msgs_py.gate_status import GateReason
from irsbot_supervisor.gate.answer import held
from irsbot_supervisor.gate.trajectory_gate import GatedMotion
from irsbot_supervisor.nodes.certifier import Certifier, Task

PATIENCE_S = 60.0

HELD = GatedMotion(None, held(GateReason.NONE))


def certifier_of(done: Callable[[Task, GatedMotion], None]) -> Certifier:
    motions: Any = SimpleNamespace(motion=lambda _command, _situation: HELD)
    return Certifier(motions, done)


def task() -> Task:
    nothing: Any = None
    return Task(nothing, nothing, 0, lambda _outcome: None)


@pytest.fixture
def busy_switching() -> Iterator[None]:
    """Threads are switched so often that they meet in every line."""
    before_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before_s)


def test_who_puts_commands_never_waits_for_the_thread(busy_switching: None):
    """The thread takes the last waiting command while the caller is about to drop it."""
    certifier = certifier_of(lambda _task, _motion: None)

    def put() -> None:
        for _ in range(20_000):
            certifier.put(task())

    caller = Thread(target=put, daemon=True)
    caller.start()
    caller.join(PATIENCE_S)
    assert not caller.is_alive()
    certifier.end()
