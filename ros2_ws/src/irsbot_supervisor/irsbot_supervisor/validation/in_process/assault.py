"""One run of adversarial drives against a supervisor, and its result.

The simulated machine: a joint never moves faster than its velocity limit and accelerates with at most its acceleration
limit; it may slow down at any rate. Positions and stamps have errors within their bounds; velocities in the messages
are arbitrary. From the latency after the arrival of the sample that is judged STOP or UNKNOWN, every joint brakes with
its deceleration limit or harder, until it stands. A run counts only if motion was allowed at some time.
"""

from __future__ import annotations

from copy import deepcopy
from itertools import product
from math import ceil, inf
from typing import NamedTuple

import numpy as np

from irsbot_kinematics import Robot
from irsbot_msgs_py.records import Level
from irsbot_supervisor.core.estimation.sample_interval import SETTLING
from irsbot_supervisor.core.supervisor import Supervisor
from irsbot_supervisor.validation.harness.oracle import Array, limits, margins_along
from irsbot_supervisor.validation.in_process.deceit import Attack, Deceit, told
from irsbot_supervisor.validation.in_process.edges import Edge, published, wait_s
from irsbot_supervisor.validation.in_process.hostile import DrivenMotion, Push
from irsbot_supervisor.validation.in_process.schemes import HARDEST, Scheme, from_afar

SHARED = 0.95
"""1: share of the wait for OK that the lead and the attack share."""
RAMPAGE_S = 0.05
"""s for which the joints are let loose if they are not stopped."""
FINE_S = 2.5e-4
"""s between two evaluations of the true margins."""
CLOSE = 0.1
"""1: largest distance of the published margin from its stop limit, relative to it, for an attack that began close to
the limit."""


class Seen(NamedTuple):
    """Verdicts of a supervisor on the samples of a run."""

    allowed: int | None  # first sample with motion allowed
    stop: int | None  # first one after it that was judged STOP or UNKNOWN
    published: dict[int, float]  # of every sample, as `edges.published`


class Outcome(NamedTuple):
    """Result of a run."""

    allowed: bool
    stopped: bool
    close: bool  # the published margin was close to its stop limit when the attack began
    spare: float  # 1: the least margin above its stop limit, relative to it, from the first sample allowed to the end
    rest: float  # the same at rest; NaN if the robot was not stopped


class Run:
    """One edge under attack: the robot stands and is judged, until the lead begins at time 0."""

    def __init__(
        self, robot: Robot, edge: Edge, scheme: Scheme, lie: str, errors: str, rng: np.random.Generator
    ) -> None:
        self._robot, self._edge = robot, edge
        settings, timing = edge.settings, edge.timing
        self._scheme = scheme = from_afar(edge, scheme) if edge.afar else scheme
        self._warm = ceil((wait_s(settings, timing) + scheme.early_s) / timing.period_s)
        self._shared = int((SHARED * SETTLING * settings.stale_s + scheme.early_s) / timing.period_s)
        number = self._warm + ceil((scheme.lead_s + RAMPAGE_S) / timing.period_s) + 2 * timing.burst
        self._deceit = Deceit.drawn(lie, errors, number, len(edge.place), rng)
        driven = DrivenMotion(scheme.start, scheme.lead, settings)
        (first,) = told(driven, self._unaware, self._deceit, timing, settings, self._warm, 0, 1)
        # The first sample determines the branch: where labels are not invariant it may be another one than at the place
        # where the robot really is.
        self._branch = robot.mechanism.posture(first.position, settings.assembly_mode)
        self._begun = Supervisor(settings, robot)
        self._feed(self._begun, driven, self._unaware, 0, self._shared, Seen(None, None, {}))

    @property
    def _unaware(self) -> Attack:
        return Attack(inf, self._edge.down)

    def lead(self) -> Seen:
        """Verdicts on the lead without attack."""
        timing, scheme = self._edge.timing, self._scheme
        last = self._warm + ceil(scheme.lead_s / timing.period_s)
        return self._watch(DrivenMotion(scheme.start, scheme.lead, self._edge.settings), self._unaware, last)

    def moment(self, lead: Seen, share: float) -> tuple[int, float]:
        """The last sample before the attack, and the begin of the attack: after a share of the following period,
        0..1."""
        scheme = self._scheme
        last = self._warm + int(scheme.lead_s / self._edge.timing.period_s)
        if scheme.first >= 0 and lead.allowed is not None:
            last = lead.allowed + scheme.first
        elif lead.allowed is not None and lead.stop is not None:
            last = max(lead.stop - scheme.before, lead.allowed)
        if scheme.near > -inf and lead.allowed is not None:
            near = [k for k, spare in lead.published.items() if lead.allowed <= k < last and 0.0 <= spare < scheme.near]
            last = min([last, *near])
        burst = self._edge.timing.burst
        last = (last + 1) // burst * burst - 1  # motion after the last sample of a burst is detected latest
        return last, self._time_s(last) + share * self._edge.timing.period_s

    def aim(self, last: int, begin_s: float, how: str, rng: np.random.Generator) -> Array:
        """(n,) -1, 0, 1: direction of each joint. how: `slope`, the steepest descent; `worst`, the direction that takes
        most of a margin if the next sample stops it; `any`."""
        n = len(self._edge.place)
        if how == "slope":
            return np.sign(self._edge.down)
        if how == "any":
            return rng.choice((-1.0, 0.0, 1.0), n)
        patterns = [np.array(signs) for signs in product((-1.0, 1.0), repeat=n)]
        return min(
            patterns,
            key=lambda signs: self._judged(self._let_loose(begin_s, signs), last + 1, None, begin_s, begin_s, 4)[0],
        )

    def attack(self, lead: Seen, pushes: tuple[Push, ...], signs: Array, harder: Array | None) -> Outcome:
        """Let the joints loose. pushes: times. signs: first directions. harder: (n,) 1: multiple of the deceleration
        limit with which each joint brakes; None: 1."""
        begin_s = pushes[0].begin_s if pushes else inf
        driven = self._course(pushes)
        last = self._warm + ceil((min(begin_s, self._scheme.lead_s) + RAMPAGE_S) / self._edge.timing.period_s)
        seen = self._watch(driven, Attack(begin_s, signs), last)
        if seen.allowed is None:
            return Outcome(False, False, False, np.nan, np.nan)
        spare, rest = self._judged(driven, seen.stop, harder, self._time_s(seen.allowed), self._time_s(last - 1))
        before = max([k for k in lead.published if self._time_s(k) <= begin_s], default=None)
        near = seen.published.get(before, np.nan) if before is not None else np.nan
        return Outcome(True, seen.stop is not None, bool(near <= CLOSE), spare, rest)

    def _course(self, pushes: tuple[Push, ...]) -> DrivenMotion:
        begin_s = pushes[0].begin_s if pushes else inf
        kept = [push for push in self._scheme.lead if push.begin_s < begin_s]
        return DrivenMotion(self._scheme.start, (*kept, *pushes), self._edge.settings)

    def _let_loose(self, begin_s: float, signs: Array) -> DrivenMotion:
        return self._course((Push(begin_s, signs * self._edge.settings.velocity_limit, hardness=HARDEST),))

    def _judged(
        self,
        driven: DrivenMotion,
        stop: int | None,
        harder: Array | None,
        begin_s: float,
        end_s: float,
        coarser: int = 1,
    ) -> tuple[float, float]:
        """The least distance to a limit from a moment until standstill, and at rest, if sample `stop` stops the robot;
        until `end_s` if none does."""
        settings, timing = self._edge.settings, self._edge.timing
        if stop is not None:
            brake_s = timing.arrival_s(stop, self._warm) + settings.latency_s
            brakes = np.array(settings.deceleration_limit) * (1.0 if harder is None else harder)
            driven, end_s = driven.braked(brake_s, brakes)
        begin_s = min(begin_s, end_s)
        looks = ceil((end_s - begin_s) / (coarser * FINE_S)) + 2
        times: Array = np.linspace(begin_s, end_s, looks, dtype=np.float64)
        stops, way = limits(settings, "stop"), np.concatenate((self._scheme.start[None], driven.at(times)[0]))
        spares = ((margins_along(self._robot, settings, way, self._branch)[1:] - stops) / stops).min(axis=1)
        return float(spares.min()), float(spares[-1]) if stop is not None else np.nan

    def _time_s(self, k: int) -> float:
        """Time of a sample."""
        return (k - self._warm) * self._edge.timing.period_s

    def _watch(self, driven: DrivenMotion, attack: Attack, last: int) -> Seen:
        return self._feed(deepcopy(self._begun), driven, attack, self._shared, last, Seen(None, None, {}))

    def _feed(
        self, supervisor: Supervisor, driven: DrivenMotion, attack: Attack, first: int, last: int, seen: Seen
    ) -> Seen:
        """Feed samples first..last - 1, until motion is forbidden after it was allowed."""
        edge, level = self._edge, Level.UNKNOWN
        allowed = seen.allowed
        samples = told(driven, attack, self._deceit, edge.timing, edge.settings, self._warm, first, last)
        for k, sample in enumerate(samples, first):
            step = supervisor.step(sample)
            seen.published[k] = published(step.state)
            level = level if step.verdict is None else step.verdict.level
            if level < Level.STOP:
                allowed = k if allowed is None else allowed
            elif allowed is not None:
                return Seen(allowed, k, seen.published)
        return Seen(allowed, None, seen.published)
