"""Platforms on rods of any place and direction, closed by Newton's method in small steps.

Nothing here is taken from the library. Rod i holds the platform at arm c_i; its near end is moved and its length is
changed at will. The platform starts at 0, not turned.
"""

from __future__ import annotations

from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEPS, NEWTON = 10, 5
CLOSE = 1e-8  # of a length: an error after which one more step of Newton's leaves rounding alone


class Machine(NamedTuple):
    """n rods in the plane (m = 2) or in space (m = 3); the platform turns about z if n = m + 1."""

    r: Array
    """(n, m) unit directions, near end to platform."""
    attachments: Array
    """(n, 2) m; 0 where the platform cannot turn."""
    length: Array
    """(n,) m"""

    @property
    def turns(self) -> bool:
        return self.r.shape[0] > self.r.shape[1]

    @property
    def posture(self) -> SimpleNamespace:
        """Screws and arms as a posture has them."""
        attachments = tuple(map(tuple, self.attachments.tolist())) if self.turns else ()
        return SimpleNamespace(
            screws=tuple(map(tuple, rows(self, self.r, self.attachments).tolist())), attachments=attachments
        )

    @property
    def diameter(self) -> float:
        return float(np.linalg.norm(self.attachments[:, None] - self.attachments[None], axis=2).max())


class Met(NamedTuple):
    """N postures."""

    move: Array
    """(N, m) m, of the platform point"""
    turn: Array
    """(N,) rad"""
    r: Array
    """(N, n, m) unit directions"""
    type2: Array
    """(N,) smallest cosine of a pressure angle"""

    def rod_turns(self, machine: Machine) -> Array:
        """(N, n) rad"""
        chords: Array = np.linalg.norm(self.r - machine.r, axis=2)
        return 2.0 * np.arcsin(np.minimum(0.5 * chords, 1.0))


def closed(machine: Machine, shift: Array, longer: Array, elsewhere: Array | float = 0.0) -> Met:
    """The branch that starts at the machine as it is. shift: (N, n, m) m, of the near ends; longer: (N, n) m;
    elsewhere: (N, n, 2) m, of the places where the rods hold the platform as it is."""
    m = machine.r.shape[1]
    pose = np.zeros((len(shift), machine.r.shape[0]))
    for share in np.linspace(0.0, 1.0, STEPS + 1)[1:]:
        for _ in range(NEWTON):
            rods, held = _rods(machine, pose, share * shift, share * elsewhere)
            sizes = np.linalg.norm(rods, axis=2)
            error = sizes - machine.length - share * longer
            pose = pose - np.linalg.solve(rows(machine, rods / sizes[..., None], held), error[..., None])[..., 0]
            if (np.abs(error) < CLOSE * machine.length).all():
                break
    rods, held = _rods(machine, pose, shift, elsewhere)
    sizes = np.linalg.norm(rods, axis=2)
    assert np.abs(sizes - machine.length - longer).max() < 1e-11 * machine.length.max(), "the branch is lost"
    r = rods / sizes[..., None]
    twists = np.swapaxes(np.linalg.inv(rows(machine, r, held)), 1, 2)  # when one rod alone yields by one unit
    speeds = twists[..., :m].copy()
    if machine.turns:
        speeds[..., :2] += twists[..., m:] * np.stack([-held[..., 1], held[..., 0]], axis=2)
    turn = pose[:, m] if machine.turns else np.zeros(len(shift))
    return Met(pose[:, :m], turn, r, 1.0 / np.linalg.norm(speeds, axis=2).max(axis=1))


def units(vectors: Array) -> Array:
    """Vectors (..., m) over their lengths."""
    scaled: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return scaled


def rows(machine: Machine, r: Array, held: Array) -> Array:
    """Screws (..., n, n) of rods along r that hold the platform at `held`."""
    if not machine.turns:
        return r
    moment = held[..., 0] * r[..., 1] - held[..., 1] * r[..., 0]
    return np.concatenate([r, moment[..., None]], axis=-1)


def _rods(machine: Machine, pose: Array, shift: Array, elsewhere: Array | float) -> tuple[Array, Array]:
    """Rods as vectors (N, n, m), arms as they are turned (N, n, 2)."""
    m = machine.r.shape[1]
    turn = pose[:, m] if machine.turns else np.zeros(len(pose))
    c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
    x, y = np.moveaxis(machine.attachments + elsewhere, -1, 0)
    held = np.stack([c * x - s * y, s * x + c * y], axis=2)
    rods = machine.length[:, None] * machine.r + pose[:, None, :m] - shift
    rods[..., :2] += held - machine.attachments
    return rods, held
