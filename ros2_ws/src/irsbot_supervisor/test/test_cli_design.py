"""`irsbot design`: exit codes, one line for bad input, numbers as JSON, pictures, tables of sweeps."""

from __future__ import annotations

import csv
import json
from math import pi

import matplotlib.image
import numpy as np
import polars as pl
import pytest

import irsbot_kinematics as irs
from irsbot_supervisor.bag.column_stream import write_chunks

EXAMPLE = {"a1": 0.3, "a2": 0.05, "beta": pi / 4, "p": 0.04, "l2eq": 0.15}
"""[S0] (71), whose zones Figs. 17 and 18 show."""
COMMANDS = ("check", "cells", "zones", "postures", "sweep", "search")


@pytest.fixture
def irsbot(irsbot):
    """Runs `irsbot design ...`."""
    return lambda *words: irsbot("design", *words)


def settings(**lengths):
    return [word for name, value in lengths.items() for word in ("--set", f"{name}={value!r}")]


def example(l1, b):
    return settings(**EXAMPLE, l1=l1, b=b)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself_with_an_example(irsbot, command):
    code, out, _ = irsbot(command, "--help")
    assert code == 0
    assert f"Example: irsbot design {command}" in out


def test_a_free_design_passes_and_one_that_is_not_fails_with_the_questions_that_fail(irsbot):
    assert irsbot("check", "irsbot2_strict")[0] == 0
    code, out, err = irsbot("check", "irsbot2")
    assert code == 1
    assert err.strip().splitlines() == ["irsbot: irsbot2 is not free (Z_wps_strict: free in all modes): equal, C1a"]
    assert "NOT free" in out
    assert "0.0145678 against" in out


def test_a_check_of_one_mode_on_one_side(irsbot):
    assert irsbot("check", "irsbot2", "--mode", "+-", "--below")[0] == 0
    assert irsbot("check", "irsbot2", "--mode", "+-")[0] == 1
    assert irsbot("check", "irsbot2", "--mode", "-+", "--below")[0] == 1
    assert irsbot("check", "irsbot2_beta45", "--mode", "+-", "--below")[0] == 1


def test_a_check_as_json_holds_verdict_reason_and_nearest_bound(irsbot):
    code, out, _ = irsbot("check", "irsbot2_strict", "--json")
    stated = json.loads(out)
    assert code == 0
    assert stated["free"] is True
    assert stated["geometry"]["l1"] == 0.2
    assert stated["nearest"][0]["parameter"] == "b"
    assert stated["nearest"][0]["then"] == pytest.approx(0.46 - 0.29528471273 + 0.2, abs=1e-9)
    assert {question["name"] for question in stated["questions"] if question["needed"]} >= {"equal", "opposite", "C1a"}
    assert all(mode["free"] for mode in stated["modes"])


@pytest.mark.parametrize(("l1", "b", "exact"), [(0.1, 0.05, False), (0.1, 0.25, True), (0.05, 0.35, True)])
def test_the_zones_of_the_papers_example(irsbot, l1, b, exact):
    code, out, _ = irsbot("zones", "irsbot2", *example(l1, b), "--json")
    stated = json.loads(out)
    assert code == 0
    assert stated["seats"]["I1"]["centre_m"] == pytest.approx(0.3394, abs=5e-5)
    assert stated["seats"]["I2"]["height_m"] ** 2 == pytest.approx(0.0103, abs=5e-5)
    assert stated["zones"]["wps"] == {"exact": exact, "printed": True}


def test_the_papers_example_that_cannot_be_assembled_is_refused(irsbot):
    code, _, err = irsbot("zones", "irsbot2", *example(0.05, 0.01))
    assert code == 2
    assert "|b0| <= l1 + l2eq (assembly), got 0.242132034 against 0.2" in err


def test_zones_say_where_the_printed_answer_differs(irsbot):
    _, out, _ = irsbot("zones", "irsbot2", *example(0.1, 0.05))
    assert "(45), (76)" in out


def test_cells_mark_the_design(irsbot):
    code, out, _ = irsbot("cells", "irsbot2_csc", "--json")
    stated = json.loads(out)
    assert code == 0
    assert [cell["name"] for cell in stated["p"] if cell["here"]] == ["]p4, p5["]
    assert [cell["counts"]["I"] for cell in stated["l2eq"] if cell["here"]] == [2]
    assert "]l2eq2, l2eq1[ *" in irsbot("cells", "irsbot2_csc")[1]


def test_postures_as_json_are_those_of_the_sheet(irsbot):
    code, out, _ = irsbot("postures", "irsbot2_csc", "--json")
    first = json.loads(out)["postures"][0]
    assert code == 0
    assert first["kind"] == "I"
    assert first["psi"] == pytest.approx([-0.739433441, 2.402159212], abs=5e-9)
    assert first["placements"][1]["pose"] == pytest.approx([0.106562932, -0.189123749], abs=5e-9)


@pytest.mark.parametrize("command", ["cells", "zones", "postures"])
def test_pictures_are_drawn(irsbot, tmp_path, command):
    path = tmp_path / "picture.png"
    code, out, err = irsbot(command, "irsbot2_csc", "-o", path)
    assert (code, err) == (0, "")
    assert f"written: {path}" in out.replace("\n", "")
    pixels = matplotlib.image.imread(path)[:, :, :3]
    assert min(pixels.shape[:2]) > 400
    assert len(np.unique((pixels[::5, ::5] * 255).astype(int).reshape(-1, 3), axis=0)) > 20
    assert 0.3 < np.mean(np.all(pixels > 0.99, axis=2)) < 0.98


def test_a_design_without_postures_has_nothing_to_draw(irsbot, tmp_path):
    bulky = settings(a1=0.5, a2=0.05, beta=1.2, p=0.5, l2eq=0.1, l1=0.3, b=1.0)
    code, _, err = irsbot("postures", "irsbot2", *bulky, "-o", tmp_path / "none.png")
    assert code == 1
    assert "no constraint-singular posture" in err


# --- sweeps ---


def test_a_grid_becomes_a_table_with_one_row_per_design(irsbot, tmp_path):
    path = tmp_path / "grid.csv"
    words = ["sweep", "--vary", "l1=0.1:0.5:5", "--vary", "beta=10deg:60deg:3", "-o", path, "--json"]
    code, out, _ = irsbot(*words)
    assert code == 0
    with path.open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == json.loads(out)["designs"] == 15
    assert float(rows[2]["beta"]) == pytest.approx(pi / 3)
    assert sum(row["zone_strict"] == "true" for row in rows) == json.loads(out)["zone_strict"]
    assert list(tmp_path.iterdir()) == [path]


def test_random_designs_go_to_parquet_chunk_by_chunk(irsbot, tmp_path):
    path = tmp_path / "many.parquet"
    words = ["--vary", "l1=0.05:0.5", "--vary", "b=0.05:0.6", "--vary", "p=0.01:0.1", "--samples", 120_000]
    code, out, _ = irsbot("sweep", *words, "--seed", 2, "-o", path, "--json")
    assert code == 0
    table = pl.read_parquet(path)
    assert len(table) == json.loads(out)["designs"] == 120_000
    assert table["valid"].all()
    assert not table["slack_equal"].is_nan().any()
    assert table["zone_wps"].sum() == json.loads(out)["zone_wps"] > 0


def test_an_interrupted_table_leaves_nothing_behind(tmp_path):
    def chunks():
        yield {"a": np.arange(3)}
        raise KeyboardInterrupt

    for name in ("table.csv", "table.parquet"):
        with pytest.raises(BaseException):  # noqa: B017, PT011 - what the writer makes of it is its affair
            write_chunks(tmp_path / name, chunks())
    assert list(tmp_path.iterdir()) == []


# --- search ---


def test_a_search_writes_a_robot_that_passes_the_check(irsbot, tmp_path):
    path = tmp_path / "free.yaml"
    quick = ["--generations", 4, "--population", 3, "--slack", 0.01]
    code, out, _ = irsbot("search", *quick, "-o", path, "--json")
    stated = json.loads(out)
    assert code == 0
    assert stated["found"]["slack_m"] >= 0.01
    assert stated["irsbot2_strict"]["slack_m"] == pytest.approx(0.0952847, abs=1e-6)
    robot = irs.load_robot(path)
    assert robot.mechanism.geometry.l1 == stated["found"]["geometry"]["l1"]
    assert irsbot("check", path)[0] == 0


def test_a_search_in_ranges_without_a_free_design_fails(irsbot):
    code, _, err = irsbot("search", "--slack", 0.4, "--generations", 2, "--population", 3)
    assert code == 1
    assert "no design of these ranges" in err


# --- bad input ---


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (["check", "irsbot2", "--set", "a2=0.5"], "a1 > a2, got 0.42 against 0.5"),
        (["check", "irsbot2", "--set", "beta=0"], "beta > 0, got 0"),
        (["check", "irsbot2", "--set", "beta=90deg"], "beta < pi/2, got 1.57079633 against 1.57079633"),
        (["check", "irsbot2", "--set", "l1=-1"], "l1 > 0, got -1"),
        (["check", "irsbot2", "--set", "l1=nan"], "l1 must be finite, got nan"),
        (["check", "irsbot2", "--set", "b=9"], "(assembly), got 8.87706777 against 1.2"),
        (["check", "irsbot2", "--set", "b=0.12293223462010961"], "|b0| >"),
        (["check", "five_bar"], "'five_bar' is a five_bar"),
        (["check", "nothing"], "no robot 'nothing'"),
        (["check", "irsbot2", "--set", "b"], "must be name=value"),
        (["check", "irsbot2", "--set", "b=x"], "b must be numbers, got 'x'"),
        (["check", "irsbot2", "--zone", "q"], "no zone 'q'"),
        (["check", "irsbot2", "--below"], "--below needs --mode"),
        (["check", "irsbot2", "--mode", "x"], "a row of + and -"),
        (["check", "irsbot2", "--mode", "+-+"], "modes are +-, -+, ++, --, got '+-+'"),
        (["zones", "irsbot2", "-o", "x.txt"], "suffix must be .png"),
        (["zones", "irsbot2", "-o", "/dev/null/x.png"], "/dev/null: "),
        (["sweep", "-o", "x.csv"], "nothing to vary"),
        (["sweep", "--vary", "l1=0.1:0.5", "-o", "x.csv"], "must be low:high:steps"),
        (["sweep", "--vary", "l1=0.5:0.1:3", "-o", "x.csv"], "low <= high, got 0.5 against 0.1"),
        (["sweep", "--vary", "l1=0.1:0.5:2.5", "-o", "x.csv"], "steps must be a whole number, got 2.5"),
        (["sweep", "--vary", "l1=0.1:0.5:3", "-o", "x.xls"], "suffix must be .csv or .parquet"),
        (["sweep", "--vary", "l1=0.1:0.5:3", "-o", "/dev/null/x.csv"], "/dev/null: "),
        (
            ["sweep", "--vary", "l1=0.1:0.5:3", "--vary", "l1=0.2:0.3:3", "--samples", 9, "-o", "x.csv"],
            "has a --vary already",
        ),
        (["sweep", "--vary", "l1=0.1:0.5:3", "--set", "l1=0.2", "-o", "x.csv"], "it has a --set already"),
        (["sweep", "--vary", "l1=0.1:0.5:1", "-o", "x.csv"], "one step has no room for 0.1 and 0.5"),
        (["search", "--size", "-1"], "size > 0, got -1"),
        (["search", "--seed", "-1"], "seed must be a whole number from 0"),
        (["search", "--seed", "99999999999"], "seed must be a whole number from 0"),
        (["search", "--slack", "-5", "-o", "x.yaml"], "slack >= 0, got -5"),
        (["search", "--type1", "5"], "type1 margin of a useful pose must be in 0..1, got 5"),
        (["search", "--type2", "nan"], "type2 margin of a useful pose must be in 0..1, got nan"),
        (["search", "--generations", "-1"], "generations must be a whole number >= 1"),
        (["search", "--population", "0"], "population must be a whole number >= 1"),
        (["search", "--vary", "l2eq=0.1:0.2"], "got 'l2eq=0.1:0.2'"),
        (["search", "--compare", "five_bar"], "'five_bar' is a five_bar"),
    ],
)
def test_bad_input_ends_with_code_2_and_one_line_with_the_right_form(irsbot, words, stated, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    code, out, err = irsbot(*words)
    assert code == 2
    assert stated in err
    assert len(err.strip().splitlines()) == 1
    assert out == ""
    assert list(tmp_path.iterdir()) == []
