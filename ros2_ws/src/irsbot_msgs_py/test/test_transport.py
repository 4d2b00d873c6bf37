"""Which transport is asked for, from the environment alone. That Fast DDS heeds it is shown in test_shell.py."""

from __future__ import annotations

import pytest

from irsbot_msgs_py.transport import LOCALHOST, without_shared_memory

FAST = "rmw_fastrtps_cpp"
ON_THIS_MACHINE = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def after(before: dict[str, str], middleware: str = FAST) -> dict[str, str]:
    environment = dict(before)
    without_shared_memory(environment, middleware)
    return environment


def test_udp_is_asked_for_by_its_name():
    assert after({}) == {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}


def test_on_one_machine_a_profile_stands_in_for_the_range_that_brings_shared_memory():
    said = after(ON_THIS_MACHINE)
    assert said["ROS_AUTOMATIC_DISCOVERY_RANGE"] == "SYSTEM_DEFAULT"
    assert said["FASTRTPS_DEFAULT_PROFILES_FILE"] == str(LOCALHOST)
    assert "127.0.0.1" in LOCALHOST.read_text()


def test_peers_that_the_user_names_are_kept():
    said = {**ON_THIS_MACHINE, "ROS_STATIC_PEERS": "10.0.0.1"}
    assert after(said) == {**said, "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}


@pytest.mark.parametrize(
    "chosen", [{"FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}, {"FASTRTPS_DEFAULT_PROFILES_FILE": "mine.xml"}]
)
def test_what_the_user_has_chosen_stays(chosen: dict[str, str]):
    said = {**ON_THIS_MACHINE, **chosen}
    assert after(said) == said


def test_other_middleware_is_left_alone():
    assert after(ON_THIS_MACHINE, "rmw_cyclonedds_cpp") == ON_THIS_MACHINE
