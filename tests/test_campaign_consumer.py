"""The short version of tests/campaigns/consumer_outages.py."""

from __future__ import annotations

import os
import runpy
from pathlib import Path

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

pytestmark = pytest.mark.ros

CAMPAIGN = Path(__file__).parent / "campaigns" / "consumer_outages.py"


CASES = [
    ("supervisor", "freeze"),
    ("supervisor", "kill"),
    ("simulated_joints", "freeze"),
    ("kinematics", "kill"),
    ("recorder", "freeze"),
    ("controller", "freeze"),
    ("controller", "restart"),
]


def test_whichever_process_is_lost_the_consumer_brakes_in_time_and_forgets_old_commands() -> None:
    # raises where motion does not end, or does not begin again
    before = dict(os.environ)
    found = runpy.run_path(str(CAMPAIGN))["run"](1, CASES)
    assert {case: [outage.unsafe for outage in outages] for case, outages in found.items()} == {
        case: [""] for case in CASES
    }
    assert dict(os.environ) == before
