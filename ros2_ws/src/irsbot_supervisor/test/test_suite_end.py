"""A suite ends its nodes in order, also if it is interrupted meanwhile."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from command import PATIENCE_S

NODE = """
import signal, sys
from pathlib import Path
signal.signal(signal.SIGINT, lambda number, frame: sys.exit(0))
Path("ready").write_text("")
while True:
    signal.pause()
"""

COMMAND = """
import signal
from pathlib import Path
from irsbot_supervisor.processes.suite import Node, Suite
signal.signal(signal.SIGTERM, signal.default_int_handler)
class Interrupted(Suite):
    def stop(self):
        signal.raise_signal(signal.{how})
        return super().stop()
try:
    with Interrupted(Path(), 1) as suite:
        suite.start(Node("node", "some_node", {{}}))
        node = suite.processes["node"]
        Path("ready").read_text()
finally:
    print("exit code of the node:", node.returncode, flush=True)
"""
"""A suite that is interrupted when its nodes are about to be ended."""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_while_nodes_end_waits_until_they_have_ended(tmp_path: Path, how: signal.Signals) -> None:
    os.mkfifo(tmp_path / "ready")
    (tmp_path / "some_node.py").write_text(NODE)
    command = [sys.executable, "-c", COMMAND.format(how=how.name)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S)
    assert done.stdout == "exit code of the node: 0\n"
    assert done.stderr.endswith("\nKeyboardInterrupt\n")
