"""JUnit reports of judged bags, as CI systems read them."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from irsbot_supervisor.fleet.records import BagCheck


class Suite(NamedTuple):
    """One bag. error: why there was nothing to check."""

    name: str
    checks: Sequence[BagCheck]
    error: str = ""


def write_junit(path: Path, suites: Sequence[Suite]) -> None:
    """A suite per bag, with one test case per check."""
    found = [_element(suite) for suite in suites]
    root = found[0]
    if len(found) > 1:
        counts: dict[str, Any] = {
            name: str(sum(int(one.get(name, "0")) for one in found)) for name in ("tests", "failures", "errors")
        }
        root = ElementTree.Element("testsuites", name="irsbot.replay", **counts)
        root.extend(found)
    ElementTree.ElementTree(root).write(path, encoding="unicode", xml_declaration=True)


def _element(suite: Suite) -> ElementTree.Element:
    failures, errors = sum(bool(check.count) for check in suite.checks), int(bool(suite.error))
    counts: dict[str, Any] = {
        "tests": str(len(suite.checks) + errors),
        "failures": str(failures),
        "errors": str(errors),
    }
    found = ElementTree.Element("testsuite", name=suite.name, **counts)
    for check in suite.checks:
        case = ElementTree.SubElement(found, "testcase", classname="irsbot.replay", name=check.name)
        if check.count:
            ElementTree.SubElement(case, "failure", message=check.faults[0]).text = "\n".join(check.faults)
    if suite.error:
        case = ElementTree.SubElement(found, "testcase", classname="irsbot.replay", name="replay")
        ElementTree.SubElement(case, "error", message=suite.error)
    return found
