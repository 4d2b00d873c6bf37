"""What a worker is given for one bag, and the line that comes out of it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from irsbot_kinematics import BadInput
from irsbot_kinematics.description import json_text
from irsbot_supervisor.bag.errors import BagError
from irsbot_supervisor.configuration.loading import read_values
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.fleet.folder import key_of, python_files, robot_files, tubes_files
from irsbot_supervisor.replay.judgement import story_file, story_of

SHOWN_FAULTS = 20
"""Differences per check that are kept in words; all are counted."""


@dataclass(frozen=True)
class Options:
    """How bags are judged, as on the command line of `irsbot replay`; files by absolute paths."""

    robot: str | None = None
    settings: str | None = None
    namespace: str | None = None
    topic: str | None = None
    mechanisms: tuple[str, ...] | None = None


@dataclass(frozen=True)
class BagJob:
    """One bag to judge. name: as the user gave it. path: absolute, as every worker sees it. samples, page: whether the
    table of samples and the page are wanted."""

    name: str
    path: str
    options: Options
    samples: bool = False
    page: bool = False

    @cached_property
    def key(self) -> str:
        """A hash of everything that the result depends on: bag, files beside it, options, version.

        Raises OSError if a file cannot be read.
        """
        return key_of(f"{self.name}\0{json.dumps(asdict(self.options))}", _files(Path(self.path), self.options))


@dataclass(frozen=True)
class BagCheck:
    """One thing that a bag was compared with. count: of the differences. faults: the first of them, in words."""

    name: str
    count: int
    faults: tuple[str, ...]


@dataclass(frozen=True)
class BagRow:
    """One bag of a fleet in one line. The times count from its first joint state.

    bag: as the user gave it.
    error: why it could not be judged; then nothing below is known.
    robot: for which it was judged, and how that is known.
    samples: joint states that were judged.
    seconds: length of the run, s.
    worst: level that was the worst after work began; empty if it never began.
    margin: the one that came nearest to its stop limit; empty if no posture was known.
    value, stop_limit: of that margin there, 0..1.
    margin_time_s: when that was, s.
    stops: times that STOP or UNKNOWN ended work.
    false_stops: those beyond the expectation of the bag; None if it has none.
    unseen: joint states in the bag that never reached a supervisor.
    missing: samples that a supervisor saw and that are not in the bag.
    damage: of the file; empty if it is whole.
    checks: what it was compared with.
    """

    bag: str
    error: str = ""
    robot: str = ""
    samples: int = 0
    seconds: float = 0.0
    worst: str = ""
    margin: str = ""
    value: float | None = None
    stop_limit: float | None = None
    margin_time_s: float | None = None
    stops: int = 0
    false_stops: int | None = None
    unseen: int = 0
    missing: int = 0
    damage: str = ""
    checks: tuple[BagCheck, ...] = ()

    @property
    def lost(self) -> int:
        """Joint states that are not judged or not recorded."""
        return self.unseen + self.missing

    @property
    def differences(self) -> int:
        return sum(check.count for check in self.checks)

    @property
    def result(self) -> str:
        """'same', 'differs' or 'not judged'."""
        return "not judged" if self.error else "differs" if self.differences else "same"

    def as_json(self) -> dict[str, Any]:
        """Every field, and what follows from them."""
        return {**asdict(self), "lost": self.lost, "differences": self.differences, "result": self.result}

    def to_text(self) -> str:
        """The fields as JSON; `row_from_text` reads it."""
        return json.dumps(asdict(self))


def row_from_text(text: str) -> BagRow:
    """The row that `to_text` wrote. Raises ValueError, TypeError or KeyError for something else."""
    stated = json_text.parsed(text)
    checks = tuple(BagCheck(one["name"], one["count"], tuple(one["faults"])) for one in stated["checks"])
    return BagRow(**{**stated, "checks": checks})


@dataclass(frozen=True)
class Fleet:
    """Figures of a fleet in all."""

    rows: tuple[BagRow, ...]

    def as_json(self) -> dict[str, Any]:
        """Counts and sums over the bags, and the bag with the worst margin."""
        judged = [row for row in self.rows if not row.error]
        worst = self.worst
        return {
            "bags": len(self.rows),
            "same": sum(row.result == "same" for row in self.rows),
            "differ": sum(row.result == "differs" for row in self.rows),
            "not_judged": len(self.rows) - len(judged),
            "samples": sum(row.samples for row in judged),
            "seconds": sum(row.seconds for row in judged),
            "stops": sum(row.stops for row in judged),
            "false_stops": sum(row.false_stops or 0 for row in judged),
            "lost": sum(row.lost for row in judged),
            "damaged": sum(bool(row.damage) for row in judged),
            "worst_bag": worst.bag if worst else None,
        }

    @property
    def worst(self) -> BagRow | None:
        """The bag whose margin is the lowest over its stop limit, or the farthest below it."""
        known = [
            (row.value - row.stop_limit, row)
            for row in self.rows
            if row.value is not None and row.stop_limit is not None
        ]
        return min(known, key=lambda entry: entry[0])[1] if known else None


def _files(bag: Path, options: Options) -> Iterator[Path]:
    """Every file that may decide how a bag is judged."""
    if bag.is_dir():
        yield from _regular(bag.iterdir())
    else:
        yield bag
        yield from filter(None, [story_file(bag)])
    named = [bag] if options.mechanisms is None else [Path(name) for name in options.mechanisms]
    yield from _regular([*python_files(named), *named])
    yield from robot_files(options.robot) if options.robot else []
    with suppress(BagError, InvalidSettings, BadInput):  # a file that is refused where the bag is judged
        yield from _of_settings(options)
        yield from _of_expectation(bag)


def _of_settings(options: Options) -> Iterator[Path]:
    if options.settings:
        yield from _regular([Path(options.settings)])
        yield from tubes_files(read_values(Path(options.settings)))


def _of_expectation(bag: Path) -> Iterator[Path]:
    expectation = story_of(bag)
    if expectation is not None and expectation.assumption is not None:
        yield from robot_files(str(expectation.assumption.robot))
        yield from tubes_files(expectation.assumption.settings)


def _regular(files: Iterable[Path]) -> list[Path]:
    return sorted(file for file in files if file.is_file())
