"""Write requirements.txt: every version that requirements.in needs on Python 3.10, 3.11 and 3.12.

Run by hand, with the three interpreters, oldest first:
    python3 setup/lock.py python3.10 python3.11 python3.12
Each later Python is resolved under the versions of the earlier ones, so one list serves all.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
HEADER = "# Made by lock.py from requirements.in: all versions, for Python 3.10 to 3.12 on Linux x86_64.\n"


def resolve(python: str, constraints: dict[str, str]) -> dict[str, str]:
    """Name -> version of everything that requirements.in pulls in on this Python."""
    with tempfile.TemporaryDirectory() as scratch:
        subprocess.run([python, "-m", "venv", f"{scratch}/venv"], check=True)
        pip = [f"{scratch}/venv/bin/python", "-m", "pip", "--disable-pip-version-check"]
        subprocess.run([*pip, "install", "--quiet", "pip==25.3"], check=True)
        pinned = Path(scratch, "constraints.txt")
        pinned.write_text("".join(f"{name}=={version}\n" for name, version in constraints.items()))
        report = Path(scratch, "report.json")
        command = [*pip, "install", "--quiet", "--dry-run", "--ignore-installed", "--report", str(report)]
        subprocess.run([*command, "-c", str(pinned), "-r", str(HERE / "requirements.in")], check=True)
        found = json.loads(report.read_text())["install"]
    names = (package["metadata"] for package in found)
    return {meta["name"].lower().replace("_", "-"): meta["version"] for meta in names}


def main(pythons: list[str]) -> None:
    """Resolve on every Python and write the union, with a marker where only older ones need a package."""
    versions: dict[str, str] = {}
    needed_by: dict[str, list[str]] = {}
    for python in pythons:
        show = "import sys; print('%d.%d' % sys.version_info[:2])"
        label = subprocess.run([python, "-c", show], check=True, capture_output=True, text=True).stdout.strip()
        for name, version in resolve(python, versions).items():
            versions[name] = version
            needed_by.setdefault(name, []).append(label)
    lines = [f"{name}=={versions[name]}{marker(needed_by[name])}\n" for name in sorted(versions)]
    (HERE / "requirements.txt").write_text(HEADER + "".join(lines))


def marker(labels: list[str]) -> str:
    """The environment marker of a package that only these Pythons need, empty if all three do."""
    match labels:
        case ["3.10", "3.11", "3.12"]:
            return ""
        case ["3.10", "3.11"]:
            return ' ; python_version < "3.12"'
        case ["3.10"]:
            return ' ; python_version < "3.11"'
    raise ValueError(f"no marker for a package that only {labels} need")


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(sys.argv[1:])
