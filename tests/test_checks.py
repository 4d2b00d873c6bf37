"""The checks of ./irsbot test: every one runs, one failure fails the whole, an interrupt ends them in order."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]


def test_every_check_runs_and_one_failure_fails_the_whole(modules, tmp_path, capfd):
    commands = [("first", ["bash", "-c", "echo one; exit 3"]), ("second", ["bash", "-c", "echo two"])]
    assert modules.checks.run_checks(commands, tmp_path, os.environ) == 1
    stated = capfd.readouterr().out
    assert "one" in stated
    assert "two" in stated
    assert "FAILED (exit code 3)" in stated.split("== summary")[1]
    assert modules.checks.run_checks(commands[1:], tmp_path, os.environ) == 0


def test_arguments_of_the_test_command_go_to_pytest_alone(modules):
    assert [name for name, _ in modules.checks.checks("python", [])] == ["ruff check", "ruff format", "mypy", "pytest"]
    [(name, command)] = modules.checks.checks("python", ["-k", "margin"])
    assert name == "pytest"
    assert command[-2:] == ["-k", "margin"]


def test_all_tests_are_spread_over_the_cores_and_a_file_stays_in_one_process(modules):
    _name, command = modules.checks.checks("python", [])[-1]
    workers = int(next(word for word in command if word.startswith("--numprocesses=")).partition("=")[2])
    assert 1 <= workers <= len(os.sched_getaffinity(0))
    assert "--dist=loadfile" in command


def pytest_in(folder: Path, *arguments: str) -> str:
    """What pytest prints for the tests in a folder, with the hooks of this project."""
    shutil.copy(ROOT / "conftest.py", folder)
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *arguments]
    environment = {name: value for name, value in os.environ.items() if name != "PYTEST_ADDOPTS"}
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120).stdout


@pytest.mark.parametrize("spread", [[], ["--numprocesses=2"]], ids=["one process", "two processes"])
def test_a_failed_test_is_named_at_once(tmp_path, spread):
    (tmp_path / "test_a.py").write_text("def test_good():\n    pass\n\ndef test_bad():\n    assert False\n")
    stated = pytest_in(tmp_path, "--no-summary", *spread)  # no list of failures at the end
    assert stated.count("failed: test_a.py::test_bad") == 1
    assert "failed: test_a.py::test_good" not in stated


def test_files_with_nodes_come_first_then_slow_ones(tmp_path):
    (tmp_path / "pytest.ini").write_text("[pytest]\nmarkers =\n    ros\n    slow\n")
    for name, mark in (("a", "xfail"), ("b", "slow"), ("c", "ros"), ("d", "slow")):
        test = f"import pytest\n\ndef test_first():\n    pass\n\n@pytest.mark.{mark}\ndef test_second():\n    pass\n"
        (tmp_path / f"test_{name}.py").write_text(test)
    stated = pytest_in(tmp_path, "--collect-only")
    collected = [line for line in stated.splitlines() if "::" in line]
    assert collected == [f"test_{name}.py::test_{which}" for name in "cbda" for which in ("first", "second")]


INTERRUPTED = """
import os, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
import checks

def interrupt(number, frame):
    raise KeyboardInterrupt(number)

signal.signal(signal.SIGTERM, interrupt)
signal.signal(signal.SIGINT, signal.SIG_DFL)  # a background job of a shell ignores it
tidy = "trap 'echo tidied; exit 7' INT; echo begun; while true; do sleep 0.1; done"
checks.run_checks([("tests", ["bash", "-c", tidy])], Path("."), os.environ)
"""


def test_a_check_that_is_interrupted_ends_in_order_before_the_command_does(copy):
    command = [sys.executable, "-c", INTERRUPTED, str(copy / "setup")]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=subprocess.DEVNULL, text=True) as process:
        assert process.stdout
        assert "begun\n" in iter(process.stdout.readline, "")
        process.terminate()
        assert process.stdout.read() == "tidied\n"
    assert process.returncode != 0


INTERRUPTED_AT_START = """
popen = checks.subprocess.Popen
def start(*given, **named):
    process = popen(*given, **named)
    os.kill(os.getpid(), signal.SIGTERM)  # before anybody holds the process
    return process
checks.subprocess.Popen = start
"""


def test_a_check_that_is_interrupted_while_it_starts_ends_too(copy):
    preparation, call = INTERRUPTED.split("tidy = ")
    script = f"{preparation}{INTERRUPTED_AT_START}tidy = {call}"
    command = [sys.executable, "-c", script, str(copy / "setup")]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=subprocess.DEVNULL, start_new_session=True) as process:
        try:
            process.communicate(timeout=60.0)  # until the check has closed its output, too
        finally:
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode != 0
