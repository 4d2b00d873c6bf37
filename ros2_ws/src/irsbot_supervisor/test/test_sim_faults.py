"""Every fault does what its name says, when it is told to, and nothing to the rest of the stream."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from math import degrees, inf, isnan
from pathlib import Path

import numpy as np
import pytest

from irsbot_kinematics import make_robot
from irsbot_msgs_py.records import JointSample
from irsbot_supervisor.sim.errors import BadFault
from irsbot_supervisor.sim.faults import FAULTS, FaultInjector, Sent, describe, parse_faults

ROBOT = make_robot("irsbot2")
MS = 1_000_000
BEGIN_NS = 1_700_000_000_000_000_000
NAMES = ("joint_1", "joint_2")


def original(k: int) -> JointSample:
    """Sample k of a stream at 1 kHz: every number tells which sample and which joint it belongs to."""
    now = BEGIN_NS + k * MS
    return JointSample(now, now, now, NAMES, (2.0 + 1e-3 * k, 0.5), (1.0 + k, -1.0 - k), (10.0, 20.0))


def stream(line: str, count: int = 40, seed: int = 0) -> list[list[Sent]]:
    """What is delivered in each period."""
    injector = FaultInjector(parse_faults(line), ROBOT.mechanism, seed)
    return [list(injector.send(original(k))) for k in range(count)]


def only(line: str, count: int = 40) -> list[JointSample]:
    """The delivered samples of a fault that delivers one per period."""
    periods = stream(line, count)
    assert all(len(period) == 1 and period[0].publisher == 0 for period in periods)
    return [period[0].sample for period in periods]


def numbers(periods: Sequence[Sequence[Sent]]) -> list[int]:
    """Which samples arrived, in the order of their arrival."""
    return [round((sent.sample.position[0] - 2.0) * 1e3) for period in periods for sent in period]


# --- when -------------------------------------------------------------------------------------------------------


def test_without_a_fault_the_stream_is_untouched():
    assert only("") == [original(k) for k in range(40)]
    assert only(" ; ") == [original(k) for k in range(40)]


@pytest.mark.parametrize(
    ("line", "hit"),
    [
        ("nan", range(40)),
        ("nan:count=3", range(3)),
        ("nan:at=0.010", range(10, 40)),
        ("nan:at=0.010,count=3", range(10, 13)),
        ("nan:at=0.010,lasting=0.005", range(10, 15)),
        ("nan:at=0.010,every=10", range(10, 40, 10)),
        ("nan:at=0.010,every=10,count=2", range(10, 30, 10)),
        ("nan:lasting=0", range(0)),
        ("nan:count=2; nan:at=0.020,count=2", [0, 1, 20, 21]),
    ],
)
def test_a_fault_acts_at_its_stated_times(line, hit):
    samples = only(line)
    assert [k for k, sample in enumerate(samples) if isnan(sample.position[0])] == list(hit)
    assert all(sample == original(k) for k, sample in enumerate(samples) if k not in hit)


def test_faults_add_up():
    sample = only("sign; degrees; stamp_zero", 1)[0]
    assert sample.position == pytest.approx((-degrees(2.0), degrees(0.5)))
    assert sample.stamp_ns == 0


@pytest.mark.parametrize("name", sorted(FAULTS))
def test_every_fault_leaves_the_stream_as_it_found_it_when_it_is_over(name):
    arrived = stream(f"{name}:at=0.010,lasting=0.010")
    assert arrived[:10] == [[Sent(original(k))] for k in range(10)]
    touched = arrived[10:20] != [[Sent(original(k))] for k in range(10, 20)]
    assert touched or name == "loss"  # 10 samples may all escape a loss of 5 %
    assert [Sent(original(k)) for k in range(21, 40)] == [
        sent for period in arrived[20:] for sent in period if sent.sample.stamp_ns > original(20).stamp_ns
    ]


# --- delivery ---------------------------------------------------------------------------------------------------


def test_dropped_samples_do_not_arrive():
    assert numbers(stream("drop:at=0.010,count=5")) == [*range(10), *range(15, 40)]


def test_random_loss_has_its_share_and_repeats_with_its_seed():
    arrived = numbers(stream("loss:share=0.3", 20_000))
    assert len(arrived) == pytest.approx(14_000, abs=300)  # standard deviation 65
    assert sorted(arrived) == arrived
    assert arrived == numbers(stream("loss:share=0.3", 20_000))
    assert arrived != numbers(stream("loss:share=0.3", 20_000, seed=1))


def test_reordered_samples_change_places_in_pairs():
    assert numbers(stream("reorder:count=4", 8)) == [1, 0, 3, 2, 4, 5, 6, 7]
    assert numbers(stream("reorder:count=3", 6)) == [1, 0, 3, 2, 4, 5]


def test_late_samples_say_when_they_were_taken_and_arrive_later():
    periods = stream("latency:by=0.004", 20)
    assert numbers(periods) == list(range(16))
    assert [len(period) for period in periods] == [0] * 4 + [1] * 16
    sample = periods[10][0].sample
    assert sample.stamp_ns == original(6).stamp_ns
    assert sample.seen_ns == sample.received_ns == original(10).seen_ns


def test_a_flood_sends_more_messages_with_increasing_stamps():
    periods = stream("flood:times=5", 10)
    assert [len(period) for period in periods] == [5] * 10
    stamps = [sent.sample.stamp_ns for period in periods[1:] for sent in period]
    assert np.diff(stamps).tolist() == [MS // 5] * (len(stamps) - 1)
    assert stamps[-1] == original(9).stamp_ns


def test_a_second_publisher_publishes_other_positions():
    first, second = stream("second_publisher:by=0.2", 1)[0]
    assert first == Sent(original(0), publisher=0)
    assert second.publisher == 1
    assert second.sample.position == pytest.approx((2.2, 0.7))


# --- numbers ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("name", "value"), [("inf", inf), ("huge", 1e308), ("denormal", 5e-324)])
def test_numbers_are_replaced(name, value):
    assert only(name, 1)[0].position == (value, value)
    assert only(f"{name}:joint=2", 1)[0].position == (2.0, value)
    assert only(f"{name}:which=effort", 1)[0] == original(0)._replace(effort=(value, value))


def test_nan_can_hit_one_joint_and_one_array():
    sample = only("nan:joint=1,which=velocity", 1)[0]
    assert isnan(sample.velocity[0])
    assert sample.velocity[1:] == (-1.0,)
    assert sample.position == (2.0, 0.5)


# --- names and lengths ------------------------------------------------------------------------------------------


def test_a_missing_joint_is_gone_from_all_arrays():
    sample = only("missing_name:joint=1", 1)[0]
    assert (sample.names, sample.position, sample.effort) == (("joint_2",), (0.5,), (20.0,))


def test_a_joint_can_have_the_name_of_another_robot():
    sample = only("wrong_name:joint=2", 1)[0]
    assert sample.names[0] == "joint_1"
    assert sample.names[1] not in NAMES
    assert sample.position == (2.0, 0.5)


def test_a_joint_can_be_listed_twice():
    sample = only("duplicate_name:joint=1", 1)[0]
    assert (sample.names, sample.position) == (("joint_1", "joint_2", "joint_1"), (2.0, 0.5, 2.0))


def test_extra_joints_come_first():
    sample = only("extra_name:joints=3", 1)[0]
    assert sample.names[3:] == NAMES
    assert len(set(sample.names)) == 5
    assert sample.position == (0.0, 0.0, 0.0, 2.0, 0.5)
    assert len(sample.velocity) == len(sample.effort) == 5


def test_permuted_joints_keep_their_numbers_and_miswired_ones_do_not():
    permuted, miswired = only("permuted", 1)[0], only("miswired", 1)[0]
    assert dict(zip(permuted.names, permuted.position, strict=True)) == {"joint_1": 2.0, "joint_2": 0.5}
    assert permuted.names == ("joint_2", "joint_1")
    assert dict(zip(miswired.names, miswired.position, strict=True)) == {"joint_2": 2.0, "joint_1": 0.5}


@pytest.mark.parametrize(("by", "position"), [(-1, (2.0,)), (-5, ()), (2, (2.0, 0.5, 0.0, 0.0))])
def test_arrays_can_have_the_wrong_length(by, position):
    assert only(f"wrong_length:by={by}", 1)[0] == original(0)._replace(position=position)


# --- stamps -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("by_s", [0.001, 1.0, 315_576_000.0, -10.0])
def test_stamps_can_be_shifted_by_a_millisecond_or_ten_years(by_s):
    sample = only(f"stamp_shift:by={by_s}", 1)[0]
    assert sample == original(0)._replace(stamp_ns=BEGIN_NS + round(by_s * 1e9))


def test_no_shift_leaves_the_range_of_a_stamp():
    assert only("stamp_shift:by=4e9", 1)[0].stamp_ns == (2**31 - 1) * 10**9
    assert only("stamp_shift:by=-4e9", 1)[0].stamp_ns == -(2**31 - 1) * 10**9


def test_stamps_can_be_zero_and_repeated():
    assert only("stamp_zero", 1)[0] == original(0)._replace(stamp_ns=0)
    repeated = only("stamp_repeated:at=0.003,count=3", 8)
    assert [(s.stamp_ns - BEGIN_NS) // MS for s in repeated] == [0, 1, 2, 3, 3, 3, 6, 7]
    assert [s.position for s in repeated] == [original(k).position for k in range(8)]


def test_swapped_stamps_belong_to_the_neighbour():
    periods = stream("stamp_swapped:count=2", 4)
    assert numbers(periods) == [0, 1, 2, 3]
    stamps = [(sent.sample.stamp_ns - BEGIN_NS) // MS for period in periods for sent in period]
    assert stamps == [1, 0, 2, 3]


# --- motion -----------------------------------------------------------------------------------------------------


def test_frozen_numbers_stay_while_stamps_go_on():
    frozen = only("freeze:at=0.005", 10)
    assert all(s == original(k) for k, s in enumerate(frozen[:6]))
    for k, sample in enumerate(frozen[5:], 5):
        assert sample.position == original(5).position
        assert sample.velocity == original(5).velocity
        assert sample.stamp_ns == original(k).stamp_ns
    only_position = only("freeze:at=0.005,which=position", 10)[9]
    assert only_position == original(9)._replace(position=original(5).position)


def test_a_glitch_moves_one_joint_for_one_sample():
    samples = only("glitch:by=0.5,joint=2,at=0.003,count=1", 6)
    assert samples[3].position == pytest.approx((original(3).position[0], 1.0))
    assert [k for k, sample in enumerate(samples) if sample != original(k)] == [3]


def test_drift_grows_from_the_moment_it_begins():
    samples = only("drift:rate=2.0,joint=1,at=0.010", 31)
    off = [sample.position[0] - original(k).position[0] for k, sample in enumerate(samples)]
    assert off[:11] == pytest.approx([0.0] * 11, abs=1e-12)
    assert off[30] == pytest.approx(2.0 * 0.020)


def test_noise_has_its_deviation():
    samples = only("noise:sigma=0.02,which=velocity", 5000)
    off = np.array([np.subtract(sample.velocity, original(k).velocity) for k, sample in enumerate(samples)])
    assert off.std() == pytest.approx(0.02, rel=0.05)
    assert samples[7].position == original(7).position


def test_signs_and_units_can_be_wrong():
    assert only("sign", 1)[0].position == (-2.0, 0.5)
    sample = only("degrees", 1)[0]
    assert sample.position == pytest.approx((degrees(2.0), degrees(0.5)))
    assert sample.velocity == pytest.approx((degrees(1.0), degrees(-1.0)))


@pytest.mark.parametrize("leg", [1, 2])
def test_a_mode_flip_keeps_the_pose_and_flips_one_leg(leg):
    q = tuple(float(value) for value in ROBOT.inverse((0.3, -0.75)) + 2.0 * np.pi)  # in another turn
    injector = FaultInjector(parse_faults(f"mode_flip:leg={leg}"), ROBOT.mechanism)
    (sent,) = injector.send(original(0)._replace(position=q))
    mode = [1, -1]
    mode[leg - 1] *= -1
    there = ROBOT.posture(sent.sample.position, -1)
    # W1 of the model: with (-,-) and (+,+) the rods are almost parallel, both on the side a = -1.
    assert there.pose == pytest.approx((0.3, -0.75), abs=1e-9)
    assert there.working_mode == tuple(mode)
    assert np.abs(np.subtract(sent.sample.position, q)).max() <= np.pi


def test_a_mode_flip_of_nonsense_changes_nothing():
    injector = FaultInjector(parse_faults("mode_flip; "), ROBOT.mechanism)
    for position in ((float("nan"), 0.0), (1.0,), ()):
        (sent,) = injector.send(original(0)._replace(position=position))
        assert len(sent.sample.position) == len(position)


# --- the line ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("nam", "no fault 'nam'; known are .*nan"),
        ("nan:cnt=3", "fault 'nan' has no 'cnt'; it has at, lasting, count, every, joint, which"),
        ("nan:count", "'count' of fault 'nan' must look like at=VALUE"),
        ("nan:count=x", "count of fault 'nan' is a whole number in 1"),
        ("nan:count=2.5", "a whole number"),
        ("nan:count=0", "a whole number in 1"),
        ("nan:at=-1", "at of fault 'nan' is a number in 0..inf, got '-1'"),
        ("nan:at=nan", "is a number"),
        ("nan:which=speed", "which of fault 'nan' is one of position, velocity, effort, got 'speed'"),
        ("loss:share=1.5", "in 0..1"),
        ("stamp_shift:by=1e300", "is a number in"),
        ("drop:count=1; loss:share=oops", "share of fault 'loss'"),
        ("drop count=1", "no fault 'drop count=1'"),
    ],
)
def test_an_unreadable_line_is_refused_with_the_right_form(line, reason):
    with pytest.raises(BadFault, match=reason):
        parse_faults(line)


def test_the_manual_names_every_fault_and_its_settings():
    manual = describe()
    assert len(manual.splitlines()) == len(FAULTS)
    for name in FAULTS:
        assert f"{name}: " in manual
    assert "share=0.05 (share of the samples)" in manual


def test_the_manual_for_people_knows_every_fault_and_its_defaults():
    page = Path(__file__).parents[4] / "docs" / "how_to" / "simulation.md"
    if not page.exists():
        pytest.skip("the page is part of the repository, not of the installed package")
    rows = [line for line in page.read_text(encoding="utf-8").splitlines() if line.startswith("| `")]
    for name, kind in FAULTS.items():
        (row,) = (line for line in rows if f"`{name}`" in line.split("|")[1])
        for entry in fields(kind):
            if "setting" in entry.metadata and entry.name not in {"at", "lasting", "count", "every"}:
                assert f"`{entry.name}={entry.default}`" in row
