"""The live page in a headless Chromium beside a running suite, which dies and comes back: it never shows what was."""

from __future__ import annotations

import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from browser import PROGRAM, Browser
from command import PATIENCE_S
from ports import free_port

from irsbot_supervisor.processes.operating import Operator
from irsbot_supervisor.processes.suite import JOINTS, SUPERVISOR, Node, Suite, free_domain

pytestmark = [
    pytest.mark.ros,
    pytest.mark.slow,
    pytest.mark.skipif(PROGRAM is None, reason="needs Chromium: apt install chromium"),
]

LEVELS = ("OK", "WARN", "STOP", "UNKNOWN")
SAID = "document.getElementById('word').textContent"


class Page:
    """`irsbot monitor --web` as a user runs it."""

    def __init__(self, domain: int) -> None:
        self._command = [sys.executable, "-m", "irsbot_supervisor", "monitor", "--web", "--domain", str(domain)]
        self.port = free_port()  # the same when the page is served again

    def serve(self) -> None:
        """Start, and wait until it answers."""
        command = [*self._command, "--web-port", str(self.port)]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert self.process.stdout is not None
        assert f":{self.port} " in self.process.stdout.readline()

    def end(self, how: signal.Signals = signal.SIGINT) -> int:
        """End; the exit code."""
        self.process.send_signal(how)
        self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode


@pytest.fixture(scope="module")
def domain() -> int:
    return free_domain()


@pytest.fixture(scope="module")
def suite(domain: int, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Suite]:
    """A robot that stands; a busy machine may stop it."""
    with Suite(tmp_path_factory.mktemp("logs"), domain) as running:
        start(running)
        with Operator(domain, patience_s=PATIENCE_S) as operator:
            operator.verdict()
        yield running


def start(suite: Suite) -> None:
    suite.start(Node("supervisor", SUPERVISOR, {"robot": "irsbot2"}))
    suite.start(Node("simulated_joints", JOINTS, {"robot": "irsbot2", "scenario": "stand", "listeners": 1}))


@pytest.fixture(scope="module")
def page(domain: int) -> Iterator[Page]:
    served = Page(domain)
    served.serve()
    yield served
    served.end(signal.SIGKILL)


@pytest.fixture
def browser(suite: Suite, page: Page, tmp_path: Path) -> Iterator[Browser]:
    with Browser(tmp_path / "profile") as one:
        one.open(f"http://localhost:{page.port}")
        one.until("Live.now !== null && Live.setup.view && Live.rows.some((row) => row[3].length)")
        yield one


def test_the_page_shows_the_run_as_it_is(browser: Browser, domain: int) -> None:
    assert browser.errors == []
    browser.until(f"{list(LEVELS)}.includes({SAID})")
    with Operator(domain, patience_s=PATIENCE_S) as operator:
        verdict = operator.verdict()
    browser.until(f"Live.verdict && Live.verdict.event >= {verdict.event}")
    # one frame and what is shown of it, taken together
    said, stated, tiles, last = browser.run(
        "new Promise((done) => (function look() {"
        " if (!present()) { setTimeout(look, 1); return; } show();"
        " const tiles = [...document.querySelectorAll('.tile b')].map((one) => one.textContent);"
        f" done([{SAID}, Live.now.level, tiles, Live.rows.at(-1)]); }})())"
    )
    assert said == stated
    assert stated in LEVELS
    if last[2] and last[2][1] is not None:  # no margin belongs to joint states that are late
        assert tiles[1] == f"{last[2][1]:.4f}"
    assert browser.run("Live.setup.robot") == "irsbot2"
    drawn = """['view', 'margins', 'strip'].map(id => { const canvas = document.getElementById(id);
        const dots = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return new Set(new Uint32Array(dots.buffer)).size; })"""
    assert min(browser.run(drawn)) > 3
    assert {url.partition(":")[0] for url in browser.requested} <= {"http", "ws"}
    assert all("localhost" in url for url in browser.requested)


def test_frames_keep_coming_and_the_history_grows_to_its_length(browser: Browser) -> None:
    browser.until("Live.rows.at(-1)[0] - Live.rows[0][0] > 3")
    begin = browser.run("Live.now.t")
    browser.until(f"Live.now.t > {begin} + 1")
    assert browser.run("Live.rows.every((row, k, all) => !k || row[0] > all[k - 1][0])")


def test_a_supervisor_that_falls_silent_is_unknown_at_once_and_comes_back(browser: Browser, suite: Suite) -> None:
    suite.end("supervisor", signal.SIGKILL)
    suite.end("simulated_joints")
    browser.until("Live.now && Live.now.silent")
    browser.until(f"{SAID} === 'UNKNOWN'")
    assert "a consumer brakes" in browser.run("document.getElementById('why').textContent")
    assert browser.run("Live.rows.at(-1)[3]") == []
    start(suite)
    browser.until("Live.now && !Live.now.silent && Live.rows.at(-1)[3].length")


def test_a_server_that_stops_answering_or_dies_is_not_connected(browser: Browser, page: Page) -> None:
    lost = f"{SAID} === 'NOT CONNECTED' && document.body.className === 'lost' && !document.title.includes('OK')"
    page.process.send_signal(signal.SIGSTOP)
    try:
        browser.until(lost)
    finally:
        page.process.send_signal(signal.SIGCONT)
    browser.until("present() && document.body.className === ''")
    assert page.end() == 0
    browser.until(f"{lost} && Live.socket === null")
    page.serve()
    browser.until(f"present() && {SAID} !== 'NOT CONNECTED' && Live.rows.length > 3")
    assert browser.errors == []


def test_a_port_that_is_taken_is_one_line(page: Page) -> None:
    command = [sys.executable, "-m", "irsbot_supervisor", "monitor", "--web", "--web-port", str(page.port)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert "--web-port" in line
