"""`docs`: the documentation as a site, built here and opened in a browser."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import webbrowser
from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics import BadInput
from irsbot_supervisor.cli.common import Failed, err, out, print_json

CONFIG = "mkdocs.yml"
"""Configuration file at the root of the source tree."""

SITE = Path("runs") / "docs"
"""Folder of the site below the root."""

MARK = Path("search") / "search_index.json"
"""A file that only a built site has. mkdocs empties its folder, so other folders are refused."""


def docs(
    folder: Annotated[Path | None, typer.Option("--out", help="folder for the site; runs/docs if left out")] = None,
    show: Annotated[bool, typer.Option("--open/--no-open", help="open it in a browser when one is there")] = True,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Build the documentation as a site, without network, and open it in a browser.

    The reference is generated from the code. A broken link is an error with exit code 1.

    Example: irsbot docs --no-open --out site.
    """
    root = tree()
    if importlib.util.find_spec("material") is None:
        raise BadInput("the site is built by mkdocs-material, which is missing: pip install mkdocs-material")
    target = (folder or root / SITE).resolve()
    if target.exists() and not target.is_dir():
        raise BadInput(f"cannot build the site in '{target}': it is a file, name a folder")
    if target.is_dir() and any(target.iterdir()) and not (target / MARK).is_file():
        raise BadInput(f"cannot build the site in '{target}': it holds other files, name a new or an empty folder")
    with err.status("building the documentation, some seconds") as status:
        if not err.is_terminal:
            err.print("building the documentation")
        faults = build(root, target)
        status.update("done")
    if faults:
        raise Failed("the documentation has faults:\n" + "\n".join(faults))
    index = target / "index.html"
    if as_json:
        print_json({"file": index})
    else:
        out.print(f"written to {index}")
    if show and not _opened(index):
        out.print("no browser here: open that file in one")


def tree() -> Path:
    """The source tree of the documentation. Raises BadInput if there is none."""
    above = [*Path(__file__).resolve().parents, Path.cwd(), *Path.cwd().parents]
    for folder in above:
        if (folder / CONFIG).is_file() and (folder / "ros2_ws").is_dir():
            return folder
    raise BadInput(f"the documentation is built from the source tree of irsbot, and there is no {CONFIG} here or above")


def build(root: Path, target: Path) -> list[str]:
    """Build the site in a folder, which is emptied first. Returns the lines of mkdocs that name faults."""
    command = [sys.executable, "-m", "mkdocs", "build", "--strict"]
    command += ["--config-file", str(root / CONFIG), "--site-dir", str(target)]
    env = {**os.environ, "NO_MKDOCS_2_WARNING": "true"}
    done = subprocess.run(command, env=env, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False)
    if done.returncode == 0:
        return []
    lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
    return [line for line in lines if line.startswith(("WARNING", "ERROR"))] or lines[-1:]


def _opened(page: Path) -> bool:
    """True if a browser with a window opened the page; browsers in the terminal are not tried."""
    if sys.platform == "linux" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return False
    try:
        return webbrowser.open(page.as_uri())
    except webbrowser.Error:
        return False
