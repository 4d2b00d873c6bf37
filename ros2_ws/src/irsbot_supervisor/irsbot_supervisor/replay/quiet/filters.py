"""Filters over many samples that give what the estimator's filters give one after another, bit for bit."""

from __future__ import annotations

from collections.abc import Sequence
from math import floor

import numpy as np
from numpy.typing import NDArray

from irsbot_supervisor.bag.joint_columns import Times, Values
from irsbot_supervisor.core.estimation.sample_interval import SecondLargestMemory

Rows = NDArray[np.intp]
"""Numbers of rows."""


def column_of(values: Sequence[float]) -> Values:
    """Numbers of the n joints as a column, (n, 1), for arrays (n, N)."""
    return np.array(values)[:, np.newaxis]


def kept_from(stamps: Times, row: Rows, window_ns: int, begin: int) -> Rows:
    """First row that is kept after each row: the last one that is at least a window old, but never the row itself.

    stamps: of all rows. row: (N,) consecutive ones. begin: no row before it is kept.
    """
    found = np.searchsorted(stamps, stamps[row] - window_ns, side="right") - 1
    return np.clip(found, begin, row - 1)


def growing(most: Values, gains: Values, begin: tuple[float, ...]) -> tuple[Values, Values]:
    """Bounds x_k = min(x_(k-1) + gain_k, most_k) of every row, and those of the rows before; both (n, N).

    most, gains: (n, N). begin: (n,) bounds before the first row. The bound of one row reaches the next ones as long as
    it is lower than theirs: the rows are lowered until none changes.
    """
    found = most
    while True:
        before = np.concatenate([column_of(begin), found[:, :-1]], axis=1)
        lower = np.minimum(before + gains, most)
        if np.array_equal(lower, found, equal_nan=True):
            return found, before
        found = lower


def second_largest(
    seen: Times, values: Values, span_ns: float, state: SecondLargestMemory
) -> tuple[Values, Times, Values]:
    """`SecondLargest.second` for many values, and its state after each.

    seen: (N,) ns, increasing. values: (N,). span_ns: length of a span. state: before the first value. Returns the
    second largest (N,); the begin of the span (N,), ns; and (N, 4) largest and second-largest of this span and of the
    one before.
    """
    since_ns, (a, b), (c, d) = state
    since_ns = int(seen[0]) if since_ns is None else since_ns
    count, at = len(seen), 0
    since, largest = np.empty(count, np.int64), np.empty((count, 4))
    while at < count:
        late_ns = int(seen[at]) - since_ns
        if late_ns > span_ns:
            c, d = (a, b) if late_ns <= 2.0 * span_ns else (0.0, 0.0)
            a, b, since_ns = 0.0, 0.0, int(seen[at])
        end = max(int(np.searchsorted(seen, since_ns + floor(span_ns), side="right")), at + 1)
        part, rows = values[at:end], slice(at, end)
        most = np.maximum(np.maximum.accumulate(part), a)
        earlier = np.concatenate([[a], most[:-1]])
        largest[rows, 0], largest[rows, 2], largest[rows, 3], since[rows] = most, c, d, since_ns
        largest[rows, 1] = np.maximum(np.maximum.accumulate(np.minimum(part, earlier)), b)
        (a, b), at = largest[end - 1, :2].tolist(), end
    a_s, b_s, c_s, d_s = largest.T
    return np.where(a_s >= c_s, np.maximum(b_s, c_s), np.maximum(a_s, d_s)), since, largest
