"""The page of a fleet: figures of all bags, and one line per bag. One file that needs nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from importlib import resources

import jinja2

from irsbot_supervisor.fleet.records import BagRow, Fleet


def fleet_page(rows: Sequence[BagRow], links: Sequence[str]) -> str:
    """The page as HTML text. links: per row, to the page of the bag; empty: there is none."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    package = resources.files("irsbot_supervisor")
    template = package.joinpath("fleet/fleet.html.j2").read_text(encoding="utf-8")
    style = package.joinpath("report/page/page.css").read_text(encoding="utf-8")
    lines = list(zip(rows, links, strict=True))
    return environment.from_string(template).render(lines=lines, total=Fleet(tuple(rows)).as_json(), style=style)
