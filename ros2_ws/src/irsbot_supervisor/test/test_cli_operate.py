"""What an operator's commands refuse before they ask anybody."""

from __future__ import annotations

from pathlib import Path

import pytest
from command import irsbot


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (["set"], "Missing argument"),
        (["set", "nonsense", "1"], "no setting 'nonsense'"),
        (["set", "type1_stop"], "type1_stop needs a value, got none"),
        (["set", "type1_stop", "0.1", "0.2"], "type1_stop needs one value"),
        (["set", "type1_stop", "much"], "type1_stop must be numbers, got 'much'"),
        (["set", "joint_names", "a"], "joint_names is read at the start alone"),
        (["reset", "1"], "Missing option"),
        (["reset", "1", "--by", " ", "--because", "x"], "--by and --because"),
        (["reset", "1", "--by", "Ann", "--because", "x", "--seed-pose", "0.3,here"], "--seed-pose must be numbers"),
        (["send", "velocity", "0.1", "fast"], "velocities must be numbers, got 'fast'"),
        (["send", "velocity", "nan"], "velocities must be finite"),
        (["send", "velocity", "0.1", "--seconds", "0"], "--seconds is 0, must be above 0"),
        (["send", "trajectory", "nofile.csv"], "the motion 'nofile.csv' does not exist"),
        (["send", "trajectory", "moving.csv"], "moving.csv: the last row must be at rest"),
        (["verdict", "--domain", "500"], "Invalid value for '--domain'"),
    ],
)
def test_bad_use_is_refused_in_one_line(
    words: list[str], stated: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("moving.csv").write_text("time_s,a,a_velocity\n0,0,0\n1,1,1\n")
    done = irsbot(*words)
    assert done.code == 2
    assert done.refusal.startswith(f"irsbot: {stated}")
