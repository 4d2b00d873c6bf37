"""The glossary: every term has a source that exists, and the page that defines it uses it."""

from __future__ import annotations

import re
from pathlib import Path
from typing import NamedTuple

import pytest

DOCS = Path(__file__).parents[1] / "docs"
PAGE = DOCS / "glossary.md"
GENERATED = {"reference/settings.md"}
"""Pages that are made when the site is built."""

pytestmark = pytest.mark.skipif(not PAGE.is_file(), reason="installed without the source tree")


class Row(NamedTuple):
    """A line of the glossary."""

    terms: list[str]
    meaning: str
    source: str


def rows() -> list[Row]:
    lines = [line for line in PAGE.read_text(encoding="utf-8").splitlines() if line.startswith("| **")]
    cells = [[cell.strip() for cell in line.strip("| ").split(" | ")] for line in lines]
    return [Row(terms.strip("*").lower().split(", "), meaning, source) for terms, meaning, source in cells]


def works() -> set[str]:
    """Keys of the table of works, and those of the papers."""
    table = PAGE.read_text(encoding="utf-8").split("## Works")[1].split("| --- | --- |")[1]
    papers = (DOCS / "explanation" / "sources.md").read_text(encoding="utf-8")
    return {*re.findall(r"^\| (\w[^|]*?) \|", table, re.MULTILINE), *re.findall(r"^\| (S\d),", papers, re.MULTILINE)}


def linked(row: Row) -> tuple[str, str]:
    """Page and anchor of the definition of a term of ours."""
    (page, anchor), *others = re.findall(r"\]\(([^)#]+)#?([^)]*)\)", row.source)
    assert others == []
    return page, anchor


def anchors(text: str) -> set[str]:
    """Those of the headings, as the site makes them."""
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    return {re.sub(r"[\s-]+", "-", re.sub(r"[^\w\s-]", "", heading).strip().lower()) for heading in headings}


OURS = [row for row in rows() if row.source.startswith("irsbot: ")]


def test_a_term_of_the_field_names_a_listed_work() -> None:
    known = works()
    assert len(known) > 15
    others = [row for row in rows() if row not in OURS]
    assert len(others) > 20
    assert [row.terms for row in others if not known & set(re.split(r", | and ", row.source))] == []


def test_every_listed_work_is_cited() -> None:
    cited = {key for row in rows() for key in re.split(r", | and ", row.source)}
    assert {key for key in works() if not re.fullmatch(r"S\d", key)} - cited == set()


@pytest.mark.parametrize("row", OURS, ids=lambda row: row.terms[0])
def test_the_page_that_defines_a_term_uses_it(row: Row) -> None:
    page, anchor = linked(row)
    if page in GENERATED:
        return
    text = (DOCS / page).read_text(encoding="utf-8")
    assert not anchor or anchor in anchors(text)
    plain = " ".join(text.lower().replace("*", "").split())
    assert [term for term in row.terms if term not in plain] == []
