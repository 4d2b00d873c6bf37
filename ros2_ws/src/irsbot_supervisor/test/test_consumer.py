"""The consumer's half: what verdicts, their order and their absence allow, in Python and in C++ alike."""

from __future__ import annotations

import random
import shutil
import subprocess
from math import inf, nan
from pathlib import Path

import pytest

from irsbot_supervisor.consumer import OK, STOP, TIMEOUT_S, UNKNOWN, WARN, Consumer, LastCommand
from irsbot_supervisor.sim.stop_response import StopResponse

MS = 1_000_000
BEAT_MS = 10
HEADER = Path(__file__).parents[4] / "docs" / "examples" / "cpp" / "consumer.hpp"


def moving(gated: bool = False) -> Consumer:
    """It has heard a supervisor that says OK until 100 ms."""
    consumer = Consumer(gated=gated)
    for number in range(11):
        consumer.hear(OK, 100 + number, 1.0, number * BEAT_MS * MS)
    assert consumer.allowed(100 * MS) == 1.0
    return consumer


@pytest.mark.parametrize(
    ("level", "scale", "age_s", "allowed"),
    [
        (OK, 1.0, 0.0, 1.0),
        (WARN, 0.5, 0.0, 0.5),
        (STOP, 0.0, 0.0, 0.0),
        (STOP, 0.05, 0.0, 0.0),
        (UNKNOWN, 1.0, 0.0, 0.0),
        (7, 1.0, 0.0, 0.0),
        (OK, nan, 0.0, 0.0),
        (OK, -1.0, 0.0, 0.0),
        (OK, 1.5, 0.0, 0.0),
        (OK, 1.0, 0.2, 0.0),
        (OK, 1.0, -0.2, 0.0),
        (OK, 1.0, nan, 0.0),
        (OK, 1.0, inf, 0.0),
    ],
)
def test_the_next_verdict_sets_the_allowed_share(level: int, scale: float, age_s: float, allowed: float):
    consumer = moving()
    consumer.hear(level, 111, scale, 110 * MS, age_s)
    assert consumer.allowed(110 * MS) == allowed
    assert consumer.brakes == (allowed == 0.0)


def test_a_gated_consumer_is_led_out_of_a_stop_by_the_gate():
    consumer = moving(gated=True)
    consumer.hear(STOP, 111, 0.05, 110 * MS)
    assert consumer.allowed(110 * MS) == 1.0
    consumer.hear(STOP, 112, 0.0, 120 * MS)
    assert consumer.allowed(120 * MS) == 0.0


def test_silence_brakes_and_verdicts_in_sequence_for_the_time_out_end_it():
    consumer = moving()
    assert consumer.allowed(200 * MS) == 1.0
    assert consumer.allowed(200 * MS + 1) == 0.0
    assert consumer.allowed(150 * MS) == 0.0  # what has run out stays so
    assert consumer.brakes == 1
    for number in range(12):
        now = (300 + BEAT_MS * number) * MS
        consumer.hear(OK, 200 + number, 1.0, now)
        assert consumer.allowed(now) == (1.0 if number >= 10 else 0.0)
    assert consumer.brakes == 1


def say_ok(consumer: Consumer, numbers: range, begin_ms: int) -> None:
    for number in numbers:
        consumer.hear(OK, number, 1.0, (begin_ms + BEAT_MS * (number - numbers[0])) * MS)


def test_a_command_counts_until_motion_ends():
    consumer = moving()
    last = LastCommand[str](consumer)
    assert last.now(100 * MS) is None
    last.take("left", 100 * MS)
    assert last.now(200 * MS) == "left"
    assert last.now(201 * MS) is None
    say_ok(consumer, range(200, 212), 300)
    assert consumer.allowed(410 * MS) == 1.0
    assert last.now(410 * MS) is None
    last.take("right", 410 * MS)
    assert last.now(420 * MS) == "right"


@pytest.mark.parametrize("cycle_ms", [205, None])
def test_a_command_that_waited_while_motion_ended_is_void(cycle_ms: int | None):
    """The process is paused from 100 to 205 ms; then its cycle is first, or the command that was sent before."""
    consumer = moving()
    last = LastCommand[str](consumer)
    if cycle_ms is not None:
        assert last.now(cycle_ms * MS) is None
    last.take("left", 205 * MS)
    assert last.now(206 * MS) is None
    say_ok(consumer, range(1, 13), 300)  # of the next supervisor
    assert consumer.allowed(410 * MS) == 1.0
    assert last.now(410 * MS) is None


def test_a_command_before_motion_is_allowed_for_the_first_time_is_void():
    consumer = Consumer()
    last = LastCommand[str](consumer)
    last.take("left", 0)
    say_ok(consumer, range(1, 13), 0)
    assert consumer.allowed(110 * MS) == 1.0
    assert last.now(110 * MS) is None


def test_the_second_verdict_after_a_stop_allows_motion():
    consumer = moving()
    consumer.hear(STOP, 111, 0.0, 110 * MS)
    for number, expected in enumerate((0.0, 1.0, 1.0)):
        now = (120 + BEAT_MS * number) * MS
        consumer.hear(OK, 112 + number, 1.0, now)
        assert consumer.allowed(now) == expected


def test_the_latched_last_word_of_a_supervisor_that_is_gone_allows_nothing():
    consumer = Consumer()
    consumer.hear(OK, 4711, 1.0, 0)
    assert consumer.allowed(0) == 0.0


def test_a_supervisor_that_starts_again_begins_anew():
    consumer = moving()
    consumer.hear(OK, 1, 1.0, 110 * MS)
    assert consumer.allowed(110 * MS) == 0.0
    assert consumer.brakes == 1
    for number in range(2, 12):
        assert consumer.allowed((100 + number * BEAT_MS) * MS) == 0.0
        consumer.hear(OK, number, 1.0, (100 + number * BEAT_MS) * MS)
    assert consumer.allowed(210 * MS) == 1.0


@pytest.mark.parametrize("behind", [0, 1000])
def test_two_supervisors_on_one_topic_allow_nothing(behind: int):
    """Both say OK, each for a robot of its own, in turns; one may have begun as late as the other."""
    consumer = Consumer()
    allowed = []
    for number in range(100):
        for mine, late_ms in ((5000, 0), (5000 - behind, 5)):
            consumer.hear(OK, mine + number, 1.0, (number * BEAT_MS + late_ms) * MS)
            allowed.append(consumer.allowed((number * BEAT_MS + late_ms) * MS))
    assert not any(allowed)


@pytest.mark.parametrize("fast_ms", [1, 2, 5, 10])
@pytest.mark.parametrize("slow_ms", [10, 22, 50])
@pytest.mark.parametrize("behind", [0, 100_000, -100_000])
@pytest.mark.parametrize("timeout_s", [0.01, 0.02, TIMEOUT_S])
def test_a_supervisor_that_speaks_more_often_does_not_outvote_another(
    fast_ms: int, slow_ms: int, behind: int, timeout_s: float
):
    """One says OK, the other STOP; whoever began earlier has the larger numbers."""
    consumer, fast, slow, allowed = Consumer(timeout_s), 200_000, 200_000 + behind, 0
    for ms in range(3, 3000):
        if ms % fast_ms == 0:
            fast += 1
            consumer.hear(OK, fast, 1.0, ms * MS)
        if ms % slow_ms == 0:
            slow += 1
            consumer.hear(STOP, slow, 0.0, ms * MS)
        allowed += consumer.allowed(ms * MS) > 0.0
    assert not allowed


def test_a_repeated_verdict_is_none():
    consumer = moving()
    consumer.hear(OK, 110, 1.0, 110 * MS)
    assert consumer.allowed(110 * MS) == 0.0


@pytest.mark.parametrize("timeout_s", [0.0, -1.0, nan, inf, True])
def test_a_timeout_that_is_none_is_refused(timeout_s: float):
    with pytest.raises(ValueError, match="timeout"):
        Consumer(timeout_s)


def events(seed: int, gated: bool) -> list[tuple[int, int, float, int, float]]:
    """Verdicts of one or two supervisors with silences, restarts and nonsense: level, sequence, scale, ns, age."""
    chance = random.Random(seed)
    now, sequence, found = 10**12, 1, []
    for _ in range(400):
        now += chance.choice((10, 10, 10, 10, 5, 99, 100, 101, 300)) * MS
        sequence = chance.choice((sequence + 1,) * 12 + (sequence, 1, sequence + 3, max(sequence - 5, 0)))
        level = chance.choice((OK,) * 10 + (WARN, WARN, STOP, UNKNOWN, 9))
        scale = chance.choice((1.0,) * 6 + (0.3, 0.05, 0.0, 1.1, nan))
        found.append((level, sequence, scale, now, chance.choice((0.0,) * 8 + (0.05, 0.1, 0.11, -0.2, nan))))
    return found


@pytest.mark.parametrize("gated", [False, True])
def test_it_never_allows_motion_that_the_levels_forbid(gated: bool):
    allowed = 0
    for seed in range(20):
        consumer, simple = Consumer(gated=gated), StopResponse(TIMEOUT_S, gated)
        for level, sequence, scale, now, age in events(seed, gated):
            consumer.hear(level, sequence, scale, now, age)
            simple.hear(level, scale, now)
            for later in (0, 50, 100, 101):
                share = consumer.allowed(now + later * MS)
                assert share <= simple.allowed(now + later * MS)
                allowed += share > 0.0
    assert allowed > 1000  # not by forbidding everything


MAIN = """
#include <cstdio>
#include <limits>
#include <stdexcept>
#include <type_traits>
#include "consumer.hpp"

template <typename... T> constexpr bool kMade = std::is_constructible_v<irsbot::Consumer, T...>;
static_assert(kMade<> && kMade<double> && kMade<int> && kMade<double, bool>);
static_assert(!kMade<bool> && !kMade<bool, bool>, "true is no time-out");

bool is_refused(double timeout_s) {
  try {
    irsbot::Consumer consumer(timeout_s);
  } catch (const std::invalid_argument &) {
    return true;
  }
  return false;
}

int main(int argc, char **) {
  using Limits = std::numeric_limits<double>;
  for (double timeout_s : {0.0, -1.0, Limits::quiet_NaN(), Limits::infinity()}) if (!is_refused(timeout_s)) return 3;
  irsbot::Consumer consumer(0.1, argc > 1);
  irsbot::Consumer other(0.1, argc > 1);
  irsbot::LastCommand<long long> last(other);
  int level; unsigned long long sequence; double scale, age; long long now;
  while (std::scanf("%d %llu %lf %lld %lf", &level, &sequence, &scale, &now, &age) == 5) {
    consumer.hear(level, sequence, scale, now, age);
    for (int i = 0; i < 4; ++i) std::printf("%.17g ", consumer.allowed(now + (i < 3 ? 50 * i : 101) * 1000000LL));
    std::printf("%llu ", static_cast<unsigned long long>(consumer.brakes()));
    other.hear(level, sequence, scale, now, age);
    if (sequence % 3 == 0) last.take(now, now);
    const long long * followed = last.now(now + 5000000LL);
    std::printf("%lld\\n", followed ? *followed : -1LL);
  }
}
"""


@pytest.mark.skipif(shutil.which("c++") is None, reason="needs a C++ compiler")
@pytest.mark.skipif(not HEADER.is_file(), reason="installed without the examples beside it")
def test_the_header_in_c_plus_plus_does_the_same(tmp_path: Path):
    source, program = tmp_path / "main.cpp", tmp_path / "main"
    source.write_text(MAIN)
    build = ["c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", f"-I{HEADER.parent}", str(source), "-o", str(program)]
    subprocess.run(build, check=True, timeout=60)
    followed = 0
    for gated in (False, True):
        for seed in range(5):
            told, expected = "", []
            consumer, other = Consumer(gated=gated), Consumer(gated=gated)
            last = LastCommand[int](other)
            for level, sequence, scale, now, age in events(seed, gated):
                told += f"{level} {sequence} {scale!r} {now} {age!r}\n"
                consumer.hear(level, sequence, scale, now, age)
                row = [*(consumer.allowed(now + t * MS) for t in (0, 50, 100, 101)), consumer.brakes]
                other.hear(level, sequence, scale, now, age)
                if sequence % 3 == 0:
                    last.take(now, now)
                obeyed = last.now(now + 5 * MS)
                followed += obeyed is not None and obeyed < now
                expected.append([*row, -1 if obeyed is None else obeyed])
            command = [str(program), *(["gated"] if gated else [])]
            done = subprocess.run(command, input=told, capture_output=True, text=True, check=True, timeout=60)
            assert [[float(part) for part in line.split()] for line in done.stdout.splitlines()] == expected
    assert followed > 20  # commands of earlier verdicts
