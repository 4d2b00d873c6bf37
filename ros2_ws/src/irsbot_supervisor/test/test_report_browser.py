"""The page in a headless Chromium: it draws, it needs nothing from elsewhere, keys and clicks move the cursor."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import PROGRAM, Browser
from command import irsbot

import irsbot_kinematics as irs
from irsbot_kinematics.conformance.samples import Machine
from irsbot_kinematics.mechanism import Posture, Status
from irsbot_supervisor.report.drawing import view
from irsbot_supervisor.report.json_values import plain

pytestmark = pytest.mark.skipif(PROGRAM is None, reason="needs Chromium: apt install chromium")

BAGS = Path(__file__).resolve().parents[4] / "bags"
SHIFT = 8


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as one:
        yield one


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("page") / "type2.html"
    assert irsbot("report", BAGS / "type2", "-o", target).code == 0
    return target


@pytest.fixture
def opened(browser: Browser, page: Path) -> Browser:
    browser.resize(1400, 900)
    browser.prefer("light")
    browser.open(page)
    return browser


def cursor(browser: Browser) -> float:
    return float(browser.run("document.getElementById('tracks').getAttribute('aria-valuenow')"))


def test_the_page_draws_everything_and_asks_for_nothing(opened: Browser, page: Path) -> None:
    assert opened.errors == []
    assert set(opened.requested) == {page.resolve().as_uri()}
    drawn = """[...document.querySelectorAll('canvas')].map(canvas => {
        const dots = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data;
        return new Set(new Uint32Array(dots.buffer)).size > 3;
    })"""
    assert opened.run(drawn) == [True] * (1 + 1 + len(opened.run("Run.data.tracks")))


def test_the_numbers_on_the_page_are_those_of_the_replay(opened: Browser) -> None:
    stated = json.loads(irsbot("replay", BAGS / "type2", "--json").out)
    tiles = opened.run("[...document.querySelectorAll('.tile')].map(tile => tile.innerText)")
    assert stated["summary"]["verdict"]["worst_at_work"] in tiles[0]
    for one, tile in zip(stated["summary"]["smallest_margins"], tiles[1:], strict=False):
        assert one["margin"] in tile
        assert f"{one['value']:.4f}" in tile
        assert f"{one['time_s']:.3f} s" in tile
    stop = stated["summary"]["stops"][0]
    assert f"{stop['until_rest_s'] * 1e3:.1f} ms" in tiles[-2]
    assert f"{stop['platform_m'] * 1e3:.1f} mm" in tiles[-2]
    rows = opened.run("[...document.querySelectorAll('#tables table')].pop().closest('details') !== null")
    assert rows, "settings are the last table"
    told = opened.run("[...document.querySelectorAll('#tables tbody tr')].map(row => row.innerText)")
    for interval in stated["chapters"]:
        assert any(interval["text"] in row and interval["level"] in row for row in told)


def test_keys_move_the_cursor_and_everything_with_it(opened: Browser) -> None:
    opened.run("document.getElementById('tracks').focus()")
    outline = opened.run("getComputedStyle(document.activeElement).outlineStyle")
    opened.press("Home")
    times = opened.run("Run.data.posture.t")
    assert cursor(opened) == pytest.approx(opened.run("Run.data.span[0]"))
    for _ in range(3):
        opened.press("ArrowRight")
    assert cursor(opened) == pytest.approx(times[3])
    assert opened.run("getComputedStyle(document.activeElement).outlineStyle") != "none" or outline != "none"
    opened.press("ArrowRight", SHIFT)
    assert cursor(opened) == pytest.approx(times[13])
    readout = opened.run("document.querySelectorAll('.track output')[1].textContent")
    assert float(readout) == pytest.approx(opened.run("Run.data.tracks[0].columns[1].values[13]"), abs=1e-3)
    opened.press("n")
    changes = [row["time_s"] for row in opened.run("Run.data.chapters") if row["time_s"] > times[13]]
    assert cursor(opened) == pytest.approx(changes[0])
    opened.press("End")
    assert cursor(opened) == pytest.approx(opened.run("Run.data.span[1]"))


def test_the_mechanism_follows_the_cursor(opened: Browser) -> None:
    shown = "document.getElementById('view').toDataURL()"
    opened.run("moveTo(Run.data.span[0])")
    before = opened.run(shown)
    opened.run("moveTo(Run.data.summary.stops[0].time_s)")
    assert opened.run(shown) != before


def test_clicks_jump_to_a_time_and_drags_zoom(opened: Browser) -> None:
    at = float(opened.run("document.querySelector('#tables button[data-time]').dataset.time"))
    opened.run("moveTo(Run.data.span[0]); document.querySelector('#tables button[data-time]').click()")
    assert cursor(opened) == pytest.approx(at)
    left, top, width, height = opened.run(
        "(({left, top, width, height}) => [left, top, width, height])"
        "(document.querySelector('.track canvas').getBoundingClientRect())"
    )
    opened.click(left + 0.75 * width, top + height / 2)
    span = opened.run("Run.data.span")
    assert cursor(opened) == pytest.approx(span[0] + 0.74 * (span[1] - span[0]), abs=0.04 * (span[1] - span[0]))
    opened.drag([(left + x * width, top + height / 2) for x in (0.4, 0.5, 0.6)], SHIFT)
    window = opened.run("Run.window")
    assert window[1] - window[0] == pytest.approx(0.2 * (span[1] - span[0]), rel=0.2)
    opened.run("document.querySelector('[data-do=all]').click()")
    assert opened.run("Run.window") == pytest.approx(span)


def test_it_is_readable_on_a_telephone_and_in_the_dark(opened: Browser) -> None:
    light = opened.run(
        "getComputedStyle(document.body).color + getComputedStyle(document.documentElement).backgroundColor"
    )
    opened.prefer("dark")
    opened.resize(400, 800)
    opened.settle()
    assert opened.run("document.documentElement.scrollWidth") <= 400
    assert opened.run("parseFloat(getComputedStyle(document.body).fontSize)") >= 13
    dark = opened.run(
        "getComputedStyle(document.body).color + getComputedStyle(document.documentElement).backgroundColor"
    )
    assert dark != light


def test_more_data_can_be_fed_at_any_time(opened: Browser) -> None:
    """What a run that goes on will do."""
    opened.run("moveTo(0.3); setWindow(0.2, 0.5)")
    opened.run("update({...Run.data, summary: {...Run.data.summary, samples: 12345}})")
    assert cursor(opened) == pytest.approx(0.3)
    assert opened.run("Run.window") == pytest.approx([0.2, 0.5])
    assert "12345" in opened.run("[...document.querySelectorAll('.tile')].pop().innerText")


def solved(robot: irs.Robot) -> list[Posture]:
    """Random postures."""
    return [at for at in Machine(robot, 20, 11).postures if at.status == Status.SOLVED]


@pytest.mark.parametrize("name", irs.robots())
def test_the_drawn_platform_is_where_the_platform_is(name: str, opened: Browser) -> None:
    """The page's forward kinematics of the tree, passive joints included, ends at the platform point."""
    robot = irs.make_robot(name)
    skeleton = robot.mechanism.skeleton()
    assert skeleton is not None
    postures = solved(robot)[:5]
    nowhere = np.full((1, len(robot.mechanism.task)), np.nan)
    shown = plain(view(robot.mechanism, robot.mechanism.usual_working_mode, nowhere))
    positions = [
        {one.name: q for one, q in zip(robot.mechanism.joints, at.joints, strict=True)}
        | dict(skeleton.closing(at.joints, at.pose))
        for at in postures
    ]
    posture = {
        "pose": [list(column) for column in zip(*(at.pose for at in postures), strict=True)],
        "joints": {joint: [one[joint] for one in positions] for joint in positions[0]},
    }
    data = json.dumps({"view": shown, "posture": posture})
    for row in range(len(postures)):
        call = f"(data => [bars(data, {row}).filter(bar => bar[2] === 'platform'), point(data, {row})])"
        ends, place = opened.run(f"{call}({data})")
        assert ends
        for begin, _end, _link in ends:
            assert begin == pytest.approx(place, abs=1e-9)
