"""Schemes against a supervisor: how the joints approach a limit, and when they are let loose.

Every scheme has a lead, which is first run alone. Then it is repeated and the joints are let loose at a moment of it:
the best moment is right after the last sample before the supervisor's STOP.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple

import numpy as np

from irsbot_supervisor.validation.harness.oracle import Array
from irsbot_supervisor.validation.in_process.edges import Edge, walk
from irsbot_supervisor.validation.in_process.hostile import DrivenMotion, Push

LEAD_S = 0.06
"""s that a lead takes at most."""
HARDEST = 20.0
"""1: hardest slowing down of a joint before a stop, as a multiple of its acceleration."""
NEAR = 0.05
"""1: least relative distance of the published margin from its stop limit at which a creeping joint is let loose."""


class Scheme(NamedTuple):
    """A lead and a moment in it."""

    start: Array  # (n,) at rest
    lead: tuple[Push, ...]
    lead_s: float
    before: int = 1  # the attack begins so many samples before the lead is stopped; at `lead_s` if it is not
    near: float = -inf  # or as soon as less than this is published above the limit, relative to it
    early_s: float = 0.0  # s that it takes from where the robot was switched on, before time 0
    first: int = -1  # or so many samples after the first one that is allowed


Kind = Callable[[Edge, np.random.Generator], Scheme]


def creep(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Move down the steepest descent at 2 to 15 % of full speed."""
    speeds = rng.uniform(0.02, 0.15) * edge.down * edge.settings.velocity_limit
    near = rng.uniform(0.0, NEAR) if rng.random() < 0.3 else -inf
    return _arriving(edge, (Push(0.0, speeds, rng.uniform(0.1, 1.0)),), rng, near=near)


def rest(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Stand close to a limit."""
    return Scheme(edge.place, (), rng.uniform(0.0, 0.01))


def at_once(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Begin in the first samples that are allowed, from rest or creeping."""
    lead: tuple[Push, ...] = ()
    if rng.random() < 0.5:
        lead = (Push(-0.03, rng.uniform(0.02, 0.1) * edge.down * edge.settings.velocity_limit),)
    start = edge.place - (DrivenMotion(edge.place, lead, edge.settings).at(np.zeros(1))[0][0] - edge.place)
    return Scheme(start, lead, 0.01, first=int(rng.integers(0, 3)))


def chatter(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Alternate full acceleration and hard braking, on the whole towards the limit."""
    full, t = edge.down * edge.settings.velocity_limit, 0.0
    lead: list[Push] = []
    while t < LEAD_S:
        toward = 1.0 if rng.random() < 0.8 else -1.0
        lead.append(Push(t, toward * full))
        t += rng.uniform(0.001, 0.006)
        lead.append(Push(t, 0.0 * full, hardness=rng.uniform(1.0, HARDEST)))
        t += rng.uniform(0.0005, 0.004)
    return _arriving(edge, tuple(lead), rng)


def feint(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Move towards the limit, brake as if to stop, then go on."""
    full, brake_s = edge.down * edge.settings.velocity_limit, rng.uniform(0.01, 0.03)
    go, brake = Push(0.0, rng.uniform(0.05, 0.6) * full), Push(brake_s, 0.0 * full, hardness=rng.uniform(0.3, 3.0))
    return _arriving(edge, (go, brake), rng, brake_s + rng.uniform(0.001, 0.02))


def reversal(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Move away from the limit, then back as soon as possible."""
    away = Push(0.0, -rng.uniform(0.05, 1.0) * edge.down * edge.settings.velocity_limit)
    return Scheme(edge.place, (away,), rng.uniform(0.001, 0.008))


def bang(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Switch randomly between full speeds, all joints at once or each by itself."""
    full, t = np.array(edge.settings.velocity_limit), 0.0
    lead: list[Push] = []
    together = rng.random() < 0.5
    now = np.sign(edge.down) * full
    while t < LEAD_S:
        signs = (1.0 if rng.random() < 0.6 else -1.0) if together else rng.choice((-1.0, 1.0), len(full))
        now = (
            signs * np.sign(edge.down) * full
            if together or not lead
            else np.where(rng.random(len(full)) < 0.5, now, signs * full)
        )
        lead.append(Push(t, now, hardness=1.0 if rng.random() < 0.5 else rng.uniform(1.0, HARDEST)))
        t += rng.uniform(0.001, 0.008)
    return _arriving(edge, tuple(lead), rng, before=int(rng.integers(0, 3)))


def crossing(edge: Edge, rng: np.random.Generator) -> Scheme:
    """Move fast along the limit and a little towards it, then into it."""
    along = rng.standard_normal(len(edge.down))
    along -= edge.down * (along @ edge.down) / (edge.down @ edge.down)
    size = np.abs(along).max()
    driven = (along / size if size > 1e-6 else 0.0 * along) + rng.uniform(0.05, 0.3) * edge.down
    speeds = rng.uniform(0.3, 1.0) * driven / np.abs(driven).max() * edge.settings.velocity_limit
    return _arriving(edge, (Push(0.0, speeds),), rng)


SCHEMES: tuple[Kind, ...] = (creep, rest, at_once, chatter, feint, reversal, bang, crossing)


def from_afar(edge: Edge, scheme: Scheme) -> Scheme:
    """The same after a slow motion from the base of an edge to the begin of the scheme."""
    start, pushes, seconds = walk(edge, scheme.start)
    return scheme._replace(start=start, lead=(*pushes, *scheme.lead), early_s=seconds)


def _arriving(
    edge: Edge,
    lead: tuple[Push, ...],
    rng: np.random.Generator,
    lead_s: float = LEAD_S,
    near: float = -inf,
    before: int | None = None,
) -> Scheme:
    """A lead that would pass the edge after some part of its time."""
    when = np.array([rng.uniform(0.2, 1.0) * lead_s])
    start = edge.place - (DrivenMotion(edge.place, lead, edge.settings).at(when)[0][0] - edge.place)
    return Scheme(start, lead, lead_s, int(rng.choice((1, 1, 1, 2, 3, 5))) if before is None else before, near)
