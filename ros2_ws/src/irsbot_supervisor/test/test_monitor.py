"""What a terminal shows of a running suite: nothing that is too old is believed, and it fits into 80 by 24 letters."""

from __future__ import annotations

import io
from itertools import pairwise
from math import inf
from pathlib import Path

import pytest
from rich.console import Console

from irsbot_msgs_py.cdr import encode_state, encode_verdict
from irsbot_msgs_py.records import Level
from irsbot_supervisor.bag.journal import write_entry
from irsbot_supervisor.cli.monitor import facts
from irsbot_supervisor.cli.tables.monitor import BAR, bar, screen
from irsbot_supervisor.processes.observed import Observed
from irsbot_supervisor.replay.recording import Recording, read_recording

TYPE2 = Path(__file__).resolve().parents[4] / "bags" / "type2"


@pytest.fixture(scope="module")
def run() -> Recording:
    return read_recording(TYPE2)


def heard(run: Recording, count: int = 10_000) -> tuple[Observed, float]:
    """A whole run, told at the times of its recording; the time of the last verdict, s."""
    observed = Observed()
    for entry in run.journal:
        observed.hear_journal(write_entry(entry))
    for state in run.states[:count]:
        observed.hear_states([encode_state(state)], [state.seen_ns * 1e-9])
    now_s = 0.0
    for log_ns, verdict in run.verdicts[:count]:
        now_s = (log_ns - run.sessions[0].ahead_ns) * 1e-9
        observed.hear_verdicts([encode_verdict(verdict)], [now_s])
    return observed, now_s


def shown(observed: Observed, now_s: float) -> str:
    text = io.StringIO()
    Console(file=text, width=80, height=24).print(screen(observed.look(now_s), now_s))
    return text.getvalue()


def test_it_shows_the_newest_messages(run: Recording) -> None:
    observed, now_s = heard(run)
    text = shown(observed, now_s)
    last = run.states[-1]
    for words in ("S T O P", f"{last.type2_margin:.4f}", f"{last.constraint_margin:.4f}", "is latched", last.robot):
        assert words in text
    changes = observed.look(now_s).changes
    essences = [(v.level, v.causes, v.latched, v.event) for _log, v in run.verdicts]
    assert len(changes) == 1 + sum(a != b for a, b in pairwise(essences))


def test_it_always_fits_into_80_by_24_characters(run: Recording) -> None:
    observed, now_s = heard(run)
    for _log, verdict in run.verdicts[:60]:
        long = verdict._replace(event=_log % 2**32, text="long " * 100)
        observed.hear_verdicts([encode_verdict(long)], [now_s])
    for at in (observed, Observed()):
        lines = shown(at, now_s).rstrip("\n").split("\n")
        assert len(lines) <= 24
        assert max(map(len, lines)) <= 80


def test_a_verdict_that_is_too_old_counts_as_unknown(run: Recording) -> None:
    observed, now_s = heard(run)
    assert observed.look(now_s + 0.09).level == Level.STOP
    late = observed.look(now_s + 0.11)
    assert late.level == Level.UNKNOWN
    assert "last verdict STOP, too old" in shown(observed, now_s + 0.11)
    assert late.verdict_age_s == pytest.approx(0.11)


def test_without_verdicts_the_level_is_unknown() -> None:
    seen = Observed().look(5.0)
    assert (seen.level, seen.verdict, seen.state) == (Level.UNKNOWN, None, None)
    assert (seen.verdict_age_s, seen.state_hz) == (inf, 0.0)
    assert "no verdict" in shown(Observed(), 5.0)
    assert facts(seen)["verdict"] is None


def test_rates_count_the_last_second(run: Recording) -> None:
    observed = Observed()
    for number in range(500):
        observed.hear_states([encode_state(run.states[0])], [number * 0.01])
    assert observed.look(4.99).state_hz == pytest.approx(100.0, abs=2.0)
    assert observed.look(9.0).state_hz == 0.0


def test_damaged_messages_change_nothing() -> None:
    observed = Observed()
    observed.hear_states([b"nonsense"], [1.0])
    observed.hear_journal("nonsense")
    assert observed.look(1.0).state is None
    assert observed.look(1.0).limits == {}


@pytest.mark.parametrize(
    ("value", "colour"), [(0.9, "green"), (0.2, "yellow"), (0.1, "red"), (0.0, "red"), (1.0, "green")]
)
def test_a_bar_is_as_long_as_its_margin_and_coloured_by_its_limits(value: float, colour: str) -> None:
    drawn = bar(value, (0.15, 0.25))
    assert len(drawn) == BAR
    assert drawn.plain[int(0.15 * BAR)] == "|"
    assert drawn.plain[int(0.25 * BAR)] == ":"
    filled = drawn.plain.count("█") + sum(int(limit * BAR) < round(value * BAR) for limit in (0.15, 0.25))
    assert filled == round(value * BAR)
    if value:
        assert colour in {str(span.style) for span in drawn.spans}
