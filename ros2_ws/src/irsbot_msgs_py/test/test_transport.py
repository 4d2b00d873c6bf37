"""Which transport is asked for, from the environment alone. That Fast DDS heeds it is shown in test_shell.py."""

from __future__ import annotations

from pathlib import Path

import pytest

from irsbot_msgs_py.process.fastdds import LOCALHOST, NETWORK, choose_transport

ON_THIS_MACHINE = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}


def after(before: dict[str, str], middleware: str = "rmw_fastrtps_cpp") -> dict[str, str]:
    environment = dict(before)
    choose_transport(environment, middleware)
    return environment


def test_in_the_network_the_range_is_the_users_and_the_profile_ours():
    stated = {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
    assert after(stated) == {**stated, "FASTRTPS_DEFAULT_PROFILES_FILE": NETWORK}
    assert after({}) == {"FASTRTPS_DEFAULT_PROFILES_FILE": NETWORK}


def test_on_one_machine_a_profile_stands_in_for_the_range_that_brings_shared_memory():
    stated = after(ON_THIS_MACHINE)
    assert stated == {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SYSTEM_DEFAULT", "FASTRTPS_DEFAULT_PROFILES_FILE": LOCALHOST}
    assert "127.0.0.1" in Path(LOCALHOST).read_text()


@pytest.mark.parametrize("more", [{}, ON_THIS_MACHINE, {"ROS_STATIC_PEERS": "10.0.0.1"}])
def test_the_older_word_for_one_machine_brings_no_shared_memory_either(more: dict[str, str]):
    assert after({"ROS_LOCALHOST_ONLY": "1", **more}) == after(ON_THIS_MACHINE)  # the others do not count


@pytest.mark.parametrize("word", ["0", "", "true"])
def test_another_value_of_the_older_word_means_nothing(word: str):
    assert after({"ROS_LOCALHOST_ONLY": word}) == {"ROS_LOCALHOST_ONLY": word, **after({})}


def test_our_transport_of_a_process_does_not_count_as_the_users_choice_for_its_children():
    assert after({**after({}), **ON_THIS_MACHINE}) == after(ON_THIS_MACHINE)
    assert after(after(ON_THIS_MACHINE)) == after(ON_THIS_MACHINE)


def test_peers_that_the_user_names_are_kept():
    stated = {**ON_THIS_MACHINE, "ROS_STATIC_PEERS": "10.0.0.1"}
    assert after(stated) == {**stated, "FASTRTPS_DEFAULT_PROFILES_FILE": NETWORK}


@pytest.mark.parametrize(
    "chosen", [{"FASTDDS_BUILTIN_TRANSPORTS": "DEFAULT"}, {"FASTRTPS_DEFAULT_PROFILES_FILE": "mine.xml"}]
)
def test_the_users_transport_is_kept(chosen: dict[str, str]):
    stated = {**ON_THIS_MACHINE, "ROS_LOCALHOST_ONLY": "1", **chosen}
    assert after(stated) == stated


def test_other_middleware_is_left_alone():
    assert after(ON_THIS_MACHINE, "rmw_cyclonedds_cpp") == ON_THIS_MACHINE
