"""Measures the live page of a running `up --web`: what comes in, frames drawn by Chromium, and the cost of serving.

    ./irsbot python tests/campaigns/live_page.py --seconds 20

Prints states and verdicts per second as the page counts them, frames per second drawn, and the CPU time of the process
that serves the page as a share of one core, once without and once with a browser. Needs Chromium.
"""

from __future__ import annotations

import argparse
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "ros2_ws/src/irsbot_supervisor/test/helpers"))

from browser import PROGRAM, Browser
from ports import free_port

from irsbot_supervisor.processes.suite import LIVE_PAGE, free_domain

COUNT = "(() => { const draw = show; window.drawn = 0; show = () => { window.drawn += 1; draw(); }; })()"
"""Counts in the page what it draws."""


def share(process: psutil.Process, seconds: float) -> float:
    """CPU time of a process over a time, share of one core."""
    before, begin = sum(process.cpu_times()[:2]), time.monotonic()
    time.sleep(seconds)
    return (sum(process.cpu_times()[:2]) - before) / (time.monotonic() - begin)


def main() -> None:
    """Measure and print."""
    given = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    given.add_argument("--seconds", type=float, default=20.0, help="of each measurement")
    given.add_argument("--robot", default="irsbot2")
    stated = given.parse_args()
    if PROGRAM is None:
        sys.exit("needs Chromium: apt install chromium")
    port = free_port()
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "irsbot_supervisor", "up", "--web", "--web-port", str(port)]
        command += ["--domain", str(free_domain()), "--robot", stated.robot, "--out", f"{folder}/run"]
        with subprocess.Popen(command, stdout=subprocess.DEVNULL) as suite:
            try:
                measure(suite, port, Path(folder), stated.seconds)
            finally:
                suite.terminate()  # a job in the background of a shell ignores SIGINT, and so do its children
                suite.wait(30)


def measure(suite: subprocess.Popen[bytes], port: int, folder: Path, seconds: float) -> None:
    """With and without a browser."""
    while True:
        try:
            socket.create_connection(("localhost", port)).close()
            break
        except OSError:
            time.sleep(0.1)
    (page,) = [one for one in psutil.Process(suite.pid).children() if LIVE_PAGE in one.cmdline()]
    with Browser(folder / "profile") as browser:
        browser.open(f"http://localhost:{port}")
        browser.until("Live.now !== null && Live.setup.view && Live.rows.some((row) => row[3].length)")
        browser.run(COUNT)
        begin, frames = time.monotonic(), browser.run("window.drawn")
        cpu = share(page, seconds)
        frames = (browser.run("window.drawn") - frames) / (time.monotonic() - begin)
        now = browser.run("Live.now")
        print(f"in: {now['state_hz']:.0f} states/s, {now['verdict_hz']:.0f} verdicts/s")
        print(f"out: {frames:.1f} frames/s drawn by the browser")
        print(f"serving process with one browser: {100 * cpu:.1f} % of one core")
    print(f"serving process without a browser: {100 * share(page, seconds):.1f} % of one core")
    print(f"load of the machine: {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores")


if __name__ == "__main__":
    main()
