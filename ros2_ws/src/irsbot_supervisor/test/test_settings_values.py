"""Defaults and ranges of settings as users know them: one that changes would change what robots in operation do."""

from __future__ import annotations

from dataclasses import MISSING, asdict, fields, replace
from re import fullmatch

import pytest
from supervised import settings_of

from irsbot_supervisor.configuration.loading import robot_of
from irsbot_supervisor.core.margins import MARGIN_NAMES
from irsbot_supervisor.core.settings import (
    LEAST_LIMIT,
    OVERSPEED,
    UNLIMITED,
    UNTRUSTED,
    InvalidSettings,
    Settings,
    completed,
    refuse_other_robot,
)

DECLARED = {entry.name: entry for entry in fields(Settings)}
ROBOT = robot_of("irsbot2")
DRIVES = {"velocity_limit": [12.0, 12.0], "deceleration_limit": [400.0, 300.0]}

NUMBERS = {
    **{f"{kind}_warn": (0.25, 0.001, 1.0) for kind in MARGIN_NAMES},
    **{f"{kind}_stop": (0.15, 0.001, 1.0) for kind in MARGIN_NAMES},
    "constraint_warn": (0.05, 0.001, 1.0),
    "constraint_stop": (0.03, 0.001, 1.0),
    "hysteresis": (0.05, 0.0, 1.0),
    "dwell_s": (0.05, 0.0, 10.0),
    "latency_s": (0.01, 0.0, 1.0),
    "stamp_jitter_s": (5e-5, 0.0, 0.1),
    "recovery_share": (0.05, 1e-3, 0.5),
    "command_timeout_s": (0.1, 1e-3, 1.0),
    "stale_s": (0.05, 0.001, 10.0),
    "sample_gap_s": (0.0, 0.0, 10.0),
    "judging_s": (0.0, 0.0, 1.0),
    "bounding_s": (0.0, 0.0, 0.1),
    "heartbeat_s": (0.01, 0.001, 0.02),
    "age_limit_s": (0.05, 0.001, 10.0),
    "future_limit_s": (0.02, 0.0, 10.0),
    "standstill_speed": (0.02, 0.0, 10.0),
    "encoder_resolution": (1e-5, 0.0, 0.1),
    "encoder_offset": (0.0, 0.0, 0.1),
    "geometry_tolerance_m": (0.0, 0.0, 0.1),
    "load_force_n": (10.0, 0.0, 1e6),
    "payload_kg": (0.0, 0.0, 1e4),
    "gravity_m_s2": (9.80665, 0.0, 100.0),  # standard gravity
    "load_moment_nm": (0.0, 0.0, 1e6),
    "platform_acceleration_m_s2": (0.0, 0.0, 1e4),
    "compliance_slack_m": (0.0, 0.0, 0.1),
    "reaction_limit_n": (1000.0, 0.0, 1e9),
}
"""Setting -> default, lowest and highest value."""

OF_JOINTS = {
    "velocity_limit": (1e-6, 1e4),
    "acceleration_limit": (1e-6, 1e6),
    "deceleration_limit": (1e-6, 1e6),
    "position_lower": (-1e6, 1e6),
    "position_upper": (-1e6, 1e6),
    "velocity_tolerance": (0.0, 1e4),
}
"""Setting of every joint -> lowest and highest value."""

READ_ONLY = ("robot", "joint_names", "working_mode", "assembly_mode", "compliance", "tubes")


@pytest.mark.parametrize("name", NUMBERS)
def test_the_default_and_the_range_of_a_number_are_those_that_users_know(name: str) -> None:
    metadata = DECLARED[name].metadata
    assert (DECLARED[name].default, metadata["low"], metadata["high"]) == NUMBERS[name]
    assert not metadata.get("each_joint")


@pytest.mark.parametrize("name", OF_JOINTS)
def test_a_limit_of_every_joint_has_its_range_and_may_be_left_out_if_another_stands_for_it(name: str) -> None:
    metadata = DECLARED[name].metadata
    assert (metadata["low"], metadata["high"]) == OF_JOINTS[name]
    assert metadata["each_joint"]
    assert metadata["optional"] is (name not in ("velocity_limit", "deceleration_limit"))


def test_every_number_is_in_the_tables() -> None:
    assert {name for name, entry in DECLARED.items() if "low" in entry.metadata} == {*NUMBERS, *OF_JOINTS}
    assert all(entry.default is not MISSING for entry in DECLARED.values())


def test_the_bounds_of_meaning_are_those_that_texts_of_settings_state() -> None:
    assert (LEAST_LIMIT, OVERSPEED, UNTRUSTED, UNLIMITED) == (0.001, 1.25, 10_000.0, 1_000_000.0)


# --- read-only ------------------------------------------------------------------------------------------------------

OTHER = {
    "robot": "five_bar",
    "joint_names": ("a", "b"),
    "working_mode": (-1, -1),
    "assembly_mode": 2,
    "compliance": "counted",
    "tubes": "mine",
}


@pytest.mark.parametrize("name", [name for name in DECLARED if name not in READ_ONLY])
def test_a_setting_of_the_supervision_may_change(name: str) -> None:
    settings = settings_of()[0]
    refuse_other_robot(settings, replace(settings, **{name: "another"}))


@pytest.mark.parametrize("name", READ_ONLY)
def test_a_setting_that_says_which_robot_is_supervised_may_not_change(name: str) -> None:
    settings = settings_of()[0]
    refuse_other_robot(settings, replace(settings))
    with pytest.raises(InvalidSettings, match=name):
        refuse_other_robot(settings, replace(settings, **{name: OTHER[name]}))


# --- what is left open ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("left_out", [{}, {"acceleration_limit": []}, {"position_lower": [], "velocity_tolerance": []}])
def test_what_is_left_out_for_joints_becomes_no_limit_or_that_of_the_brakes(left_out: dict[str, object]) -> None:
    settings = completed({**DRIVES, **left_out}, ROBOT)
    assert settings.acceleration_limit == settings.deceleration_limit == (400.0, 300.0)
    assert (settings.position_lower, settings.position_upper) == ((-1e6,) * 2, (1e6,) * 2)
    assert settings.velocity_tolerance == (1e4,) * 2
    assert settings.assembly_mode == ROBOT.mechanism.usual_assembly_mode


def test_what_is_given_for_joints_stays() -> None:
    given = {
        "acceleration_limit": (200.0, 100.0),
        "position_lower": (-1.0, -2.0),
        "position_upper": (3.0, 4.0),
        "velocity_tolerance": (0.0, 0.5),
        "working_mode": tuple(ROBOT.mechanism.working_modes[-1]),
    }
    settings = asdict(completed({**DRIVES, **given}, ROBOT))
    assert {name: settings[name] for name in given} == given


@pytest.mark.parametrize("name", [name for name in OF_JOINTS if DECLARED[name].metadata["optional"]])
def test_what_may_be_left_out_is_checked_if_it_is_given(name: str) -> None:
    with pytest.raises(InvalidSettings, match=name):
        completed({**DRIVES, name: [1.0, 1.0, 1.0]}, ROBOT)
    with pytest.raises(InvalidSettings, match=name):
        completed({**DRIVES, name: [1.0, OF_JOINTS[name][1] * 1.01]}, ROBOT)


@pytest.mark.parametrize("name", ["robot", "tubes", "reaction_check", "type1_stop", "assembly_mode"])
def test_a_list_in_place_of_one_value_is_named(name: str) -> None:
    with pytest.raises(InvalidSettings, match=f"{name} is .* must be one value"):
        completed({**DRIVES, name: [0.2, 0.2]}, ROBOT)


# --- values together ------------------------------------------------------------------------------------------------


def test_times_may_be_as_long_as_the_stale_limit() -> None:
    times = dict.fromkeys(("heartbeat_s", "stale_s", "sample_gap_s", "judging_s"), 0.015)
    assert completed({**DRIVES, **times}, ROBOT).judging_s == 0.015


@pytest.mark.parametrize("low", [[1.0, -1.0], [-1.0, 1.0], [1.5, 1.5]])
def test_every_range_of_positions_has_room(low: list[float]) -> None:
    with pytest.raises(InvalidSettings, match="position_lower"):
        completed({**DRIVES, "position_lower": low, "position_upper": [1.0, 1.0]}, ROBOT)


@pytest.mark.parametrize(("word", "slack_m"), [("none", 0.001), ("counted", 0.003)])
def test_bending_adds_to_the_errors_of_the_geometry_where_it_counts(word: str, slack_m: float) -> None:
    settings = replace(settings_of()[0], geometry_tolerance_m=0.001, compliance_slack_m=0.002, compliance=word)
    assert settings.slack_m == pytest.approx(slack_m)


# --- the hash -------------------------------------------------------------------------------------------------------


def test_the_hash_of_settings_is_sixteen_hexadecimal_digits() -> None:
    assert fullmatch("[0-9a-f]{16}", settings_of()[0].config_hash)


def test_bare_settings_leave_names_and_modes_to_the_robot() -> None:
    bare = Settings()
    assert (bare.joint_names, bare.working_mode, bare.assembly_mode) == ((), (), 0)
