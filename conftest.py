"""What all tests share: plain Python, and Hypothesis that is repeatable.

Plain modules can be derived from and patched; the processes that tests start run on compiled ones, if there are any.
Hypothesis writes nothing to disk and does not ask how long an example took.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from functools import cache
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings

sys.path[:] = [entry for entry in sys.path if not Path(entry, "irsbot_compiled.py").exists()]

with suppress(ImportError):  # of an older Hypothesis, which does not do this
    from hypothesis.internal.conjecture import providers

    # It takes examples from constants of the modules that are loaded just now and lie in no folder called "test":
    # the same test would get others in another clone, or after other tests.
    providers.is_local_module_file = lambda path: False

settings.register_profile(
    "irsbot",
    max_examples=10,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.filter_too_much],
)
settings.register_profile("thorough", settings.get_profile("irsbot"), max_examples=20)  # of mutation tests
settings.load_profile("irsbot")


with suppress(ImportError):  # where pytest-xdist is missing, nothing is spread
    from xdist.remote import Producer
    from xdist.scheduler import LoadScopeScheduling

    class NodesTogether(LoadScopeScheduling):
        """Spreads files over processes. Those with nodes run one after another, in one process: a node needs a
        processor when a sample comes."""

        def _split_scope(self, nodeid: str) -> str:
            path = nodeid.partition("::")[0]
            return "nodes" if _starts_nodes(self.config.rootpath / path) else path

    def pytest_xdist_make_scheduler(config: pytest.Config, log: Producer) -> NodesTogether:
        """How tests are spread (a hook of pytest-xdist)."""
        return NodesTogether(config, log)


class FailuresAtOnce:
    """Prints the name of a failed test when it fails, not only at the end."""

    def __init__(self, terminal: pytest.TerminalReporter) -> None:
        self._terminal = terminal

    @pytest.hookimpl(trylast=True)  # behind its letter
    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Hear of a phase of a test that has ended (a hook of pytest)."""
        if report.failed:
            self._terminal.write_line(f"\nfailed: {report.nodeid}")


@pytest.hookimpl(trylast=True)  # after the terminal has been opened
def pytest_configure(config: pytest.Config) -> None:
    """Add what prints failures, in the process that has the terminal."""
    terminal = config.pluginmanager.get_plugin("terminalreporter")
    if terminal is not None and not hasattr(config, "workerinput"):
        config.pluginmanager.register(FailuresAtOnce(terminal))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Files with nodes first, then slow ones: a long file that begins last leaves the other processes idle."""
    items.sort(key=lambda item: (not _starts_nodes(item.path), not _is_slow(item.path)))


@cache
def _starts_nodes(path: Path) -> bool:
    return "mark.ros" in path.read_text(encoding="utf-8")


@cache
def _is_slow(path: Path) -> bool:
    return "mark.slow" in path.read_text(encoding="utf-8")
