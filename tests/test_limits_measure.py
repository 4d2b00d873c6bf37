"""`irsbot limits --measure`: times of this computer, whatever they are, are settings that can be used."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import pytest
import yaml
from command import IRSBOT, PATIENCE_S

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

from irsbot_supervisor.configuration.loading import PARAMETERS, read_settings

pytestmark = [pytest.mark.ros, pytest.mark.slow]

TIMES = ["stale_s", "heartbeat_s", "latency_s", "bounding_s", "judging_s"]


def test_the_measured_times_are_settings_with_which_a_sample_is_judged_in_time(tmp_path: Path) -> None:
    written = tmp_path / "mine.yaml"
    command = [*IRSBOT, "limits", "five_bar", "--measure", "--seconds", "1", "--json", "-o", written]
    done = subprocess.run(command, capture_output=True, text=True, timeout=2.0 * PATIENCE_S)
    found = {one["name"]: one for one in json.loads(done.stdout)}
    assert list(found) == TIMES
    shipped, _robot = read_settings("five_bar")
    for name, one in found.items():
        assert one["now"] == getattr(shipped, name)
        assert one["met"] > 0.0
        assert one["value"] >= one["now"]
    missed = [name for name, one in found.items() if not one["kept"]]
    assert (done.returncode, bool(missed)) in ((0, False), (1, True))
    assert all(f"{name} of" in done.stderr for name in missed)
    values = yaml.safe_load(written.read_text(encoding="utf-8"))["/**"][PARAMETERS]
    assert values == {name: one["value"] for name, one in found.items()}
    assert values["bounding_s"] >= found["bounding_s"]["met"]
    assert values["judging_s"] <= values["stale_s"]
    assert replace(shipped, bounding_s=values["bounding_s"], judging_s=values["judging_s"]).has_time_for(0)
