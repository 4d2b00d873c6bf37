"""Fewer rows of a table without hiding an extreme value: every smallest and largest value and every break stays."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from irsbot_kinematics.numerics.arithmetic import Array

ROWS = 6000
"""About how many rows of a table are kept: more than a screen has columns of pixels."""

Rows = NDArray[np.intp]


def kept_rows(columns: Sequence[Array], breaks: Rows, most: int = ROWS) -> Rows:
    """Rows of a table to keep, ascending: all if there are no more than `most`.

    Else the table is cut into parts of equal length. In each part, the rows of the smallest and of the largest value of
    each column stay, and the first row that is not finite, so that no gap is bridged. The first and the last row stay,
    and both sides of every break. columns: (N,) each, of one length. breaks: rows before which nothing is known for a
    while.
    """
    count = len(columns[0])
    if count <= most:
        return np.arange(count)
    stretches = max(most // (2 * len(columns)), 1)
    edges = np.linspace(0, count, stretches + 1).astype(int)
    found = [np.array([0, count - 1]), breaks, breaks - 1]
    for column in columns:
        known = np.isfinite(column)
        low, high = np.where(known, column, np.inf), np.where(known, column, -np.inf)
        for begin, end in pairwise(edges.tolist()):
            part = [low[begin:end].argmin(), high[begin:end].argmax(), known[begin:end].argmin()]
            found.append(begin + np.array(part))
    rows: Rows = np.unique(np.concatenate(found))
    return rows[(rows >= 0) & (rows < count)]


def rows_of_places(poses: Array, margins: Array, most: int = ROWS) -> Rows:
    """One row for every visited place, the one with its smallest margin: no part of a path is left out.

    poses: (N, m), margins: (N,), both NaN if not known. Places are cells of a grid, as fine as `most` rows allow.
    """
    known = np.flatnonzero(np.isfinite(poses).all(axis=1))
    if not len(known):
        return known
    low, span = poses[known].min(axis=0), np.ptp(poses[known], axis=0)
    for cells in (512, 256, 128, 64, 32, 16, 8):
        places = np.floor((poses[known] - low) / np.where(span > 0.0, span, 1.0) * cells).astype(np.int64)
        keys = places @ (cells + 1) ** np.arange(poses.shape[1])
        order = np.lexsort((margins[known], keys))
        first = np.unique(keys[order], return_index=True)[1]
        if len(first) <= most:
            break
    rows: Rows = known[order[first]]
    return rows


def breaks_in(times: Array, longest_s: float) -> Rows:
    """Rows before which no row came for longer than this. times: (N,) s."""
    return np.flatnonzero(~(np.diff(times) <= longest_s)) + 1
