"""Skeletons of mechanisms: they say what is missing, and keep every law once their equations are filled in."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from command import IRSBOT

PRR3 = Path(__file__).parents[1] / "docs" / "examples" / "prr3" / "prr3.py"

NEAR_END = """\
        (ox, oy), a = self.origins[leg], self.directions[leg]
        ux, uy = cos(a) + 0.0 * joint, sin(a) + 0.0 * joint
        return (ox + joint * ux, oy + joint * uy), (ux, uy), (0.0 * joint, 0.0 * joint)
"""
INVERSE = """\
        x, y, phi = pose
        c, s = k.cos(phi), k.sin(phi)
        joints, reach = [], []
        legs = zip(self.origins, self.directions, self.corners, self.rods, mode, strict=True)
        for (ox, oy), a, (bx, by), l, w in legs:
            ux, uy = cos(a), sin(a)
            dx, dy = x + c * bx - s * by - ox, y + s * bx + c * by - oy
            h = k.abs(ux * dy - uy * dx)
            joints.append(dx * ux + dy * uy + w * k.safe_sqrt((l - h) * (l + h)))
            reach.append(l - h)
        return tuple(joints), tuple(reach)
"""
DIRECT = """\
        l1, l2, l3 = self.rods
        c1, c2, c3 = [self.near_end(k, leg, joint)[0] for leg, joint in enumerate(joints)]
        b = self.corners[2][0]
        (x, y), slack, apart = _meet(k, c1, l1, c2, l2, 1 if assembly > 0 else -1)
        (bx, by), slack_b, apart_b = _meet(k, (x, y), b, c3, l3, 1 if abs(assembly) == 1 else -1)
        return (x, y, k.atan2(by - y, bx - x)), (k.minimum(slack, slack_b), k.minimum(apart, apart_b))
"""
RAILS = """\
        e = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        starts = ((-g.size, 0.0, 0.0), (0.0, -g.size, 0.0), (0.0, 0.0, -g.size))
        return tuple(RailInSpace(start, way) for start, way in zip(starts, e, strict=True))
"""


def irsbot(*words: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*IRSBOT, *map(str, words)], capture_output=True, text=True, timeout=280)


def filled(file: Path, **bodies: str) -> None:
    """Put bodies in place of what raises NotImplementedError."""
    lines = []
    for line in file.read_text().splitlines(keepends=True):
        (name,) = [name for name in bodies if f'NotImplementedError("{name}:' in line] or [""]
        lines.append(bodies[name] if name else line)
    text = "".join(lines)
    assert "NotImplementedError" not in text
    file.write_text(text)


@pytest.mark.parametrize("platform", ["planar", "spatial"])
def test_a_skeleton_names_the_missing_equation(platform: str, tmp_path: Path) -> None:
    assert irsbot("new-mechanism", "Mine", "--platform", platform, "--out", tmp_path).returncode == 0
    done = irsbot("check-mechanism", tmp_path / "mine.yaml")
    assert done.returncode in (1, 2)
    assert "NotImplementedError: " in done.stderr
    assert "Traceback" not in done.stderr


def test_a_planar_skeleton_keeps_the_laws_with_its_equations(tmp_path: Path) -> None:
    """The equations are those of the 3-PRR of the documentation, whose bounds are written by hand."""
    assert irsbot("new-mechanism", "Mine", "--legs", 3, "--platform", "planar", "--out", tmp_path).returncode == 0
    file = tmp_path / "mine.py"
    filled(file, near_end=NEAR_END, inverse=INVERSE, direct=DIRECT)
    source = PRR3.read_text()
    meet = source[source.index("def _meet(") : source.index("def _less(")]
    text = file.read_text().replace("from typing import", "from math import cos, sin\nfrom typing import")
    text = text.replace("self.assembly_modes = (1, -1)", "self.assembly_modes = (1, -1, 2, -2)")
    file.write_text(f"{text}\n\nTINY = 1e-200\n\n\n{meet}")
    done = irsbot("check-mechanism", tmp_path / "mine.yaml", "--joints", 40)
    assert done.returncode == 0, done.stdout + done.stderr


def test_a_spatial_skeleton_keeps_the_laws_with_its_rails(tmp_path: Path) -> None:
    assert irsbot("new-mechanism", "Mine", "--platform", "spatial", "--out", tmp_path).returncode == 0
    filled(tmp_path / "mine.py", _rails=RAILS)
    done = irsbot("check-mechanism", tmp_path / "mine.yaml", "--joints", 150)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (["mine"], "'mine' is no name of a class"),
        (["Mine", "--legs", "7"], "there is no skeleton of a planar platform with 7 legs"),
        (["Mine", "--platform", "round"], "there is no skeleton of a round platform"),
    ],
)
def test_bad_use_is_refused_in_one_line(words: list[str], stated: str, tmp_path: Path) -> None:
    done = irsbot("new-mechanism", *words, "--out", tmp_path)
    assert done.returncode == 2
    (line,) = done.stderr.strip().splitlines()
    assert stated in line
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_never_replaced_without_force(tmp_path: Path) -> None:
    (tmp_path / "mine.yaml").write_text("mine")
    assert irsbot("new-mechanism", "Mine", "--out", tmp_path).returncode == 2
    assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [("mine.yaml", "mine")]
