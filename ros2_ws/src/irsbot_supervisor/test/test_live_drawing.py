"""What the live page draws, in a headless Chromium: put together frame by frame it shows what a whole picture would."""

from __future__ import annotations

import json
from collections.abc import Iterator
from math import pi, sin
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import PROGRAM, Browser

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.description.robot_record import robot_record
from irsbot_kinematics.mechanism import Status
from irsbot_supervisor.live.scene import COLUMNS, drawn
from irsbot_supervisor.live.server import page
from irsbot_supervisor.replay.series import MARGINS

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="needs Chromium: apt install chromium")

SILENT = "<script>WebSocket = class { static OPEN = 1; readyState = 1; asked = 0; send() { this.asked++; } };</script>"
"""A server that says nothing: the tests say it."""

HZ = 31
GOOD = (0.0, -0.85)
LIMITS = [{"of": MARGINS[1], "kind": "stop", "value": 0.4}]
"""In the colour of the second line."""


PLOTTED = """(line) => {
    const canvas = element("margins"), at = Sizes.get(canvas), { left, right } = frame(at.width, at.em);
    const dots = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
    const probe = document.createElement("canvas").getContext("2d");
    probe.fillStyle = style(line).colour;
    probe.fillRect(0, 0, 1, 1);
    const colour = [...probe.getImageData(0, 0, 1, 1).data].slice(0, 3), found = [];
    for (let x = Math.ceil(left) + 4; x < Math.floor(right) - 1; x++) {
        let ends = null;
        for (let y = 0; y < canvas.height; y++) {
            const k = 4 * (y * canvas.width + x);
            const alike = dots[k + 3] > 128 && colour.every((part, i) => Math.abs(dots[k + i] - part) < 60);
            if (alike) ends = [ends ? ends[0] : y, y];
        }
        found.push(ends);
    }
    return found;
}"""


@pytest.fixture(scope="module")
def view() -> dict[str, Any]:
    robot = irs.make_robot("irsbot2")
    return drawn(robot_record(robot), robot.mechanism.usual_working_mode, GOOD)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("b") / "p") as one:
        yield one


@pytest.fixture
def opened(browser: Browser, view: dict[str, Any], tmp_path: Path) -> Browser:
    file = tmp_path / "live.html"
    file.write_text(page().replace("<script>", f"{SILENT}<script>", 1), encoding="utf-8")
    browser.prefer("light")
    browser.resize(1400, 900)
    browser.open(file)
    browser.run("Live.socket.onopen()")
    tell(browser, [], 0.0, {"robot": "irsbot2", "columns": COLUMNS, "limits": LIMITS, "view": view})
    return browser


def row(t: float, margins: list[float], **other: Any) -> list[Any]:
    """A row as the feed tells it: of four margins and the smallest until standstill."""
    known: list[float | None] = [*margins, None, None, None, None, None]
    low, high = list(known[: len(COLUMNS)]), list(known[: len(COLUMNS)])
    low[0] = other.get("low", low[0])
    return [t, other.get("level", "OK"), known[: len(COLUMNS)], other.get("pose", list(GOOD)), low, high]


def tell(browser: Browser, rows: list[list[Any]], t: float, setup: dict[str, Any] | None = None) -> None:
    """A frame for each row, each drawn; without rows one frame."""
    now = {
        "level": "OK",
        "verdict": None,
        "silent": False,
        "verdict_hz": 100,
        "state_hz": 1000,
        "box": [],
        "joints": {},
    }
    frames = [{"now": {**now, "t": one[0]}, "rows": [one]} for one in rows] or [{"now": {**now, "t": t}, "rows": []}]
    if setup:
        frames[0]["setup"] = setup
    browser.run(
        f"for (const one of {json.dumps(frames)}) {{ ask(); hear(one); show(); }}cancelAnimationFrame(Live.drawing)"
    )


def plotted(browser: Browser, line: int) -> list[list[float] | None]:
    """For each column of dots of the margins' plot, the highest and the lowest dot of a line, counted from the top."""
    # The sizes of the last picture: `sized` would wipe the canvas where the page is about to measure it again.
    found: list[list[float] | None] = browser.run(f"({PLOTTED})({line})")
    return found


def test_a_dip_between_two_frames_reaches_its_depth(opened: Browser) -> None:
    """At a height that follows from two margins which are drawn plainly."""
    times = [k / HZ for k in range(1, 8 * HZ)]
    tell(opened, [row(t, [0.8, 0.4], low=0.1 if k == 6 * HZ else 0.8) for k, t in enumerate(times)], 0.0)
    high, low = (plotted(opened, line) for line in (0, 1))
    at = {value: np.median([sum(ends) / 2 for ends in found if ends]) for value, found in ((0.8, high), (0.4, low))}
    expected = at[0.4] + (0.4 - 0.1) / (0.8 - 0.4) * (at[0.4] - at[0.8])
    deepest = max(range(len(high)), key=lambda x: high[x][1] if high[x] else 0)
    assert high[deepest][1] == pytest.approx(expected, abs=2.5)
    seconds = (len(high) - deepest) / len(high) * 30.0
    assert seconds == pytest.approx(times[-1] - times[6 * HZ], abs=0.2)
    assert sum(ends[1] > at[0.4] for ends in high if ends) <= 4  # one dip, and nothing beside it


def test_a_picture_put_together_shows_what_a_whole_one_does(opened: Browser) -> None:
    """Over more than the length of the roll, with a gap, and a line that stays in its place while time passes."""
    times = [k / HZ for k in range(1, 50 * HZ)]
    known = [t for t in times if not 40.0 < t < 42.0]
    tell(opened, [row(t, [0.6 + 0.2 * sin(2 * pi * t / 7.0)]) for t in known], 0.0)
    together = plotted(opened, 0)
    opened.run("Live.frameAt = performance.now(); Roll.key = Ground.key = ''; show()")
    whole = plotted(opened, 0)
    assert len(together) == len(whole) > 300
    ends = [(a, b) for a, b in zip(together, whole, strict=True) if a and b]
    assert sum((a is None) != (b is None) for a, b in zip(together, whole, strict=True)) <= 2
    assert max(abs(a[i] - b[i]) for a, b in ends for i in (0, 1)) <= 3
    gap = [x for x, one in enumerate(whole) if one is None]
    assert len(gap) == pytest.approx(2.0 / 30.0 * len(whole), abs=3)
    middle = (len(whole) - np.mean(gap)) / len(whole) * 30.0
    assert middle == pytest.approx(times[-1] - 41.0, abs=0.2)


def test_the_path_of_the_last_seconds_is_drawn_and_an_older_one_is_gone(opened: Browser) -> None:
    first, later = [[x, z + 0.1] for x in (-0.2, -0.15) for z in (-0.8, -0.75)], [0.2, -0.8]
    rows = [row(k / HZ, [0.5], pose=first[k % 4]) for k in range(1, 3 * HZ)]
    rows += [row(k / HZ, [0.5], pose=later) for k in range(3 * HZ, 20 * HZ)]
    tell(opened, rows, 0.0)
    shown = f"""(() => {{ const canvas = element("view"), [x, y] = View.to({json.dumps(first[0])});
        return [...canvas.getContext("2d").getImageData(Math.round(x), Math.round(y), 1, 1).data]; }})()"""
    before = opened.run(shown)
    tell(opened, [row(k / HZ, [0.5], pose=later) for k in range(20 * HZ, 36 * HZ)], 0.0)
    opened.run("Live.frameAt = performance.now(); Ground.drawn = -Infinity; show()")
    after = opened.run(shown)
    assert before[3] == 255
    assert before != after
    assert after[3] < 128  # nothing is drawn there


def test_colours_follow_the_theme(opened: Browser) -> None:
    tell(opened, [row(k / HZ, [0.5]) for k in range(1, 5 * HZ)], 0.0)
    light = opened.run("style(0).colour")
    opened.prefer("dark")
    opened.until(f"style(0).colour !== '{light}'")
    opened.run("Live.frameAt = performance.now(); show()")
    assert sum(one is not None for one in plotted(opened, 0)) > 50
    (swatch,) = opened.run("[...document.querySelectorAll('#legend i')].map((one) => one.style.borderTop)")
    assert light not in swatch


def test_nothing_of_the_page_is_written_again_that_has_not_changed(opened: Browser) -> None:
    tell(opened, [row(k / HZ, [0.5], level="WARN" if k % 7 else "OK") for k in range(1, 2 * HZ)], 0.0)
    written = opened.run(
        """new Promise((done) => {
        const seen = [], watch = new MutationObserver((all) => seen.push(...all.map((one) => one.target.nodeName)));
        watch.observe(document, { subtree: true, childList: true, attributes: true, characterData: true });
        Live.frameAt = performance.now(); show(); Live.frameAt = performance.now(); show();
        setTimeout(() => done(seen.filter((name) => name !== "CANVAS")), 0); })"""
    )
    assert written == []
    assert opened.errors == []


def test_a_page_asks_again_with_the_last_frame_it_was_promised_and_ages_each_by_its_time(opened: Browser) -> None:
    now = {"level": "OK", "silent": False, "verdict_hz": 100, "state_hz": 1000, "joints": {}}
    found = opened.run(
        f"""(() => {{ const found = [], now = {json.dumps(now)}, asked = Live.socket.asked;
        Live.askedAt = performance.now() - 600; Live.firstT = null;
        for (const [t, left] of [[5, 2], [5.4, 1], [5.5, 0]]) {{
            hear({{ now: {{ ...now, t }}, rows: [], left }});
            found.push([present(), Live.socket.asked - asked]);
        }}
        return found; }})()"""
    )
    assert found == [[False, 0], [True, 0], [True, 1]]


def test_loci_of_a_robot_in_space_are_drawn_as_a_section_that_says_where_it_is(opened: Browser) -> None:
    robot = irs.make_robot("orthoglide")
    at = next(at for at in Machine(robot, 20, 11).postures if at.status == Status.SOLVED)
    shown = drawn(robot_record(robot), at.working_mode, at.pose)
    rows = [row(k / HZ, [0.5], pose=list(at.pose)) for k in range(1, 5)]
    tell(opened, rows, 0.0, {"robot": "orthoglide", "columns": COLUMNS, "limits": [], "view": shown})
    assert f"section at z = {at.pose[2]:.4g} m" in opened.run("element('view-legend').textContent")
    type1 = [point for locus in shown["loci"] if locus["kind"] == "type1" for point in locus["points"]]
    for turn in ([-0.6, 0.5], [0.4, 1.2]):
        seen = opened.run(
            f"""(() => {{ View.turn = {turn}; Ground.place = null; Live.frameAt = performance.now(); show();
            const pen = element("view").getContext("2d"), data = {{ view: Live.view }};
            const at = (p) => View.to(flat(data, p)).map(Math.floor);
            return {json.dumps(type1)}.map((p) => pen.getImageData(...at(p), 1, 1).data[3]); }})()"""
        )
        assert len(seen) > 50
        assert np.mean(np.array(seen) > 60) > 0.95
