"""A DDS domain that was chosen is nobody else's, also before a node has opened a port on it."""

from __future__ import annotations

import subprocess
import sys

import pytest

from irsbot_supervisor.processes import suite

OTHER = """
import sys
from irsbot_supervisor.processes import suite
suite.DOMAINS = range(int(sys.argv[1]), int(sys.argv[1]) + 1)
try:
    print(suite.free_domain())
except suite.SuiteError:
    print("taken")
"""


def test_a_domain_that_was_just_chosen_is_not_chosen_again(monkeypatch: pytest.MonkeyPatch):
    domain = suite.free_domain()
    monkeypatch.setattr(suite, "DOMAINS", range(domain, domain + 1))
    with pytest.raises(suite.SuiteError):
        suite.free_domain()
    done = subprocess.run([sys.executable, "-c", OTHER, str(domain)], capture_output=True, text=True, timeout=120)
    assert done.stdout == "taken\n", done.stderr
