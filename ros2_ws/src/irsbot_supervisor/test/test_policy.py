"""Every comparison with a threshold as a table: at the limit, beside it, and for NaN, which is never good."""

from __future__ import annotations

from math import inf, nan, nextafter

import pytest
from supervised import settings_of

from irsbot_kinematics import Status
from irsbot_msgs_py.records import Cause, Finding, Level
from irsbot_supervisor.core.assessment import Assessment
from irsbot_supervisor.core.estimation.estimate import Estimate, Speeds
from irsbot_supervisor.core.margins import MARGIN_CAUSES, margins_of
from irsbot_supervisor.core.policy import Policy
from irsbot_supervisor.core.reaction import OBSERVABLE

LIMITS = {
    **{"type1_warn": 0.3, "type1_stop": 0.2, "type2_warn": 0.4, "type2_stop": 0.1},
    **{"constraint_warn": 0.06, "constraint_stop": 0.04, "limb_warn": 0.5, "limb_stop": 0.25},
    **{"hysteresis": 0.1, "velocity_limit": [3.0, 5.0], "reaction_limit_n": 100.0},
}
SETTINGS, ROBOT = settings_of(**LIMITS)
WARN, STOP = (0.3, 0.4, 0.06, 0.5), (0.2, 0.1, 0.04, 0.25)
AT = ROBOT.mechanism.posture(tuple(ROBOT.inverse((0.0, -0.85)).tolist()), -1)
GOOD = (0.9, 0.9, 0.9, inf)
"""Margins far above all limits; no limb has one."""

assert AT.status == Status.SOLVED


def judge(
    certified=GOOD,
    now=GOOD,
    *,
    velocity=(0.0, 0.0),
    degraded="",
    branch="",
    held=0,
    reaction=(0.0, 0.0),
    at=AT,
    steady_s=inf,
    **changes,
) -> list[Finding]:
    settings = settings_of(**{**LIMITS, **changes})[0] if changes else SETTINGS
    still = Speeds((0.0, 0.0), (0.0, 0.0))
    estimate = Estimate(1, 1, 1, AT.joints, velocity, (), still, 0.0, 0.0, steady_s, 0.0, 0.0, degraded)
    return Policy(settings, ROBOT.mechanism.joints).judge(
        estimate, Assessment(at, now, branch), certified, reaction, held
    )


def only(findings: list[Finding]) -> Finding:
    assert len(findings) == 1, findings
    return findings[0]


def with_value(kind: int, value: float) -> tuple[float, ...]:
    return tuple(value if i == kind else other for i, other in enumerate(GOOD))


# --- margins ----------------------------------------------------------------------------------------------------


def below(value: float) -> float:
    return nextafter(value, -inf)


@pytest.mark.parametrize("kind", range(4))
def test_a_floor_is_graded_against_warn_and_stop(kind):
    warn, stop = WARN[kind], STOP[kind]
    table = [
        (inf, None),
        (warn, None),
        (below(warn), Level.WARN),
        (0.5 * (warn + stop), Level.WARN),
        (stop, Level.WARN),
        (below(stop), Level.STOP),
        (0.0, Level.STOP),
        (-inf, Level.STOP),
        (nan, Level.STOP),
    ]
    for certified, level in table:
        findings = judge(with_value(kind, certified))
        assert [finding.level for finding in findings] == ([level] if level is not None else []), certified
        for finding in findings:
            assert finding.cause == MARGIN_CAUSES[kind] | Cause.BRAKING  # the robot itself is still far away
            assert finding.limit == (warn if level == Level.WARN else stop)
            assert finding.value == certified or finding.value != finding.value


@pytest.mark.parametrize("kind", range(4))
@pytest.mark.parametrize("share", [0.999, 0.5, 0.0, nan])
def test_a_margin_that_is_itself_below_its_limit_is_named_with_its_own_value(kind, share):
    now = STOP[kind] * share
    finding = only(judge(with_value(kind, now), with_value(kind, now)))
    assert (finding.cause, finding.level, finding.limit) == (MARGIN_CAUSES[kind], Level.STOP, STOP[kind])
    assert finding.value == now or now != now


def test_a_margin_between_its_limits_that_will_fall_below_stop_is_a_matter_of_braking():
    finding = only(judge(with_value(0, 0.19), with_value(0, 0.25)))
    assert (finding.cause, finding.level, finding.value) == (Cause.TYPE1 | Cause.BRAKING, Level.STOP, 0.19)


def test_every_margin_that_is_not_good_is_a_finding_of_its_own():
    findings = judge((0.25, nan, 0.05, 0.1), (0.25, 0.9, 0.9, 0.1))
    assert [(finding.cause, finding.level) for finding in findings] == [
        (Cause.TYPE1, Level.WARN),
        (Cause.TYPE2 | Cause.BRAKING, Level.STOP),
        (Cause.CONSTRAINT | Cause.BRAKING, Level.WARN),
        (Cause.LIMB, Level.STOP),
    ]


@pytest.mark.parametrize("kind", range(4))
def test_a_warning_ends_above_the_limit_where_it_began(kind):
    warn = WARN[kind]
    release = warn * 1.1
    held = int(MARGIN_CAUSES[kind])
    for certified, expected in [(warn, 1), (below(release), 1), (release, 0), (inf, 0)]:
        assert len(judge(with_value(kind, certified), held=held)) == expected, certified
        assert judge(with_value(kind, certified), held=0) == []
        assert judge(with_value(kind, certified), held=int(Cause.STALE | Cause.SPEED)) == []
    lingering = only(judge(with_value(kind, warn), held=held))
    assert (lingering.cause, lingering.level, lingering.limit) == (
        MARGIN_CAUSES[kind],
        Level.WARN,
        pytest.approx(release),
    )


def test_a_held_cause_makes_no_bad_margin_good():
    for certified in (nan, 0.0):
        assert only(judge(with_value(1, certified), held=int(Cause.TYPE2))).level == Level.STOP


# --- motion -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", [0, 1])
def test_a_joint_faster_than_its_limit_is_reported(joint):
    limit = (3.0, 5.0)[joint]
    for rate, told in [(0.0, 0), (limit, 0), (-limit, 0), (limit * 1.001, 1), (-limit * 1.001, 1), (inf, 1)]:
        velocity = tuple(rate if i == joint else 0.0 for i in range(2))
        findings = judge(velocity=velocity)
        assert len(findings) == told, rate
        for finding in findings:
            assert (finding.cause, finding.level, finding.limit) == (Cause.SPEED, Level.WARN, limit)
            assert f"joint_{joint + 1}" in finding.text
            assert finding.unit == "rad/s"
            assert finding.text.endswith(f"rad/s, limit {limit:g}")


def test_soon_after_a_silence_only_where_the_robot_is_is_known():
    """For twice `stale_s`; what the robot would meet until it stands nobody can say then."""
    nothing, low = (0.0,) * 4, with_value(0, 0.1)
    for steady_s in (0.0, below(0.1), nan):
        found = only(judge(nothing, steady_s=steady_s, stale_s=0.05))
        assert (found.cause, found.level, found.limit, found.unit) == (Cause.STALE, Level.UNKNOWN, 0.1, "s")
        beyond = judge(nothing, low, steady_s=steady_s, stale_s=0.05)
        assert [(one.cause, one.level) for one in beyond] == [
            (Cause.STALE, Level.UNKNOWN),
            (Cause.TYPE1, Level.STOP),
        ]
    assert judge(steady_s=0.1, stale_s=0.05) == []
    assert {one.level for one in judge(nothing, steady_s=0.1, stale_s=0.05)} == {Level.STOP}


def test_derived_rates_are_a_warning_and_no_rates_at_all_are_no_knowledge():
    assert only(judge(degraded="why")) == Finding(
        Cause.DEGRADED, Level.WARN, pytest.approx(nan, nan_ok=True), pytest.approx(nan, nan_ok=True), "", "why"
    )
    for unknown in ((nan, nan), (nan, 0.0), (0.0, nan)):
        (finding,) = [one for one in judge(velocity=unknown, degraded="why") if one.cause == Cause.DEGRADED]
        assert (finding.level, finding.text) == (Level.UNKNOWN, "why")
    assert only(judge(velocity=(nan, nan), degraded="why")).cause == Cause.DEGRADED


# --- branch and assembly ----------------------------------------------------------------------------------------


def test_a_branch_that_is_not_known_is_no_knowledge_beside_everything_else():
    findings = judge(with_value(1, 0.05), branch="lost")
    assert [(finding.cause, finding.level) for finding in findings] == [
        (Cause.BRANCH, Level.UNKNOWN),
        (Cause.TYPE2 | Cause.BRAKING, Level.STOP),
    ]


@pytest.mark.parametrize("status", [Status.UNREACHABLE, Status.SINGULAR, Status.INVALID])
@pytest.mark.parametrize("gap", [-0.02, 0.0, nan])
def test_joints_without_a_pose_are_unknown(status, gap):
    at = AT._replace(status=status, gaps=(gap, nan))
    finding = only(judge(GOOD, at=at))  # even with a prediction that promises everything
    assert (finding.cause, finding.level) == (Cause.NOT_ASSEMBLED, Level.UNKNOWN)
    assert (finding.value, finding.limit, finding.unit) == (pytest.approx(gap, nan_ok=True), 0.0, "m")
    assert [finding.cause for finding in judge(None, at=at, branch="lost")] == [Cause.NOT_ASSEMBLED, Cause.BRANCH]


# --- reactions --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("word", "level"), [("none", None), ("warn", Level.WARN), ("stop", Level.STOP)])
def test_a_leg_force_is_graded_by_its_setting(word, level):
    table = [(0.0, 0), (100.0, 0), (-100.0, 0), (100.1, 1), (-100.1, 1), (inf, 1), (nan, 1)]
    for force, found in table:
        findings = judge(reaction=(0.0, force), reaction_check=word)
        assert [finding.level for finding in findings] == ([level] * found if level is not None else []), force
        assert all(finding.cause == Cause.REACTION and "leg 2" in finding.text for finding in findings)


def test_near_type_1_a_force_that_cannot_be_observed_is_left_to_the_type_1_margin():
    """Dividing by a sine of less than 0.1 tells nothing: the force is NaN by design there, and not for lack of data."""
    for sine, found in [(0.9 * OBSERVABLE, 0), (OBSERVABLE, 1), (nan, 1)]:
        findings = judge(reaction=(0.0, nan), at=AT._replace(normalised_levers=(0.9, sine)), reaction_check="stop")
        assert len(findings) == found, sine


# --- margins of a posture ---------------------------------------------------------------------------------------


def test_the_worst_leg_counts_and_what_a_robot_does_not_have_cannot_fall():
    at = AT._replace(normalised_levers=(-0.2, 0.7), cos_pressure=(0.6, 0.5), constraint=nan, limb=())
    assert margins_of(at) == (0.2, 0.5, inf, inf)
    assert margins_of(at._replace(constraint=0.3, limb=(0.8, 0.1))) == (0.2, 0.5, 0.3, 0.1)


# --- values -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_values_of_rates_and_forces_are_sizes(sign):
    speed = only(judge(velocity=(sign * 4.0, 5.0)))
    assert (speed.value, speed.limit, speed.unit) == (4.0, 3.0, "rad/s")
    force = only(judge(reaction=(sign * 250.0, 0.0), reaction_check="warn"))
    assert (force.value, force.limit, force.unit) == (250.0, 100.0, "N")
    assert f"{sign * 250.0:.1f}" in force.text


def test_a_force_that_is_not_known_is_given_as_no_number():
    assert "nan" not in only(judge(reaction=(nan, 0.0), reaction_check="warn")).text


@pytest.mark.parametrize(("certified", "stated"), [(0.0, False), (0.05, True)])
def test_a_finding_until_standstill_states_what_is_certified_if_anything_is(certified, stated):
    assert (f"{certified:.4f}" in only(judge(with_value(1, certified))).text) is stated


@pytest.mark.parametrize(("expected_s", "stated"), [(0.01, False), (0.123, True)])
def test_a_finding_until_standstill_states_when_the_next_sample_is_judged_if_that_is_late(expected_s, stated):
    """Later than a heartbeat, 10 ms."""
    estimate = Estimate(
        1, 1, 1, AT.joints, (0.0, 0.0), (), Speeds((0.0,) * 2, (0.0,) * 2), 0.2, expected_s, inf, 0.0, 0.0
    )
    policy = Policy(SETTINGS, ROBOT.mechanism.joints)
    (finding,) = policy.judge(estimate, Assessment(AT, GOOD, ""), with_value(1, 0.05), (), 0)
    assert (f"{1e3 * expected_s:.0f} ms" in finding.text) is stated


@pytest.mark.parametrize(
    ("certified", "kind"), [((0.12, 0.09, 0.5, 0.9), 0), ((0.3, 0.3, 0.03, 0.9), 2), ((0.9, 0.9, inf, 0.2), 3)]
)
def test_late_samples_are_named_with_the_margin_that_lacks_most(certified, kind):
    """Not the smallest: the one that is farthest below its own stop limit."""
    estimate = Estimate(1, 1, 1, AT.joints, (0.0, 0.0), (), Speeds((0.0,) * 2, (0.0,) * 2), 0.2, 0.1, inf, 0.0, 0.0)
    finding = Policy(SETTINGS, ROBOT.mechanism.joints).rare(estimate, certified)
    assert (finding.cause, finding.level) == (Cause.STALE, Level.UNKNOWN)
    assert (finding.value, finding.limit) == (certified[kind], STOP[kind])
