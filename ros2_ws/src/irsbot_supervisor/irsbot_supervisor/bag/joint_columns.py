"""Joint states as columns: many messages of one layout are decoded at once, without an object for each."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import Any, overload

import numpy as np
from numpy.typing import NDArray

from irsbot_msgs_py.cdr_places import JointStateLayout, joint_state_layout
from irsbot_msgs_py.records import JointSample
from irsbot_msgs_py.stamps import NS_PER_S

Times = NDArray[np.int64]
Values = NDArray[np.float64]

SHORTEST = 32
"""Number of neighbouring messages of one layout from which columns cost less than objects."""


@dataclass(frozen=True, eq=False)
class JointColumns:
    """Consecutive joint states with the same names and the same fields.

    names: of the joints.
    stamp_ns, received_ns, seen_ns: (N,) as in `JointSample`.
    position: (N, n) rad or m.
    velocity: (N, n) rad/s or m/s, or (N, 0).
    effort: (N, n) N m or N, or (N, 0).
    """

    names: tuple[str, ...]
    stamp_ns: Times
    received_ns: Times
    seen_ns: Times
    position: Values
    velocity: Values
    effort: Values

    def __len__(self) -> int:
        return len(self.stamp_ns)

    def __getitem__(self, rows: slice) -> JointColumns:
        """Some of the rows; no numbers are copied."""
        return JointColumns(self.names, *(column[rows] for column in self._columns))

    def sample(self, row: int) -> JointSample:
        """One row as a record."""
        stamp, received, seen, *values = (column[row] for column in self._columns)
        position, velocity, effort = (tuple(value.tolist()) for value in values)
        return JointSample(int(stamp), int(received), int(seen), self.names, position, velocity, effort)

    def samples(self) -> Iterator[JointSample]:
        """All rows as records."""
        columns = (column.tolist() for column in self._columns)
        for stamp, received, seen, position, velocity, effort in zip(*columns, strict=True):
            yield JointSample(stamp, received, seen, self.names, tuple(position), tuple(velocity), tuple(effort))

    def of_joints(self, names: tuple[str, ...]) -> JointColumns:
        """The columns of some joints, in the order of `names`. Raises ValueError for a joint that is not there."""
        order = [self.names.index(name) for name in names]

        def selected(columns: Values) -> Values:
            whole = not columns.shape[1] or order == list(range(columns.shape[1]))
            return columns if whole else np.ascontiguousarray(columns[:, order])

        times = self.stamp_ns, self.received_ns, self.seen_ns
        return JointColumns(names, *times, *map(selected, (self.position, self.velocity, self.effort)))

    @property
    def kind(self) -> tuple[Any, ...]:
        """What columns that are joined have in common."""
        return self.names, self.position.shape[1], self.velocity.shape[1], self.effort.shape[1]

    @property
    def _columns(self) -> tuple[NDArray[Any], ...]:
        return self.stamp_ns, self.received_ns, self.seen_ns, self.position, self.velocity, self.effort


def joined(parts: Sequence[JointColumns]) -> JointColumns:
    """Columns of one kind as one."""
    columns = zip(*(part._columns for part in parts), strict=True)
    return JointColumns(parts[0].names, *(np.concatenate(column) for column in columns))


def columns_of(samples: Sequence[JointSample]) -> JointColumns:
    """Samples of one kind as columns; at least one."""
    stamp, received, seen, _names, position, velocity, effort = zip(*samples, strict=True)
    columns: list[NDArray[Any]] = [np.array(column, np.int64) for column in (stamp, received, seen)]
    columns += [np.array(column, float).reshape(len(samples), -1) for column in (position, velocity, effort)]
    return JointColumns(samples[0].names, *columns)


class JointSamples(Sequence[JointSample]):
    """Joint states in the order of recording; records are made when they are asked for."""

    def __init__(self, samples: Sequence[JointSample] = ()) -> None:
        self._parts: list[JointColumns | list[JointSample]] = []
        self._starts: list[int] = []
        self._count = 0
        self.extend(samples)

    def extend(self, samples: Sequence[JointSample]) -> None:
        """Add records at the end."""
        for _kind, group in groupby(samples, _kind_of):
            alike = list(group)
            self._add(columns_of(alike) if len(alike) >= SHORTEST and _is_regular(alike[0]) else alike)

    def append(self, columns: JointColumns) -> None:
        """Add columns at the end."""
        if len(columns):
            self._add(columns)

    @property
    def names(self) -> set[tuple[str, ...]]:
        """All sets of names in the messages."""
        each = ({part.names} if isinstance(part, JointColumns) else {one.names for one in part} for part in self._parts)
        return set().union(*each)

    @property
    def last_ns(self) -> int:
        """Latest time of arrival, steady clock."""
        return max(
            int(part.seen_ns.max()) if isinstance(part, JointColumns) else max(one.seen_ns for one in part)
            for part in self._parts
        )

    def compact(self) -> None:
        """Join neighbouring columns of one kind."""
        parts, self._parts, self._starts, self._count = self._parts, [], [], 0
        for _kind, group in groupby(parts, lambda part: part.kind if isinstance(part, JointColumns) else None):
            alike = list(group)
            columns = [part for part in alike if isinstance(part, JointColumns)]
            if columns:
                self._add(joined(columns))
            for part in alike:
                if not isinstance(part, JointColumns):
                    self.extend(part)

    @property
    def parts(self) -> Sequence[JointColumns | list[JointSample]]:
        """Columns, and records that are in none."""
        return self._parts

    def _add(self, part: JointColumns | list[JointSample]) -> None:
        last = self._parts[-1] if self._parts else None
        if isinstance(last, list) and isinstance(part, list):
            last += part
            self._count += len(part)
            return
        self._parts.append(part)
        self._starts.append(self._count)
        self._count += len(part)

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[JointSample]:
        for part in self._parts:
            yield from part.samples() if isinstance(part, JointColumns) else part

    @overload
    def __getitem__(self, index: int) -> JointSample: ...

    @overload
    def __getitem__(self, index: slice) -> list[JointSample]: ...

    def __getitem__(self, index: int | slice) -> JointSample | list[JointSample]:
        if isinstance(index, slice):
            return [self[row] for row in range(*index.indices(self._count))]
        row = index + self._count if index < 0 else index
        if not 0 <= row < self._count:
            raise IndexError(f"sample {index} of {self._count}")
        place = bisect_right(self._starts, row) - 1
        part, inside = self._parts[place], row - self._starts[place]
        return part.sample(inside) if isinstance(part, JointColumns) else part[inside]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and list(self) == list(other)

    __hash__ = None  # type: ignore[assignment]


def _kind_of(sample: JointSample) -> tuple[Any, ...]:
    return sample.names, len(sample.position), len(sample.velocity), len(sample.effort)


def _is_regular(sample: JointSample) -> bool:
    count = len(sample.names)
    return len(sample.position) == count and {len(sample.velocity), len(sample.effort)} <= {0, count}


class ColumnDecoder:
    """Decodes messages of one topic; it remembers their layout."""

    def __init__(self) -> None:
        self._layout: JointStateLayout | None = None
        self._first = b""

    def decode(self, raw: NDArray[np.uint8], log_ns: Times) -> JointColumns | None:
        """Messages of equal size, one per row of `raw` (N, bytes), recorded at log_ns (N,); None if they have different
        layouts or contradict themselves. Raises CdrError for a first message that is no JointState."""
        if self._layout is None or len(self._first) != raw.shape[1] or not self._fits(raw[:1]):
            self._first = raw[0].tobytes()
            self._layout = joint_state_layout(self._first)
        layout = self._layout
        counts = {(part.stop - part.start) // 8 for part in (layout.velocity, layout.effort)}
        width = (layout.position.stop - layout.position.start) // 8
        if width != len(layout.names) or not counts <= {0, width} or not self._fits(raw):
            return None
        seconds = _numbers(raw, slice(layout.seconds, layout.seconds + 4), "<i4")[:, 0].astype(np.int64)
        rest = _numbers(raw, slice(layout.nanoseconds, layout.nanoseconds + 4), "<u4")[:, 0]
        values = (_numbers(raw, part, "<f8") for part in (layout.position, layout.velocity, layout.effort))
        return JointColumns(layout.names, seconds * NS_PER_S + rest, log_ns, log_ns, *values)

    def _fits(self, raw: NDArray[np.uint8]) -> bool:
        """True if all messages have the lengths and texts of the learned layout."""
        assert self._layout is not None
        first = np.frombuffer(self._first, np.uint8)
        return all((raw[:, part] == first[part]).all() for part in self._layout.fixed)


def _numbers(raw: NDArray[np.uint8], part: slice, code: str) -> NDArray[Any]:
    """Numbers of a field, (N, count), in native order."""
    size = np.dtype(code).itemsize
    found = np.ascontiguousarray(raw[:, part]).view(code) if part.stop > part.start else np.empty((len(raw), 0), code)
    return found.astype(found.dtype.newbyteorder("="), copy=False) if size else found
