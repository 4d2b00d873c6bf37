"""Takes the screenshots of docs/how_to/seeing.md: the report, the live page and the monitor, light and dark.

    ./irsbot python docs/pictures/draw_pages.py                 # writes docs/pictures/page_*.png

The live page and the monitor show a run of `up --web` with the robot at work. Needs Chromium and ROS 2.
"""

from __future__ import annotations

import argparse
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from PIL import Image

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "ros2_ws/src/irsbot_supervisor/test/helpers"))

from browser import PROGRAM, Browser  # noqa: E402
from rich.console import Console  # noqa: E402

from irsbot_supervisor.cli.tables.monitor import screen  # noqa: E402
from irsbot_supervisor.processes.monitoring import Monitor  # noqa: E402
from irsbot_supervisor.processes.suite import free_domain  # noqa: E402

IRSBOT = [sys.executable, "-m", "irsbot_supervisor"]
WIDE, NARROW = (1400, 900), (400, 860)
HISTORY = (
    "Live.rows.length && Live.rows.at(-1)[0] - Live.rows[0][0] > 12 && Live.setup.view && Live.rows.at(-1)[3].length"
)


def main() -> None:
    """Take them all."""
    given = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    given.add_argument("--out", type=Path, default=HERE)
    target = given.parse_args().out
    if PROGRAM is None:
        sys.exit("needs Chromium: apt install chromium")
    target.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as scratch, Browser(Path(scratch) / "profile") as browser:
        report = Path(scratch) / "run.html"
        subprocess.run([*IRSBOT, "report", str(ROOT / "bags/type2"), "-o", str(report)], check=True)
        browser.resize(*WIDE)
        browser.open(report)
        take(browser, target, "report")
        live(browser, target, Path(scratch))


def live(browser: Browser, target: Path, scratch: Path) -> None:
    """The live page and the monitor beside one run."""
    with socket.socket() as probe:
        probe.bind(("localhost", 0))
        port = int(probe.getsockname()[1])
    domain = free_domain()
    command = [*IRSBOT, "up", "--web", "--web-port", str(port), "--domain", str(domain), "--out", str(scratch / "up")]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL) as suite:
        try:
            while socket.socket().connect_ex(("localhost", port)):
                time.sleep(0.1)
            browser.resize(*WIDE)
            browser.open(f"http://localhost:{port}")
            browser.until(HISTORY)
            take(browser, target, "live")
            with Monitor(domain) as monitor:
                monitor.look(1.0)
                console = Console(record=True, width=80, height=24, file=sys.stderr)
                console.print(screen(monitor.look(1.0), time.monotonic()))
            page = scratch / "monitor.html"
            page.write_text(console.export_svg(title="./irsbot monitor"), encoding="utf-8")
            browser.resize(1000, 670)
            browser.open(page)
            browser.resize(1000, int(browser.run("document.querySelector('svg').getBoundingClientRect().bottom")) + 8)
            browser.picture(target / "page_monitor.png", whole=False)
            smaller(target / "page_monitor.png")
        finally:
            suite.send_signal(signal.SIGINT)
            suite.wait(60)


def take(browser: Browser, target: Path, name: str) -> None:
    """One page as it opens: wide and narrow, light and dark."""
    for kind, size in (("wide", WIDE), ("narrow", NARROW)):
        for scheme in ("light", "dark"):
            browser.resize(*size)
            browser.prefer(scheme)
            browser.run("dispatchEvent(new Event('resize'))")
            browser.settle()
            time.sleep(0.5)  # a live page draws its next frames in the new colours
            file = target / f"page_{name}_{kind}_{scheme}.png"
            browser.picture(file, whole=False)
            smaller(file)


def smaller(file: Path) -> None:
    Image.open(file).convert("RGB").quantize(256).save(file, optimize=True)


if __name__ == "__main__":
    main()
