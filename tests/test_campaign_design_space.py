"""A short run of campaigns/design_space.py: random designs against brute force."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import numpy as np

SCRIPT = Path(__file__).parent / "campaigns/design_space.py"


def campaign():
    spec = importlib.util.spec_from_file_location("campaign_design_space", SCRIPT)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_random_designs_agree_with_the_scan_of_the_torus_and_the_joint_grid():
    report = campaign().campaign(12, seed=7)
    assert report.designs == 12
    assert report.postures > 25
    assert (report.wrong_counts, report.unmatched, report.zone_wrong) == (0, 0, 0)
    assert report.zone_unresolved < 0.1 * report.zone_answers


def test_the_campaign_sees_a_wrong_count_a_missing_posture_and_a_wrong_zone(monkeypatch):
    module = campaign()
    d = module.random_designs(6, seed=3)
    found = module.scan(d)
    assert module.compare_counts(d, found) == (0, 0)
    fewer = module.Scan(found.owner[1:], found.psi[1:])
    assert module.compare_counts(d, fewer) == (1, 1)
    exact = module.evaluate_questions
    monkeypatch.setattr(
        module, "evaluate_questions", lambda d: {n: type(a)(a.smaller, a.larger) for n, a in exact(d).items()}
    )
    with np.errstate(invalid="ignore"):  # infinite slack, now of the other sign
        assert module.compare_zones(d, found)[1] > 6
