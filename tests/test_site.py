"""The documentation as a site: it builds without network, every link leads somewhere, the reference is whole."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass, field, fields
from html.parser import HTMLParser
from importlib import import_module
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

import pytest
from typer.testing import CliRunner

from irsbot_supervisor.cli.app import whole_app
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.sim.simulation import Simulation

ROOT = Path(__file__).parents[1]
SRC = ROOT / "ros2_ws" / "src"
LONGEST = 300
"""Lines of a page."""

NO_NETWORK = """
import socket
def refuse(*_arguments, **_others):
    raise OSError("the documentation is built without network")
socket.getaddrinfo = socket.create_connection = refuse
socket.socket.connect = socket.socket.connect_ex = refuse
"""
"""Python runs a module `sitecustomize` first."""

LOADED = {"script": "src", "img": "src", "link": "href", "iframe": "src", "source": "src", "object": "data"}
"""What a browser fetches by itself: element -> attribute."""

pytestmark = [
    pytest.mark.skipif(not (ROOT / "mkdocs.yml").is_file(), reason="installed without the source tree"),
    pytest.mark.ros,
]


def irsbot(*arguments: str, **environment: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "irsbot_supervisor", *arguments]
    env = {**os.environ, **environment}
    return subprocess.run(command, capture_output=True, text=True, timeout=240, env=env, cwd=ROOT)


@pytest.fixture(scope="module")
def generator(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    """The modules that make pages."""
    sys.path.insert(0, str(ROOT / "docs" / "generator"))
    try:
        yield import_module("hooks")
    finally:
        sys.path.pop(0)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site, built by the command of the user on a machine without network."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "sitecustomize.py").write_text(NO_NETWORK)
    path = os.pathsep.join([str(folder), os.environ.get("PYTHONPATH", "")])
    done = irsbot("docs", "--no-open", "--out", str(folder / "built"), PYTHONPATH=path)
    assert done.returncode == 0, done.stderr
    assert f"written to {folder / 'built' / 'index.html'}" in done.stdout
    return folder / "built"


@dataclass
class Html(HTMLParser):
    """Anchors, links and loaded files of a page."""

    anchors: set[str] = field(default_factory=set)
    links: list[str] = field(default_factory=list)
    loaded: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        super().__init__()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.anchors |= {given[name] for name in ("id", "name") if name in given}
        if tag == "a" and "href" in given:
            self.links.append(given["href"])
        if tag in LOADED and given.get(LOADED[tag]) and given.get("rel") != "canonical":
            self.loaded.append(given[LOADED[tag]])


@pytest.fixture(scope="module")
def html(site: Path) -> dict[Path, Html]:
    found = {}
    for file in sorted(site.rglob("*.html")):
        found[file] = Html()
        found[file].feed(file.read_text(encoding="utf-8"))
    return found


def test_every_link_and_anchor_leads_somewhere(site: Path, html: dict[Path, Html]) -> None:
    assert len(html) > 40
    lost = []
    for file, page in html.items():
        if file.name == "404.html":
            continue  # its links are those of a server's root
        for link in page.links:
            to = urlsplit(link)
            if to.scheme or to.netloc:
                continue
            target = (file.parent / unquote(to.path)).resolve() if to.path else file
            target = target / "index.html" if target.is_dir() else target
            known = html[target].anchors if target in html else None
            if not target.is_file() or (to.fragment and known is not None and unquote(to.fragment) not in known):
                lost.append(f"{file.relative_to(site)}: {link}")
    assert lost == []


def test_nothing_is_loaded_from_elsewhere(site: Path, html: dict[Path, Html]) -> None:
    loaded = [(file, url) for file, page in html.items() for url in page.loaded]
    assert len(loaded) > 100
    assert [(file.name, url) for file, url in loaded if re.match(r"(https?:)?//", url)] == []
    for style in site.rglob("*.css"):
        assert re.findall(r"(?:url\(|@import)\s*[\"']?(?:https?:)?//[^)\"']+", style.read_text(encoding="utf-8")) == []


def test_no_page_is_longer_than_one_sitting(generator: Any) -> None:
    pages = {file.name: file.read_text(encoding="utf-8") for file in ROOT.glob("docs/**/*.md")} | generator.generated()
    assert len(pages) > 40
    assert {name: length for name, text in pages.items() if (length := text.count("\n")) > LONGEST} == {}


def test_every_setting_and_parameter_is_in_the_reference(generator: Any) -> None:
    pages = generator.generated()
    settings = re.findall(r"^\| `(\w+)` \|", pages["reference/settings.md"], re.MULTILINE)
    assert settings == [entry.name for entry in fields(Settings)]
    nodes = import_module("irsbot_supervisor.nodes.recorder"), import_module("irsbot_supervisor.nodes.supervisor")
    wanted = {entry.name for entry in fields(Simulation)} | {name for node in nodes for name in node.PARAMETERS}
    assert wanted <= set(re.findall(r"^\| `([\w.]+)` \|", pages["reference/parameters.md"], re.MULTILINE))


def test_every_message_and_service_is_in_the_reference(generator: Any) -> None:
    pages = generator.generated()
    for kind, page in (("msg", "messages"), ("srv", "services")):
        files = {file.stem for file in (SRC / "irsbot_msgs" / kind).glob(f"*.{kind}")}
        assert files
        assert files == set(re.findall(r"^## (\w+)$", pages[f"reference/{page}.md"], re.MULTILINE))


def test_every_node_of_the_suite_is_in_the_reference(generator: Any) -> None:
    page = generator.generated()["reference/interfaces.md"]
    suite = import_module("irsbot_supervisor.nodes.suite")
    assert set(suite.NODES) <= set(re.findall(r"^## (\w+)$", page, re.MULTILINE))
    assert "`supervisor/follow_joint_trajectory`" in page
    assert "`supervisor/bypass`" in page
    assert {name.strip("`") for name in re.findall("`/[^`]+`", page)} == {"/diagnostics", "/tf"}  # these do not move


def test_every_command_and_option_is_in_the_reference(generator: Any) -> None:
    text = "\n".join(text for place, text in generator.generated().items() if place.startswith("reference/commands/"))
    told = set(re.findall(r"^## irsbot (.+)$", text, re.MULTILINE))
    shown = CliRunner().invoke(whole_app(), ["--help"]).stdout
    alone = set(re.findall(r"^  ([a-z-]+)  ", shown.split("Commands:")[1], re.MULTILINE))
    groups = {"send", "design", "algebra"}
    assert {name for name in told if " " not in name} == alone - groups
    assert {name.split()[0] for name in told if " " in name} == groups
    for command in ("replay", "docs"):
        options = set(re.findall(r"(--[a-z-]+)", CliRunner().invoke(whole_app(), [command, "--help"]).stdout))
        assert "--help" in options
        section = text.split(f"## irsbot {command}\n")[1].split("\n## ")[0]
        assert [option for option in options - {"--help"} if option not in section] == []


def test_every_public_name_is_in_the_reference(generator: Any, html: dict[Path, Html]) -> None:
    api = import_module("reference.python_api")
    for name in api.PUBLIC:
        module = import_module(name)
        pages = [page for file, page in html.items() if re.fullmatch(rf"{name}(_\d+)?\.html", file.name)]
        anchors = set().union(*(page.anchors for page in pages))
        assert {public for public in getattr(module, "__all__", ()) if public.lower() not in anchors} == set(), name


def test_a_term_of_the_glossary_has_one_meaning_and_a_source() -> None:
    text = (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("| **")]
    rows = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines]
    terms = [row[0].strip("*").lower() for row in rows]
    assert len(terms) > 50
    assert sorted(set(terms)) == sorted(terms)
    assert [row[0] for row in rows if len(row) != 3 or not all(row)] == []
    keys = set(re.findall(r"\b(S[0-4])\b", text))
    sources = (ROOT / "docs" / "explanation" / "sources.md").read_text(encoding="utf-8")
    assert keys <= set(re.findall(r"^\| (S\d),", sources, re.MULTILINE))


def test_the_search_knows_the_pages(site: Path) -> None:
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))
    places = {entry["location"].partition("#")[0] for entry in index["docs"]}
    assert {"index.html", "glossary.html", "reference/settings.html", "explanation/guarantee.html"} <= places


def test_a_folder_with_other_files_is_not_emptied(tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    done = irsbot("docs", "--no-open", "--out", str(tmp_path))
    assert done.returncode == 2
    assert "holds other files" in done.stderr
    assert len(done.stderr.splitlines()) == 1
    assert (tmp_path / "mine.txt").read_text() == "mine"
