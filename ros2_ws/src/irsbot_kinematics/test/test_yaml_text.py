"""Texts in YAML: shipped ones say what the plain reader of PyYAML reads; a wrong one of a user is one sentence."""

from __future__ import annotations

from importlib import resources
from math import inf
from pathlib import Path

import pytest
import yaml

from irsbot_kinematics import BadInput
from irsbot_kinematics.description.yaml_text import parsed, shipped

FILES = sorted(Path(str(resources.files("irsbot_kinematics"))).rglob("*.yaml"))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_a_shipped_file_says_the_same_to_every_reader(file: Path) -> None:
    text = file.read_text(encoding="utf-8")
    assert shipped(text) == parsed(text) == yaml.safe_load(text)


@pytest.mark.parametrize("read", [parsed, shipped])
def test_numbers_are_read_as_ros_reads_them(read) -> None:
    text = "[1e-2, 5E3, -.5e+1, 1.0e-2, .inf, 7, 1e, e5, 1_000]"
    assert read(text) == [0.01, 5000.0, -5.0, 0.01, inf, 7, "1e", "e5", 1000]


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        pytest.param("[" * 3000, "nested too deeply", id="deep"),
        ("a: [", "expected"),
        ("a: 2024-13-45", "month must be in"),
        pytest.param("1" * 5000, "digits", id="long"),
        ("a: !!python/object:os.system x", "could not determine a constructor"),
        (b"\xc3(", "byte"),
        ("a: 1\nb: 2\na: 3", "the key 'a' stands twice"),
        ("- {l1: 1, l1: 2}", "the key 'l1' stands twice"),
        ("!!map [1, 2]", "expected a mapping"),
    ],
)
def test_what_cannot_be_read_is_refused_in_one_line_with_the_file(text: str | bytes, reason: str) -> None:
    with pytest.raises(BadInput, match=r"mine\.yaml: not YAML: ") as refused:
        parsed(text, Path("mine.yaml"))
    assert reason in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_merged_mapping_may_be_replaced() -> None:
    """By YAML's own rule for the key <<."""
    text = (
        "usual: &usual {stop: 0.1, warn: 0.2}\nfast: &fast {latency: 0.004}\nmine: {<<: *usual, <<: *fast, stop: 0.3}"
    )
    assert parsed(text)["mine"] == {"stop": 0.3, "warn": 0.2, "latency": 0.004}
