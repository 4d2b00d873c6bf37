"""Helpers are importable by their own names; hypothesis is repeatable and writes nothing to disk."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

sys.path.insert(0, str(Path(__file__).parent / "helpers"))

settings.register_profile(
    "irsbot",
    max_examples=30,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.filter_too_much],
)
settings.load_profile("irsbot")


@pytest.fixture
def irsbot(monkeypatch, capsys):
    """Runs `irsbot ...` and gives exit code, standard output and standard error."""

    from irsbot_supervisor.cli.app import main  # takes a second to load, and few files need it

    def run(*words):
        monkeypatch.setattr(sys, "argv", ["irsbot", *map(str, words)])
        try:
            main()
            code = 0
        except SystemExit as end:
            code = end.code or 0
        said = capsys.readouterr()
        return code, said.out, said.err

    return run
