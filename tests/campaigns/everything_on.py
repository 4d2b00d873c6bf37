"""Runs the whole suite at 1 kHz with everything on, and shows latency, loss and memory.

    ./irsbot python tests/campaigns/everything_on.py --minutes 30 --out runs/everything_on

Starts `up --web --foxglove`: simulated joints, kinematics, supervisor, recorder, live page, server for Foxglove. A
client of Foxglove receives every channel; a Chromium shows the live page if there is one. The memory of every node is
sampled once a second. Latency and loss come from the recorded bag, which is removed afterwards. The supervisor passes
over samples that are old when a newer one waits: such a sample has no state, but is not lost. Exit code 1 if a sample
was lost, or if a node grew; 2 if the run could not be made.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import math
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import numpy as np
import psutil
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.serialization import deserialize_message
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "ros2_ws/src/irsbot_supervisor/test/helpers"))

from browser import PROGRAM, Browser
from ports import free_port

from irsbot_msgs_py.records import JointSample, SingularityState
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.cli.run_folder import BAG
from irsbot_supervisor.nodes.samples import LATE_NS
from irsbot_supervisor.processes.suite import free_domain
from irsbot_supervisor.validation.with_nodes.soak import GROWTH_MB

PROTOCOL: Any = "foxglove.sdk.v1"
PATIENCE_S = 60.0
WARM_UP_S = 30.0
"""s until memory counts: buffers and histories fill up; at most a quarter of the run."""
PERIOD_S = 0.001
"""s between two joint states of the simulation."""
EDGES_MS = (0.1, 0.2, 0.3, 0.5, 0.7, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 30.0, math.inf)
"""Upper edges of the histogram."""
SHARES = {"p50": 50.0, "p99": 99.0, "p99.9": 99.9, "worst": 100.0}
"""Percentiles that are printed."""
OLD_MS = LATE_NS * 1e-6
"""An older sample is not judged if a newer one waits."""
BAR = 50
"""Number of characters of its longest bar."""


class Judged(NamedTuple):
    """What the bag says."""

    latency_ms: np.ndarray[Any, np.dtype[np.float64]]
    """From the stamp of a joint state to the publication of its state."""
    samples: int
    unjudged: int
    """Number of recorded joint states between the first and the last state that no recorded state belongs to."""
    unsent: int
    """Number of periods without a joint state: the simulation was late, or the recorder lost it."""
    lost: int
    """Number of joint states without a state that were not old when the next one was judged."""
    skipped: int
    """Number of joint states that the supervisor skipped for newer ones, by its last diagnostics; its queue keeps the
    newest, and older ones do not come to its notice."""


def main() -> int:
    """Run, measure, print."""
    given = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    given.add_argument("--minutes", type=float, default=30.0)
    given.add_argument("--robot", default="irsbot2")
    given.add_argument("--out", type=Path, required=True, help="a new folder for the run")
    stated = given.parse_args()
    if stated.out.exists():
        given.error(f"{stated.out} is there already: give a new folder")
    ports = free_port(), free_port()
    command = [sys.executable, "-m", "irsbot_supervisor", "up", "--robot", stated.robot, "--out", str(stated.out)]
    command += ["--domain", str(free_domain()), "--web", "--web-port", str(ports[0])]
    command += ["--foxglove", "--foxglove-port", str(ports[1])]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as suite, contextlib.ExitStack() as after:
        after.callback(end, suite)
        messages = after.enter_context(channels(suite, ports[1]))
        after.enter_context(page(ports[0], stated.out))
        memory, busy = watch(suite, 60.0 * stated.minutes)
        print(f"Foxglove's client received {messages[0]:,} messages; {'a' if PROGRAM else 'no'} browser at the page")
    if suite.returncode:
        fail(f"up ended with exit code {suite.returncode}, see {stated.out / 'logs'}")
    grown = show_memory(memory, busy, 60.0 * stated.minutes)
    judged = judgement(stated.out / BAG)
    shutil.rmtree(stated.out / BAG)
    show_latency(judged)
    print(f"load of the machine: {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores")
    return 1 if grown or judged.lost or judged.unsent else 0


def fail(reason: str) -> NoReturn:
    """End without a result."""
    print(reason, file=sys.stderr)
    sys.exit(2)


def end(suite: subprocess.Popen[bytes]) -> None:
    """End the suite in order. A job in the background of a shell ignores SIGINT, and so do its children."""
    suite.terminate()
    suite.wait(PATIENCE_S)


@contextlib.contextmanager
def channels(suite: subprocess.Popen[bytes], port: int) -> Iterator[list[int]]:
    """A client of Foxglove that receives every channel; yields the number of messages so far."""
    deadline = time.monotonic() + PATIENCE_S
    while True:
        try:
            link = connect(f"ws://localhost:{port}", subprotocols=[PROTOCOL], max_size=None, ping_interval=None)
            break
        except OSError:
            if time.monotonic() > deadline or suite.poll() is not None:
                fail("the server for Foxglove did not start")
            time.sleep(0.1)  # nothing says that a port opens
    received = [0]

    def receive() -> None:
        with contextlib.suppress(ConnectionClosed):
            for message in link:
                if isinstance(message, bytes):
                    received[0] += 1
                elif (told := json.loads(message))["op"] == "advertise":
                    wanted = [{"id": one["id"], "channelId": one["id"]} for one in told["channels"]]
                    link.send(json.dumps({"op": "subscribe", "subscriptions": wanted}))

    reader = threading.Thread(target=receive)
    reader.start()
    try:
        yield received
    finally:
        link.close()
        reader.join()


@contextlib.contextmanager
def page(port: int, folder: Path) -> Iterator[None]:
    """A browser at the live page, where there is one."""
    if PROGRAM is None:
        yield
        return
    with Browser(folder / "browser") as browser:
        browser.open(f"http://localhost:{port}")
        browser.until("Live.now !== null && Live.rows.some((row) => row[3].length)")
        yield
    shutil.rmtree(folder / "browser", ignore_errors=True)


def watch(suite: subprocess.Popen[bytes], seconds: float) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Resident memory of every node once a second, MB; processor time of every node, s."""
    nodes = {name_of(child): child for child in psutil.Process(suite.pid).children()}
    memory: dict[str, list[float]] = {name: [] for name in nodes}
    before = {name: sum(node.cpu_times()[:2]) for name, node in nodes.items()}
    begin_s, warm_s = time.monotonic(), min(WARM_UP_S, 0.25 * seconds)
    while (now_s := time.monotonic() - begin_s) < seconds:
        if now_s >= warm_s:
            for name, node in nodes.items():
                memory[name].append(node.memory_info().rss * 1e-6)
        if sys.stderr.isatty():
            print(f"\r{now_s:.0f} of {seconds:.0f} s", end="", file=sys.stderr)
        with contextlib.suppress(subprocess.TimeoutExpired):
            suite.wait(1.0)
            fail(f"up ended after {now_s:.0f} s")
    return memory, {name: sum(node.cpu_times()[:2]) - before[name] for name, node in nodes.items()}


def name_of(node: psutil.Process) -> str:
    """The last part of the module that a node runs."""
    line = node.cmdline()
    return line[line.index("-m") + 1].rpartition(".")[2]


def show_memory(memory: dict[str, list[float]], busy: dict[str, float], seconds: float) -> bool:
    """Print a line for every node; True if one grew."""
    grown = False
    for name, series in sorted(memory.items()):
        tenth = max(len(series) // 10, 1)
        first, last = float(np.median(series[:tenth])), float(np.median(series[-tenth:]))
        grown |= not last - first <= GROWTH_MB
        share = 100.0 * busy[name] / seconds
        print(f"{name:<18} {first:6.1f} -> {last:6.1f} MB  {share:5.1f} % of a core")
    return grown


def judgement(bag: Path) -> Judged:
    """Latency and loss."""
    sent: set[int] = set()
    judged: dict[int, float] = {}
    with Bag(bag) as run:
        for entry in run.records():
            if isinstance(entry.record, SingularityState):
                judged[entry.record.stamp_ns] = 1e3 * (entry.record.sample_age + entry.record.compute_time)
            elif isinstance(entry.record, JointSample):
                sent.add(entry.record.stamp_ns)
        skipped = [count for message in run.messages("/diagnostics") if (count := skipped_in(message.data)) is not None]
    first, last = min(judged), max(judged)
    between = sorted(stamp for stamp in sent if first <= stamp <= last)
    periods = np.round(np.diff(between) / (PERIOD_S * NS_PER_S))
    ages = ages_when_passed(between, judged)
    return Judged(
        np.array(list(judged.values())),
        len(between),
        len(ages),
        int(np.maximum(periods - 1.0, 0.0).sum()),
        sum(age <= OLD_MS for age in ages),
        max(skipped, default=0),
    )


def ages_when_passed(sent: list[int], latency_ms: dict[int, float]) -> list[float]:
    """Ages, ms, of the joint states without a state when the state of the next judged one was published. sent: stamps,
    ns, in order. latency_ms: of the judged ones, by stamp."""
    ages, published_ms = [], math.nan
    for stamp in reversed(sent):
        if stamp in latency_ms:
            published_ms = 1e3 * stamp / NS_PER_S + latency_ms[stamp]
        else:
            ages.append(published_ms - 1e3 * stamp / NS_PER_S)
    return ages


def skipped_in(diagnostics: bytes) -> int | None:
    """The number of skipped samples in a message of diagnostics; None if it is from another node."""
    said: DiagnosticArray = deserialize_message(diagnostics, DiagnosticArray)
    found = [int(value.value) for status in said.status for value in status.values if value.key == "skipped"]
    return found[0] if found else None


def show_latency(judged: Judged) -> None:
    """Print percentiles, a histogram and the losses."""
    latency = judged.latency_ms
    shares = {name: float(np.percentile(latency, share)) for name, share in SHARES.items()}
    print("latency, from the stamp of a joint state to its published state [ms]:")
    print("  " + ", ".join(f"{name} {value:.3f}" for name, value in shares.items()))
    counts = np.histogram(latency, [0.0, *EDGES_MS])[0]
    for edge, count in zip(EDGES_MS, counts.tolist(), strict=True):
        label = f"< {edge:g} ms" if edge < math.inf else f">= {EDGES_MS[-2]:g} ms"
        print(f"  {label:>10} {count:10,} {'#' * math.ceil(BAR * count / counts.max())}")
    print(f"{judged.samples:,} joint states, {judged.unjudged} without a state, {judged.unsent} periods without one")
    print(f"{judged.lost} were lost; the others were older than {OLD_MS:g} ms when a newer one was judged")
    print(f"{judged.skipped} were skipped by the supervisor's own count; the others fell out of its queue")


if __name__ == "__main__":
    sys.exit(main())
