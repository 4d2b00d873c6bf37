"""Joint states as columns: the same records as those read one by one, in every mixture of layouts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from irsbot_msgs_py.records import JointSample, Level
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.bag_writer import BagWriter
from irsbot_supervisor.bag.column_reader import Columns
from irsbot_supervisor.bag.joint_columns import JointColumns, JointSamples
from irsbot_supervisor.replay.levels import Levels

NAMES = ("a", "b")


def random_samples(seed: int, count: int) -> list[JointSample]:
    """Runs of samples with the same layout, and single ones with others, some of which do not fit their names."""
    random, found = np.random.default_rng(seed), list[JointSample]()
    while len(found) < count:
        names = NAMES if random.random() < 0.7 else ("b", "joint_with_a_longer_name")
        sizes = (2, int(random.choice([0, 2, 2, 2, 2, 1])), int(random.choice([0, 0, 2])))
        for _ in range(int(random.choice([1, 3, 200, 900]))):
            values = [tuple(random.normal(size=size).tolist()) for size in sizes]
            stamp_ns = int(random.integers(0, 2**60))
            times = stamp_ns, 10**18 + len(found), 10**18 + len(found)
            found.append(JointSample(*times, names, *values))
    return found


@pytest.mark.parametrize("compression", ["", "zstd"])
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("mixed", [False, True])
def test_columns_of_a_bag_are_its_records(tmp_path: Path, compression: str, seed: int, mixed: bool) -> None:
    samples, target = random_samples(seed, 6000), tmp_path / "run.mcap"
    with BagWriter(target, compression=compression) as writer:
        for number, sample in enumerate(samples):
            writer.add("joint_states", sample, sample.seen_ns)
            if mixed and number % 3 == 0:
                writer.add("supervisor/journal", f"line {number}", sample.seen_ns)
    read, texts, wide = JointSamples(), [], 0
    with Bag(target) as bag:
        for entry in bag.columns():
            if isinstance(entry, Columns):
                read.append(entry.joints)
                wide += len(entry.joints)
            elif isinstance(entry.record, JointSample):
                read.extend([entry.record])
            else:
                texts.append(entry.record)
        assert not bag.loss
    with Bag(target) as bag:
        assert [entry.record for entry in bag.records() if isinstance(entry.record, JointSample)] == samples
    assert wide > 0
    assert texts == ([f"line {number}" for number in range(0, len(samples), 3)] if mixed else [])
    for _ in range(2):
        assert list(read) == samples
        assert [read[0], read[1234], read[-1]] == [samples[0], samples[1234], samples[-1]]
        assert read[100:1000:7] == samples[100:1000:7]
        read.compact()
    assert any(isinstance(part, JointColumns) and len(part) > 500 for part in read.parts)


def test_levels_in_runs_are_those_of_a_dictionary() -> None:
    random, levels, expected = np.random.default_rng(1), Levels(), dict[tuple[int, int], tuple[Level, int]]()
    for part in range(3):
        number = 1
        for _ in range(200):
            found = Level(int(random.integers(0, 2))), int(random.integers(0, 2))
            numbers = [number + k + (k > 4 and random.random() < 0.2) for k in range(int(random.integers(1, 9)))]
            numbers = sorted({*numbers})
            levels.add(part, numbers, found)
            expected.update({(part, one): found for one in numbers})
            number = numbers[-1] + int(random.integers(1, 3))
    assert dict(levels) == expected
    assert len(levels) == len(expected)
    assert levels.get((0, 10**6)) is None
    assert levels == expected
    assert levels != {**expected, (0, 1): (Level.STOP, 0)}
