"""A recorder that dies: SIGKILL at random times, a full disk, a folder without write permission.

Our own publisher knows what it sent and when. Flushed data is readable, and the supervisor is not affected.
"""

from __future__ import annotations

import os
import random
import resource
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from irsbot_msgs_py.cdr import encode_joint_state, encode_state
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.bag.salvage import salvage
from irsbot_supervisor.processes.suite import RECORDER, SuiteError, end_with_parent, free_domain
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally
from irsbot_supervisor.validation.with_nodes.recorder import BACK, OF, TOPICS, lines_of, rosbags_count, spoken

KILL, KILL_MUST = "recorder-killed", "SIGKILL at any time: the bag is readable, and at most 1 s is lost"
LACK, LACK_MUST = "disk", "full or read only: the recorder says so, leaves with a code, and the bag is readable"

PATIENCE_S = 30.0
"""s: longest wait until the recorder has written something, or has ended."""
ALLOWED_LOSS_S = 1.0
"""s: largest loss before a SIGKILL; the goal is 0.05 s."""
LONGEST_LOSS_S = "longest loss [s]"

DISK_BYTES = 400_000
"""Bytes that a full disk lets the recorder write: some chunks."""


def run_kill(job: Job) -> Row:
    """The row: a case is a SIGKILL while two topics arrive at 1 kHz."""
    tally, rng, domain = Tally(KILL, job), random.Random(job.seed), free_domain()
    with TemporaryDirectory(prefix="irsbot-kill-") as name:
        for number in range(job.amount):
            folder = Path(name) / f"kill{number}"
            sent, killed_ns = _record_and_kill(folder, rng.uniform(0.3, 1.5), domain)
            fault, last = _after_kill(folder, sent)
            loss_s = (killed_ns - sent[last]) * 1e-9
            tally.largest(LONGEST_LOSS_S, loss_s)
            tally.add(OF, len(sent))
            tally.add(BACK, last + 1)
            if not loss_s <= ALLOWED_LOSS_S:
                fault = fault or f"{loss_s:.3f} s lost"
            tally.case(failed=f"kill {number}: {fault}" if fault else "")
            shutil.rmtree(folder)
    return tally.row()


def run_lack(job: Job) -> Row:
    """The row: a case is a disk that is full after DISK_BYTES (odd cases) or a folder without permission."""
    tally, domain = Tally(LACK, job), free_domain()
    with TemporaryDirectory(prefix="irsbot-lack-") as name:
        for number in range(job.amount):
            folder = Path(name) / f"lack{number}"
            fault = _read_only(domain) if number % 2 else _disk_full(folder, domain)
            tally.case(failed=fault)
    return tally.row()


def _read_only(domain: int) -> str:
    with _recorder(Path("/proc/bag"), domain) as recorder:  # where nobody may create anything, not even root
        stated = _end_of(recorder)
    if recorder.returncode != 2 or stated.count("\n") != 1 or "/proc/bag" not in stated:
        return f"exit code {recorder.returncode}: {stated}"
    return ""


def _disk_full(folder: Path, domain: int) -> str:
    """A recorder whose files cannot grow beyond DISK_BYTES."""
    with _recorder(folder, domain, DISK_BYTES) as recorder:
        sent, _ended_ns = _record(recorder, folder, domain, lambda: recorder.poll() is not None)
        stated = _end_of(recorder)
    if recorder.returncode != 1 or "cannot write" not in stated:
        return f"exit code {recorder.returncode}: {stated}"
    fault, last = _after_kill(folder, sent)
    return fault or ("" if last > 10 else "nothing was recorded before")


def _end_of(recorder: subprocess.Popen[str]) -> str:
    """What a recorder says until it ends. Raises SuiteError if it does not."""
    try:
        return recorder.communicate(timeout=PATIENCE_S)[1]
    except subprocess.TimeoutExpired:
        raise SuiteError(f"the recorder does not end in {PATIENCE_S:.0f} s") from None


@contextmanager
def _recorder(folder: Path, domain: int, largest_file: int = resource.RLIM_INFINITY) -> Iterator[subprocess.Popen[str]]:
    """A recorder, which does not outlive the context or this process."""
    parent = os.getpid()

    def confine() -> None:
        end_with_parent(parent)
        resource.setrlimit(resource.RLIMIT_FSIZE, (largest_file, largest_file))

    parameters = ("--ros-args", "--log-level", "fatal", "-p", f"output:={folder}", "-p", "reserve_mib:=0")
    with subprocess.Popen(
        [sys.executable, "-m", RECORDER, *parameters],
        env={**os.environ, "ROS_DOMAIN_ID": str(domain)},
        stdout=subprocess.DEVNULL,  # where the middleware prints that it has no shared memory
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=confine,
    ) as recorder:
        try:
            yield recorder
        finally:
            recorder.kill()


def _record_and_kill(folder: Path, seconds: float, domain: int) -> tuple[list[int], int]:
    """Record our messages, then SIGKILL; returns the times at which each pair was sent, and at which the recorder was
    killed, ns."""
    with _recorder(folder, domain) as recorder:
        return _record(recorder, folder, domain, lambda: False, seconds)


def _record(
    recorder: subprocess.Popen[str], folder: Path, domain: int, over: Callable[[], bool], seconds: float = PATIENCE_S
) -> tuple[list[int], int]:
    """Publish until the recorder ends, or for this time and then SIGKILL; returns the times at which each pair was sent
    and at which the recorder ended, ns."""
    import rclpy  # needs ROS, which the list of rows does not
    from irsbot_msgs.msg import SingularityState as SingularityStateMsg
    from sensor_msgs.msg import JointState

    context = rclpy.Context()  # a new one each time: it would take 20 s to notice that the recorder is dead
    rclpy.init(context=context, domain_id=domain)
    try:
        node = rclpy.create_node("robot", context=context)
        kinds = (JointState, SingularityStateMsg)
        publishers = [node.create_publisher(kind, topic, 1000) for kind, topic in zip(kinds, TOPICS, strict=True)]
        deadline = time.monotonic() + PATIENCE_S
        while not all(publisher.get_subscription_count() for publisher in publishers):
            if recorder.poll() is not None:
                raise SuiteError(f"the recorder ended with exit code {recorder.returncode}")
            if time.monotonic() > deadline:
                raise SuiteError(f"the recorder does not subscribe in {PATIENCE_S:.0f} s")
            time.sleep(0.01)
        sent = _publish(publishers, folder / f"{folder.name}_0.mcap", over, seconds)
        ended_ns = time.time_ns()
        recorder.kill()
        node.destroy_node()
    finally:
        rclpy.shutdown(context=context)
    return sent, ended_ns


def _publish(publishers: list[Any], bag: Path, over: Callable[[], bool], seconds: float) -> list[int]:
    """Publish at 1 kHz until something has reached the bag, and then for this time; returns the times at which each
    pair was sent, ns.

    A reader may be known to the publisher before the publisher is known to the reader: messages sent in between do not
    count as lost.
    """
    sent: list[int] = []
    begin, due = bag.stat().st_size, time.perf_counter()
    end = due + PATIENCE_S
    while due < end and not over():
        if bag.stat().st_size > begin:
            begin, end = sys.maxsize, due + seconds
        now_ns = time.time_ns()
        sample, state = spoken(len(sent), now_ns)
        publishers[0].publish(encode_joint_state(sample))
        publishers[1].publish(encode_state(state))
        sent.append(now_ns)
        due += 1e-3
        if (rest := due - time.perf_counter()) > 0:
            time.sleep(rest)
    return sent


def _after_kill(folder: Path, sent: list[int]) -> tuple[str, int]:
    """The fault of the bag of a killed recorder, and the number of its last pair."""
    saved = folder / "saved"
    try:
        with Bag(folder) as opened:
            states = [entry.record.sequence for entry in opened.records(TOPICS[1])]  # type: ignore[union-attr]
            samples = [entry.record.stamp_ns for entry in opened.records(TOPICS[0])]  # type: ignore[union-attr]
        salvage(folder, saved)
        count = len(list(lines_of(next(saved.glob("*.mcap")))))
    except BagError as error:
        return str(error), 0
    if not states or not samples:
        return "nothing was recorded", 0
    first = sent.index(samples[0])
    if states != list(range(states[0], states[-1] + 1)) or samples != sent[first : first + len(samples)]:
        return "there is a gap", 0
    if count != len(states) + len(samples) or rosbags_count(saved) != count:
        return "the salvaged bag does not hold all that could be read", 0
    return "", min(states[-1], sent.index(samples[-1]))
