"""The command of the fault campaign, and the processes of its rows."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from command import IRSBOT, PATIENCE_S
from rows_for_tests import break_down, not_met

from irsbot_supervisor.cli.faults import faults
from irsbot_supervisor.validation import runner
from irsbot_supervisor.validation.harness.rows import Entry, Row
from irsbot_supervisor.validation.runner import Order, run_rows

pytestmark = pytest.mark.slow


def irsbot(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*IRSBOT, *words], capture_output=True, text=True, timeout=PATIENCE_S)


SILENT_ROW = """
import os, signal
from irsbot_supervisor.validation.harness.rows import Entry
from irsbot_supervisor.validation.runner import Order, run_rows
def silent(job):
    print(os.getpid(), flush=True)
    signal.pause()
if __name__ == "__main__":
    list(run_rows([Order(Entry("silent", "never tells", 1, 1, silent), 1, 1)], 1, print))
"""


def test_a_row_ends_with_a_command_that_is_killed(tmp_path: Path) -> None:
    script = tmp_path / "silent_row.py"
    script.write_text(SILENT_ROW)
    command = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, text=True)
    try:
        assert command.stdout is not None
        row = psutil.Process(int(command.stdout.readline()))
    finally:
        command.kill()
        command.communicate(timeout=PATIENCE_S)
    _, left = psutil.wait_procs([row], PATIENCE_S)
    for one in left:
        one.kill()
    assert not left


UNTIDY_ROW = """
import signal
from threading import Event
from tempfile import TemporaryDirectory
from irsbot_supervisor.validation.harness.rows import Entry
from irsbot_supervisor.validation.runner import Order, run_rows
def untidy(job):
    with TemporaryDirectory() as folder:
        MISS
        print(folder, flush=True)
        Event().wait()
if __name__ == "__main__":
    list(run_rows([Order(Entry("untidy", "never ends", 1, 1, untidy), 1, 1)], 1, print))
"""


MISS_A_SIGNAL = (
    "meant = signal.getsignal(signal.SIGTERM); "
    "signal.signal(signal.SIGTERM, lambda number, _: signal.signal(number, meant))"
)
"""Like a signal between Python's last look for signals and a system call that blocks: the call goes on."""


@pytest.mark.parametrize(
    ("interrupt", "miss"),
    [(os.kill, "pass"), (os.killpg, "pass"), (os.kill, MISS_A_SIGNAL)],
    ids=["the command", "all, as Ctrl-C does", "the command, and a signal is missed"],
)
def test_an_interrupted_row_removes_its_files_and_says_nothing(
    tmp_path: Path, interrupt: Callable[[int, int], None], miss: str
) -> None:
    script = tmp_path / "untidy_row.py"
    script.write_text(UNTIDY_ROW.replace("MISS", miss))
    command = subprocess.Popen(
        [sys.executable, str(script)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    try:
        assert command.stdout is not None
        folder = Path(command.stdout.readline().strip())
        assert folder.is_dir()
        interrupt(command.pid, signal.SIGINT)
        _, stated = command.communicate(timeout=PATIENCE_S)
    finally:
        command.kill()
    assert not folder.exists()
    assert "in untidy" not in stated


@pytest.mark.parametrize(("gone", "code"), [(False, 0), (True, 1)])
def test_a_process_whose_parent_is_gone_before_it_can_follow_it_ends(gone: bool, code: int) -> None:
    parent = f"os.getppid() + {int(gone)}"
    words = f"import os; from irsbot_supervisor.processes.suite import end_with_parent; end_with_parent({parent})"
    assert subprocess.run([sys.executable, "-c", words], timeout=PATIENCE_S).returncode == code


def test_the_command_runs_the_rows_that_are_named_and_writes_their_table(tmp_path: Path) -> None:
    table = tmp_path / "table.md"
    words = ("--quick", "--only", "approach", "--only", "stamps", "--robot", "irsbot2", "--workers", "2", "--json")
    done = irsbot("faults", *words, "-o", str(table))
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["rows"]
    assert [(row["name"], row["met"]) for row in rows] == [("approach", True), ("stamps", True)]
    assert "| approach | 2 | 0 | 0 |" in table.read_text()


def test_an_interrupted_campaign_has_written_the_rows_that_were_done(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    def interrupted(*_: object) -> Iterator[Row]:
        yield Row("garbage", 7, 0, 0, {})
        raise KeyboardInterrupt

    monkeypatch.setattr(runner, "run_rows", interrupted)
    table = tmp_path / "table.md"
    with pytest.raises(KeyboardInterrupt):
        faults(only=["stamps", "garbage"], output=table)
    assert "| garbage | 7 | 0 | 0 |" in table.read_text()


def test_a_part_of_a_row_has_the_cases_that_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[runner.Order] = []
    monkeypatch.setattr(runner, "run_rows", lambda orders, *_: iter(asked.extend(orders) or ()))
    faults(only=["adversary", "delivery"], robot=["rpr3", "ruu4"], cases=30, seed=2)
    assert [(order.amount, order.seed, order.robots) for order in asked] == [(30, 2, ("rpr3", "ruu4")), (30, 2, ())]


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (("--only", "typhoon"), "no row 'typhoon'; there are approach"),
        (("--robot", "hexapod"), "robot 'hexapod'"),
        (("--quick", "--cases", "5"), "--quick and --cases"),
        (("--quick", "--only", "stamps", "--scheduler", "here"), "tcp://host"),
    ],
)
def test_a_campaign_that_cannot_be_run_is_refused_in_one_line(words: tuple[str, ...], stated: str) -> None:
    done = irsbot("faults", *words)
    assert done.returncode == 2
    assert stated in done.stderr
    assert len(done.stderr.splitlines()) == 1


def test_a_row_that_breaks_down_is_a_row_that_is_not_met() -> None:
    cases: list[tuple[str, int]] = []
    orders = [Order(Entry(name, "", 3, 3, run), 3, 1) for name, run in (("worse", break_down), ("bad", not_met))]
    worse, bad = run_rows(orders, 1, lambda name, number: cases.append((name, number)))
    assert not worse.ok
    assert worse.note == "ValueError: out of luck"
    assert (bad.amount, bad.unsafe, bad.failed, bad.note, bad.ok) == (3, 1, 1, "allowed", False)
