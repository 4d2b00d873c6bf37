"""The short version of the campaign of long pages."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from browser import PROGRAM


@pytest.mark.skipif(PROGRAM is None, reason="needs Chromium: apt install chromium")
def test_the_page_of_a_long_run_is_measured() -> None:
    script = Path(__file__).parent / "campaigns" / "long_report.py"
    done = subprocess.run(
        [sys.executable, str(script), "--minutes", "0.05"], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "3000 samples: report in" in done.stdout
    assert "Chromium shows it in" in done.stdout
