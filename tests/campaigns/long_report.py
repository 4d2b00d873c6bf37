"""Measures the page of a long run: how long `report` takes, how large the page is, and how soon Chromium shows it.

    ./irsbot python tests/campaigns/long_report.py --minutes 10

Writes a bag of joint states of an irsbot2 that swings at 1 kHz, makes the page, opens it, and moves the cursor. Needs
Chromium.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from math import cos, pi, sin
from pathlib import Path

import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "ros2_ws/src/irsbot_supervisor/test/helpers"))

from browser import PROGRAM, Browser

from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.cli.app import main as irsbot
from irsbot_supervisor.configuration.loading import read_settings

PERIOD_NS = 1_000_000
BEGIN_NS = 1_700_000_000_000_000_000
SWINGS_HZ = (0.31, 0.23)
"""Of the two joints: in ten minutes the path is never the same."""

SIZE = 0.06
"""rad of a swing around the middle of the workspace."""

CURSOR_MOVES = 100


def swinging(target: Path, samples: int) -> None:
    """Write the bag."""
    settings, robot = read_settings("irsbot2")
    middle = robot.inverse((0.0, -0.85), settings.working_mode)
    with BagWriter(target) as bag:
        for number in range(samples):
            now_ns = BEGIN_NS + number * PERIOD_NS
            phases = [2.0 * pi * hz * number * PERIOD_NS * 1e-9 for hz in SWINGS_HZ]
            position = tuple(float(q) + SIZE * sin(phase) for q, phase in zip(middle, phases, strict=True))
            rates = [SIZE * 2.0 * pi * hz * cos(phase) for hz, phase in zip(SWINGS_HZ, phases, strict=True)]
            sample = JointSample(
                stamp_ns=now_ns,
                received_ns=now_ns,
                seen_ns=now_ns,
                names=settings.joint_names,
                position=position,
                velocity=tuple(rates),
            )
            bag.add("/joint_states", sample, now_ns)


def opened(page: Path, folder: Path) -> tuple[float, float]:
    """Until everything is drawn, and of one move of the cursor, s."""
    with Browser(folder / "profile") as browser:
        browser.open("about:blank")
        begin = time.monotonic()
        browser.open(page)
        shown_s = time.monotonic() - begin
        assert browser.errors == []
        begin = time.monotonic()
        browser.run(
            f"(async () => {{ const [a, b] = Run.data.span; for (let k = 0; k < {CURSOR_MOVES}; k++) {{"
            f" moveTo(a + (b - a) * k / {CURSOR_MOVES}); await new Promise(requestAnimationFrame); }} }})()"
        )
        return shown_s, (time.monotonic() - begin) / CURSOR_MOVES


def main() -> None:
    """Measure and print."""
    given = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    given.add_argument("--minutes", type=float, default=10.0, help="of the run")
    given.add_argument("--keep", type=Path, help="where to write the page")
    stated = given.parse_args()
    if PROGRAM is None:
        sys.exit("needs Chromium: apt install chromium")
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        samples, page = int(stated.minutes * 60e9 / PERIOD_NS), stated.keep or folder / "run.html"
        swinging(folder / "bag", samples)
        begin = time.monotonic()
        sys.argv = ["irsbot", "report", str(folder / "bag"), "--robot", "irsbot2", "-o", str(page), "--force"]
        try:
            irsbot()
        except SystemExit as end:
            if end.code:
                raise
        print(
            f"{samples} samples: report in {time.monotonic() - begin:.1f} s, page of {page.stat().st_size / 1e6:.2f} MB"
        )
        shown_s, move_s = opened(page, folder)
        print(f"Chromium shows it in {shown_s:.2f} s; a move of the cursor takes {1e3 * move_s:.1f} ms")
        print(f"load of the machine: {psutil.getloadavg()[0]:.1f} on {psutil.cpu_count()} cores")


if __name__ == "__main__":
    main()
