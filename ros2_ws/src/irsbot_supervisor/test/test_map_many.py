"""Maps of several robots: a file and its figures each, the same on any cluster, gone on with after an interruption."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command import irsbot
from dask_processes import dask_cluster

import irsbot_kinematics

ROBOTS = ("irsbot2", "irsbot2_beta45", "five_bar")
SMALL = ("--nodes", 20, "--format", "npz")


def numbers(folder: Path) -> dict[str, dict[str, list[float]]]:
    """Arrays of the files of a folder; an archive has times in it."""
    return {
        file.name: {name: np.nan_to_num(values).tolist() for name, values in np.load(file).items()}
        for file in folder.glob("*.npz")
    }


def test_maps_do_not_depend_on_the_number_of_workers_and_are_those_of_one_robot(tmp_path: Path) -> None:
    said = [irsbot("map", *ROBOTS, *SMALL, "-o", tmp_path / str(n), "--workers", n, "--json") for n in (1, 2)]
    assert [one.code for one in said] == [0, 0], said[0].err
    assert numbers(tmp_path / "1") == numbers(tmp_path / "2")
    rows = json.loads(said[0].out)["maps"]
    assert [row["robot"] for row in rows] == list(ROBOTS)
    for row in rows:
        alone = tmp_path / f"{row['robot']}.npz"
        stated = json.loads(irsbot("map", row["robot"], "--nodes", 20, "-o", alone, "--json").out)
        assert stated["reached_area"] == row["reached_area"] > 0.0
        kept = np.load(tmp_path / "1" / row["file"])
        assert np.array_equal(np.load(alone)["type2"], kept["type2"], equal_nan=True)


def test_a_map_that_is_there_is_not_drawn_again(tmp_path: Path) -> None:
    folder = tmp_path / "maps"
    assert irsbot("map", *ROBOTS[:2], *SMALL, "-o", folder, "--workers", 1).code == 0
    times = {file: file.stat().st_mtime_ns for file in folder.iterdir()}
    done = irsbot("map", *ROBOTS[:2], *SMALL, "-o", folder, "--scheduler", "tcp://127.0.0.1:1")
    assert done.code == 0, "no cluster was asked"
    assert "2 of 2 maps are in" in done.out
    next(folder.glob("irsbot2-*.json")).unlink()
    assert irsbot("map", *ROBOTS[:2], *SMALL, "-o", folder, "--workers", 1).code == 0
    changed = [file.suffix for file, time in times.items() if file.stat().st_mtime_ns != time]
    assert sorted(changed) == [".json", ".npz"]


def test_a_map_whose_figures_are_spoilt_is_drawn_again(tmp_path: Path) -> None:
    words = ("map", *ROBOTS[:2], *SMALL, "-o", tmp_path / "maps", "--workers", 1)
    assert irsbot(*words).code == 0
    file = next((tmp_path / "maps").glob("irsbot2-*.json"))
    figures = file.read_text()
    for spoilt in ("", "[]", "{}", '{"robot": "irsbot2", "lines": 1}', "[" * 100_000):
        file.write_text(spoilt)
        done = irsbot(*words)
        assert done.code == 0, done.err
        assert file.read_text() == figures


def test_pictures_are_drawn_on_a_cluster_of_other_processes(tmp_path: Path) -> None:
    mine = tmp_path / "mine.yaml"
    mine.write_bytes((Path(irsbot_kinematics.__file__).parent / "presets" / "irsbot2.yaml").read_bytes())
    with dask_cluster() as (address, _scheduler, _nanny):
        words = ("--nodes", 20, "-o", tmp_path / "maps", "--scheduler", address)
        done = irsbot("map", "irsbot2", mine, *words)
    assert done.code == 0, done.err
    pictures = sorted((tmp_path / "maps").glob("*.png"))
    assert [picture.name.partition("-")[0] for picture in pictures] == ["irsbot2", "mine"]
    assert all(picture.read_bytes().startswith(b"\x89PNG") for picture in pictures)


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("irsbot2", "five_bar", "-o", "x.png"), "2 maps need a folder"),
        (("irsbot2", "five_bar", "-o", "x", "--format", "jpg"), "must be png, svg, pdf or npz"),
        (("irsbot2", "five_bar", "-o", "x", "--scheduler", "here"), "tcp://host"),
        (("irsbot2", "-o", "x", "--scheduler", "tcp://a:1", "--workers", 2), "--workers is for this machine"),
    ],
)
def test_what_cannot_be_done_is_one_sentence(
    words: tuple[object, ...], why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    done = irsbot("map", *words)
    assert done.code == 2
    assert why in done.refusal
    assert list(tmp_path.iterdir()) == []


def test_a_robot_without_such_a_map_fails_alone(tmp_path: Path) -> None:
    done = irsbot("map", "irsbot2", "rrr3", *SMALL, "-o", tmp_path / "maps", "--workers", 1)
    assert done.code == 2
    assert "1 of 2 maps could not be drawn" in done.refusal
    assert [file.name.partition("-")[0] for file in (tmp_path / "maps").glob("*.npz")] == ["irsbot2"]
