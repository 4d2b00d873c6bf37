"""The short version of tests/campaigns/kinematics.py: the same statements on a thousandth of the work."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

CAMPAIGNS = Path(__file__).parents[4] / "tests" / "campaigns"

pytestmark = pytest.mark.skipif(not CAMPAIGNS.is_dir(), reason="the repository is not around the package")


@pytest.fixture(scope="module")
def results():
    sys.path.insert(0, str(CAMPAIGNS))
    try:
        import kinematics  # type: ignore[import-not-found]
    finally:
        sys.path.remove(str(CAMPAIGNS))
    return {result.name: result for result in kinematics.run(quick=True, seed=5)}


PARTS = ["round trip", "margins", "loci", "guarantees", "geometry", "sharp", "clearances"]


@pytest.mark.parametrize("part", PARTS)
def test_the_campaign_passes(results, part):
    result = results[part]
    assert result.cases >= 600
    assert result.wrong == 0
    assert result.worst < 1e-9
    assert result.passed


def test_the_campaign_has_no_other_parts(results):
    assert list(results) == PARTS
