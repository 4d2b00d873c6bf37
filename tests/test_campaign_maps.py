"""The short version of the map campaign."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_no_sample_of_a_map_contradicts_the_loci() -> None:
    script = Path(__file__).parent / "campaigns" / "maps.py"
    command = [sys.executable, str(script), "--nodes", "300", "--robots", "irsbot2_beta45", "irsbot2_csc"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" 0 away from a locus") == 8
    assert " 0 sign changes" not in done.stdout, "no locus inside the reach: the fixture proves nothing"
