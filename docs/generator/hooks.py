"""What mkdocs calls while it builds the site: adds generated pages, and pages that stand elsewhere in the tree."""

from __future__ import annotations

import functools
import os
import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from reference import commands, interfaces, python_api, settings

ROOT = Path(__file__).parents[2]
ELSEWHERE = {"README.md": "index.md", "CONTRIBUTING.md": "contributing.md", "bags/README.md": "how_to/replay.md"}
"""Pages of the tree that stand where a reader of the tree looks for them -> their places in the site."""

PACKAGES = ("irsbot_supervisor", "irsbot_kinematics", "irsbot_msgs", "irsbot_msgs_py")
LINK = re.compile(r"(\]\()([^)\s#:]+)((?:#[^)\s]*)?\))")


@functools.cache
def generated() -> dict[str, str]:
    """Every page that is not below docs/ as a file: place in the site -> Markdown."""
    made = {"changelog.md": _changelog()}
    for module in (settings, interfaces, commands, python_api):
        made |= module.pages()
    return made | {place: (ROOT / source).read_text(encoding="utf-8") for source, place in ELSEWHERE.items()}


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """A folder of generated pages in the navigation stands for its pages, the index first."""
    config.nav = [_unfolded(entry) for entry in config.nav or []]
    return config


def _unfolded(entry: Any) -> Any:
    if isinstance(entry, dict):
        return {title: _unfolded(below) for title, below in entry.items()}
    if isinstance(entry, list):
        return [_unfolded(one) for one in entry]
    if entry.endswith("/"):
        below = sorted(place for place in generated() if place.startswith(entry))
        return sorted(below, key=lambda place: not place.endswith("/index.md"))
    return entry


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the generated pages."""
    for place, text in generated().items():
        files.append(File.generated(config, place, content=text))
    return files


def on_page_markdown(markdown: str, page: Any, **_others: Any) -> str:
    """Links between files of the tree become links between pages of the site."""
    place = page.file.src_uri
    stands = next((source for source, to in ELSEWHERE.items() if to == place), f"docs/{place}")

    def moved(link: re.Match[str]) -> str:
        target = os.path.normpath(os.path.join(os.path.dirname(stands), link[2]))
        to = ELSEWHERE.get(target) or (os.path.relpath(target, "docs") if target.startswith("docs/") else None)
        if to is None:
            return link[0]
        return f"{link[1]}{os.path.relpath(to, os.path.dirname(place) or '.')}{link[3]}"

    return LINK.sub(moved, markdown)


def _changelog() -> str:
    """The changes of all packages: of their CHANGELOG.rst what a list in Markdown can say."""
    parts = ["# Changelog"]
    for package in PACKAGES:
        text = (ROOT / "ros2_ws" / "src" / package / "CHANGELOG.rst").read_text(encoding="utf-8")
        body = text.split("\n\n", 1)[1]
        body = re.sub(r"^(.+)\n-+$", r"### \1\n", body, flags=re.MULTILINE).replace("``", "`")
        parts.append(f"## {package}\n\n{body.strip()}")
    return "\n\n".join(parts) + "\n"
