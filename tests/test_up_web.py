"""`up --web` with a robot that works, in a headless Chromium: level, margins with limits, motion, and a new run."""

from __future__ import annotations

import signal
import socket
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from browser import PROGRAM, Browser
from command import IRSBOT, PATIENCE_S
from ports import free_port

import irsbot_kinematics as irs
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.stopping import limits_of
from irsbot_supervisor.processes.operating import Operator
from irsbot_supervisor.processes.suite import free_domain
from irsbot_supervisor.replay.series import MARGINS

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.skipif(PROGRAM is None, reason="needs Chromium: apt install chromium"),
]

WORD = "document.getElementById('word').textContent"
POSTURE = "Live.rows.length && Live.rows.at(-1)[3].length && Live.rows.at(-1)[3].every(Number.isFinite)"

TOGETHER = (
    f"new Promise((done) => (function look() {{{{ if (!({POSTURE})) {{{{ setTimeout(look, 1); return; }}}}"
    " done({}); }})())"
)
"""A value taken from one frame that has a posture: after a pause of the machine a frame has none."""

SLOW = """
supervisor: {ros__parameters: {acceleration_limit: [10.0]}}
simulated_joints: {ros__parameters: {acceleration_limit: [10.0]}}
"""
"""Drives that speed up slowly, rad/s2: samples that are late on a busy machine are no reason to latch a stop."""


class Up:
    """`irsbot up --web`, again and again at the same port."""

    def __init__(self, folder: Path) -> None:
        self.domain, self._folder, self._runs = free_domain(), folder, 0
        self._slow = folder / "slow.yaml"
        self._slow.write_text(SLOW)
        self.port = free_port()

    def start(self) -> None:
        self._runs += 1
        command = [*IRSBOT, "up", "--web", "--web-port", str(self.port), "--domain", str(self.domain)]
        command += ["--out", str(self._folder / f"run{self._runs}"), "--params", str(self._slow)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        assert self.process.stdout.readline() == f"live page: http://localhost:{self.port}\n"

    def await_page(self) -> None:
        """Wait until the page's process listens: it loads when the suite has begun."""
        deadline = time.monotonic() + PATIENCE_S
        while True:
            try:
                socket.create_connection(("localhost", self.port), PATIENCE_S).close()
                return
            except ConnectionRefusedError:
                assert self.process.poll() is None
                assert time.monotonic() < deadline
                time.sleep(0.05)

    def end(self) -> str:
        """Ctrl-C; what was printed on stderr."""
        self.process.send_signal(signal.SIGINT)
        try:
            _out, printed = self.process.communicate(timeout=PATIENCE_S)
        finally:
            self.process.kill()
        return printed


@pytest.fixture(scope="module")
def up(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Up]:
    running = Up(tmp_path_factory.mktemp("up"))
    running.start()
    yield running
    running.end()


@pytest.fixture(scope="module")
def browser(up: Up, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Operator(up.domain, patience_s=PATIENCE_S) as operator, Browser(tmp_path_factory.mktemp("b") / "p") as one:
        operator.verdict()
        up.await_page()
        one.open(f"http://localhost:{up.port}")
        one.until(f"Live.now !== null && Live.setup.view && {POSTURE}")
        yield one


def test_margins_stand_beside_the_limits_of_the_run(browser: Browser) -> None:
    settings, _robot = read_settings("irsbot2")
    browser.until(f"{POSTURE} && document.querySelectorAll('.tile').length > 3")
    told = browser.run("[...document.querySelectorAll('.tile')].map(t => [...t.children].map(c => c.textContent))")
    tiles = {name: limits for name, _value, limits in told}
    stops, warns = limits_of(settings, "stop"), limits_of(settings, "warn")
    shown = [name for name in MARGINS if name in tiles]
    assert len(shown) >= 3
    for name, stop, warn in zip(MARGINS, stops, warns, strict=True):
        if name in tiles:
            assert tiles[name] == f"stop below {stop:g}, warning below {warn:g}"
    browser.until(f"['OK', 'WARN', 'STOP', 'UNKNOWN'].includes({WORD})")  # a busy machine may not answer at once


def test_the_mechanism_moves_as_the_joints_do(browser: Browser) -> None:
    browser.until(POSTURE)
    first = browser.run(TOGETHER.format("[Live.now.joints, document.getElementById('view').toDataURL()]"))
    joint = next(iter(first[0]))
    browser.until(f"{POSTURE} && Math.abs(Live.now.joints['{joint}'] - {first[0][joint]}) > 0.05")
    browser.settle()
    assert browser.run("document.getElementById('view').toDataURL()") != first[1]
    pose, joints = browser.run(TOGETHER.format("[Live.rows.at(-1)[3], Live.now.joints]"))
    robot = irs.make_robot("irsbot2")
    at = robot.direct([joints[one.name] for one in robot.mechanism.joints])
    assert list(at) == pytest.approx(pose, abs=1e-6)


def test_frames_are_drawn_all_the_time(browser: Browser, capsys: pytest.CaptureFixture[str]) -> None:
    browser.run("(() => { const draw = show; window.drawn = 0; show = () => { window.drawn += 1; draw(); }; })()")
    browser.until("window.drawn >= 60")
    begin = browser.run("[performance.now(), window.drawn]")
    browser.until(f"performance.now() > {begin[0]} + 2000")
    end = browser.run("[performance.now(), window.drawn]")
    with capsys.disabled():
        print(f" [{1e3 * (end[1] - begin[1]) / (end[0] - begin[0]):.1f} frames/s]", end="")
    assert browser.errors == []


def test_the_page_survives_the_end_of_the_run_and_shows_the_next_one(browser: Browser, up: Up) -> None:
    assert "Traceback" not in up.end()
    browser.until(f"{WORD} === 'NOT CONNECTED' && document.body.className === 'lost'")
    up.start()
    browser.until(f"present() && {WORD} !== 'NOT CONNECTED' && Live.setup.view && {POSTURE}")
    assert browser.errors == []
