"""The short version of tests/campaigns/consumer_outages.py."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

pytest.importorskip("irsbot_msgs", reason="needs ROS 2 and the built workspace")

pytestmark = [
    pytest.mark.ros,
    # rclpy reads .idl files with a version of lark that still imports this module
    pytest.mark.filterwarnings("ignore:module 'sre_:DeprecationWarning"),
]

CAMPAIGN = Path(__file__).parent / "campaigns" / "consumer_outages.py"


def test_a_consumer_brakes_whenever_its_supervisor_is_frozen_or_killed_and_goes_on_anew() -> None:
    # raises where motion does not end, or begins again without having ended
    found = runpy.run_path(str(CAMPAIGN))["run"](1, ("freeze", "kill"))
    assert {how: len(delays) for how, delays in found.items()} == {"freeze": 1, "kill": 1}
