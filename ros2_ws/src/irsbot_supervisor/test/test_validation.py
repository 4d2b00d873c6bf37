"""Samples are accepted by name, finite and in time, or rejected for a reason; never is anything guessed."""

from __future__ import annotations

from math import inf, nan, pi

import pytest
from supervised import JOINTS, MS, sample, settings_of

from irsbot_msgs_py.records import Cause, JointSample
from irsbot_supervisor.core.validation import Accepted, Intake, Rejected

Q = (0.4, 2.7)
V = (1.0, -2.0)
TAU = (3.0, 4.0)


def intake(**changes) -> Intake:
    settings, robot = settings_of(**changes)
    return Intake(settings, robot.mechanism.joints)


def cause(answer: Accepted | Rejected) -> Cause:
    assert isinstance(answer, Rejected), f"accepted: {answer}"
    return answer.cause


# --- names ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "order"),
    [
        (("joint_1", "joint_2"), (0, 1)),
        (("joint_2", "joint_1"), (1, 0)),
        (("gripper", "joint_2", "camera", "joint_1"), (3, 1)),
        (("joint_1", "wheel", "wheel", "joint_2"), (0, 3)),  # only names that nobody asks for are doubled
    ],
)
def test_joints_are_picked_by_name_in_any_order_among_other_joints(names, order):
    values = tuple(float(i) for i in range(len(names)))
    accepted = intake().check(JointSample(10**12, 10**12, 1, names, values, values, values))
    assert isinstance(accepted, Accepted)
    assert accepted.position == accepted.velocity == accepted.effort == order


def test_an_order_that_changes_from_one_message_to_the_next_is_followed():
    door = intake()
    for ms, names, values in ((1, JOINTS, Q), (2, JOINTS[::-1], Q[::-1]), (3, JOINTS, Q)):
        answer = door.check(sample(ms, values, names=names))
        assert isinstance(answer, Accepted)
        assert answer.position == Q


@pytest.mark.parametrize(
    ("names", "values"),
    [
        ((), ()),  # nothing at all, and as the very first message
        ((), Q),
        (("joint_1",), (0.4,)),
        (("joint_1", "joint_3"), Q),
        (("Joint_1", "joint_2"), Q),
        (("joint_1", "joint_1", "joint_2"), (0.4, 0.4, 2.7)),
        (("joint_1", "joint_2", "joint_2"), (0.4, 2.7, 2.7)),
        (("joint_1", "joint_2", "joint_3"), Q),  # an array shorter than the names
        (("joint_1", "joint_2"), (0.4, 2.7, 1.0)),
        (("joint_1", "joint_2"), ()),
    ],
)
@pytest.mark.parametrize("first", [True, False])
def test_a_message_without_one_position_for_every_joint_is_rejected_for_its_names(names, values, first):
    door = intake()
    if not first:
        assert isinstance(door.check(sample(0, Q)), Accepted)
    assert cause(door.check(sample(1, values, (), names=names))) == Cause.NAMES


@pytest.mark.parametrize(("velocity", "effort"), [((1.0,), ()), ((), (1.0,)), ((1.0, 2.0, 3.0), ())])
def test_velocities_and_efforts_come_for_all_joints_or_not_at_all(velocity, effort):
    assert cause(intake().check(sample(1, Q, velocity, effort=effort))) == Cause.NAMES
    accepted = intake().check(sample(1, Q, ()))
    assert isinstance(accepted, Accepted)
    assert accepted.velocity == accepted.effort == ()


def test_names_learned_once_do_not_let_a_bad_message_pass():
    door = intake()
    assert isinstance(door.check(sample(1, Q)), Accepted)
    assert cause(door.check(sample(2, (0.4,), names=("joint_1",)))) == Cause.NAMES
    answer = door.check(sample(3, Q[::-1], names=JOINTS[::-1]))
    assert isinstance(answer, Accepted)
    assert answer.position == Q


# --- positions --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("joint", [0, 1])
@pytest.mark.parametrize(
    ("value", "reason"),
    [
        (nan, Cause.NONFINITE),
        (inf, Cause.NONFINITE),
        (-inf, Cause.NONFINITE),
        (1e308, Cause.IMPLAUSIBLE),
        (-1.1e6, Cause.IMPLAUSIBLE),
    ],
)
def test_a_position_that_is_no_position_is_rejected(joint, value, reason):
    position = tuple(value if i == joint else q for i, q in enumerate(Q))
    assert cause(intake().check(sample(1, position))) == reason


@pytest.mark.parametrize("value", [0.0, -0.0, 5e-324, -3.2, 40.0, 1e6])
def test_a_finite_position_is_accepted(value):
    assert isinstance(intake().check(sample(1, (value, 2.7))), Accepted)


def test_a_joint_that_is_not_configured_may_be_anywhere():
    accepted = intake().check(sample(1, (nan, *Q), names=("gripper", *JOINTS)))
    assert isinstance(accepted, Accepted)
    assert accepted.position == Q


# --- stamps -----------------------------------------------------------------------------------------------------

AGES_MS = [
    # the shipped limits: 50 ms in the past, 20 ms in the future
    (0.0, True),
    (49.9, True),
    (50.1, False),
    (1e4, False),
    (3.15e11, False),  # ten years
    (-19.9, True),
    (-20.1, False),
    (-1e4, False),
    (-3.15e11, False),
]


@pytest.mark.parametrize(("age_ms", "fresh"), AGES_MS)
def test_a_stamp_must_fit_the_clock_of_the_receiver(age_ms, fresh):
    answer = intake().check(sample(1, Q, age_ms=age_ms))
    assert isinstance(answer, Accepted) if fresh else cause(answer) == Cause.STAMP


@pytest.mark.parametrize("stamp_ns", [0, -1, -(10**9)])
def test_a_stamp_of_zero_or_less_is_rejected_even_at_the_beginning_of_time(stamp_ns):
    early = JointSample(stamp_ns, stamp_ns, 10**9, JOINTS, Q)
    assert cause(intake().check(early)) == Cause.STAMP


def test_only_a_stamp_of_zero_is_called_so():
    for stamp_ns, what in ((0, "the stamp is zero"), (1, "the stamp is 10.000 s old")):
        answer = intake().check(JointSample(stamp_ns, 10**10, 10**10, JOINTS, Q))
        assert isinstance(answer, Rejected)
        assert answer.text == what


def straggler(answer: Accepted | Rejected) -> bool:
    return isinstance(answer, Rejected) and answer.cause == Cause.STAMP and answer.harmless


def test_repeated_and_overtaken_samples_are_passed_over_without_alarm():
    door = intake()
    assert isinstance(door.check(sample(10, Q)), Accepted)
    assert straggler(door.check(sample(11, Q, age_ms=1)))  # the same stamp
    assert straggler(door.check(sample(12, Q, age_ms=7)))  # an older one
    assert isinstance(door.check(sample(13, Q)), Accepted)


@pytest.mark.parametrize("away", [0.05, -0.05, 1.0, 1e5])
def test_two_places_at_the_same_stamp_are_a_contradiction(away):
    """12 rad/s make 45 mrad of three periods at a quarter more than full speed."""
    door = intake()
    for ms in (9, 10):
        assert isinstance(door.check(sample(ms, Q)), Accepted)
    answer = door.check(sample(11, (Q[0], Q[1] + away), age_ms=1))
    assert isinstance(answer, Rejected)
    assert (answer.cause, answer.harmless) == (Cause.IMPLAUSIBLE, False)
    assert f"'{JOINTS[1]}' is in two places, " in answer.text
    assert isinstance(door.check(sample(12, Q)), Accepted), "the first of both is believed until somebody jumps"


@pytest.mark.parametrize("behind_ms", [2, 15])
def test_two_publishers_with_a_constant_difference_of_stamps_are_a_contradiction(behind_ms):
    door = intake()
    for ms in (98, 99, 100):
        assert isinstance(door.check(sample(ms, Q)), Accepted)
    far = 15.0 * (behind_ms + 3) * 1e-3 + 1e-3  # rad: 12 rad/s, a quarter more, for the time between and three periods
    assert straggler(door.check(sample(100.5, (Q[0] + 0.8 * far, Q[1]), age_ms=behind_ms + 0.5)))
    answer = door.check(sample(101, (Q[0] + 1.2 * far, Q[1]), age_ms=behind_ms + 1))
    assert cause(answer) == Cause.IMPLAUSIBLE


def test_a_joint_that_passes_half_a_turn_while_stamps_repeat_themselves_is_in_one_place():
    door = intake()
    assert isinstance(door.check(sample(1, (pi - 1e-3, Q[1]))), Accepted)
    assert straggler(door.check(sample(1.5, (1e-3 - pi, Q[1]), age_ms=0.5)))


def test_a_clock_that_stamps_coarsely_repeats_itself_while_the_robot_moves():
    door = intake()
    for ms in range(40):
        answer = door.check(sample(ms, (Q[0] + 0.012 * ms, Q[1]), age_ms=ms % 10))  # full speed, new stamps every 10 ms
        assert isinstance(answer, Accepted) if ms % 10 == 0 else straggler(answer)


def test_a_rejected_sample_does_not_move_the_newest_stamp():
    door = intake()
    assert isinstance(door.check(sample(10, Q)), Accepted)
    assert cause(door.check(sample(11, Q, age_ms=-1000))) == Cause.STAMP  # from the future
    assert cause(door.check(sample(12, (nan, 0.0)))) == Cause.NONFINITE
    assert isinstance(door.check(sample(11.5, Q)), Accepted)


def test_a_clock_that_was_set_back_is_accepted_once_nothing_newer_comes():
    door = intake(stale_s=0.05, age_limit_s=0.2)
    assert isinstance(door.check(sample(0, Q)), Accepted)
    answers = [door.check(sample(ms, Q, age_ms=100)) for ms in range(1, 60)]
    assert all(straggler(answer) for answer in answers[:50])  # 1 to 50 ms
    assert all(isinstance(answer, Accepted) for answer in answers[50:])


def test_a_stamp_that_is_only_repeated_never_becomes_news():
    door = intake(stale_s=0.05, age_limit_s=0.2)
    assert isinstance(door.check(sample(0, Q)), Accepted)
    for ms in range(1, 200):  # a driver that hangs and sends its last message again
        assert straggler(door.check(sample(ms, Q, age_ms=ms)))


def test_new_limits_apply_at_once_and_earlier_samples_are_kept():
    door = intake(age_limit_s=0.2)
    assert isinstance(door.check(sample(10, Q)), Accepted)
    door.configure(settings_of(age_limit_s=0.05)[0])
    assert cause(door.check(sample(70, Q, age_ms=51))) == Cause.STAMP
    assert straggler(door.check(sample(15, Q, age_ms=6)))


def test_times_and_values_are_handed_on_unchanged():
    given = sample(7, Q, V, age_ms=3, effort=TAU)
    answer = intake().check(given)
    assert answer == Accepted(given.stamp_ns, given.stamp_ns + 3 * MS, given.seen_ns, Q, V, TAU)


# --- limits to the digit ----------------------------------------------------------------------------------------


def timed(stamp_ns: int, received_ns: int, position: tuple[float, ...] = Q) -> JointSample:
    return JointSample(stamp_ns, received_ns, received_ns, JOINTS, position, (), ())


def test_the_first_stamp_of_a_simulated_time_is_accepted_and_zero_is_none():
    assert isinstance(intake().check(timed(1, 1)), Accepted)
    assert cause(intake().check(timed(0, 1))) == Cause.STAMP


def test_a_simulated_time_may_begin_again_with_its_first_nanosecond():
    door = intake()
    assert isinstance(door.check(timed(10**10, 10**10)), Accepted)
    assert isinstance(door.check(timed(1, 1)._replace(seen_ns=2 * 10**10)), Accepted)


def test_a_stamp_of_the_future_is_refused_while_a_simulated_time_has_only_begun():
    """Both together are still less than the age limit, 50 ms."""
    assert cause(intake().check(timed(30 * MS, 5 * MS))) == Cause.STAMP


@pytest.mark.parametrize(
    ("stamp_ns", "received_ns", "stated"),
    [(1, 10**9, "1.000"), (10**12, 10**12 + 300 * MS, "0.300"), (10**12, 10**12 - 300 * MS, "0.300")],
)
def test_a_refused_stamp_is_given_with_its_distance_from_now(stamp_ns, received_ns, stated):
    answer = intake().check(timed(stamp_ns, received_ns))
    assert cause(answer) == Cause.STAMP
    assert f" {stated} s" in answer.text


@pytest.mark.parametrize(("far", "accepted"), [(1e6, True), (1e6 + 0.5, False)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_position_is_at_most_a_million(far, accepted, sign):
    answer = intake().check(timed(10**12, 10**12, (0.0, sign * far)))
    assert isinstance(answer, Accepted) is accepted
    assert accepted or cause(answer) == Cause.IMPLAUSIBLE
