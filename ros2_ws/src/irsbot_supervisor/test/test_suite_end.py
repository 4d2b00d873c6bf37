"""A suite ends its nodes in order, also if it is interrupted meanwhile."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest
from command import PATIENCE_S

NODE = """
import os, signal, sys, time
def end(number, frame):
    os.kill(os.getppid(), signal.{how})  # an impatient user
    time.sleep(0.5)  # a bag takes as long to close; Popen.wait itself waits for 0.25 s after an interrupt
    sys.exit(0)
signal.signal(signal.SIGINT, end)
print("ready")
while True:
    signal.pause()
"""

COMMAND = """
import signal
from pathlib import Path
from irsbot_supervisor.processes.suite import Node, Suite
signal.signal(signal.SIGTERM, signal.default_int_handler)
log = Path("slow.log")
try:
    with Suite(Path(), 1) as suite:
        suite.start(Node("slow", "slow_node", {}))
        while log.read_text() != "ready\\n":
            assert suite.processes["slow"].poll() is None
finally:
    print("exit code of the node:", suite.processes["slow"].returncode, flush=True)
"""


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_while_nodes_end_waits_until_they_have_ended(tmp_path: Path, how: signal.Signals) -> None:
    (tmp_path / "slow_node.py").write_text(NODE.format(how=how.name))
    done = subprocess.run(
        [sys.executable, "-c", COMMAND], cwd=tmp_path, capture_output=True, text=True, timeout=PATIENCE_S
    )
    assert done.stdout == "exit code of the node: 0\n"
    assert done.stderr.endswith("\nKeyboardInterrupt\n")
