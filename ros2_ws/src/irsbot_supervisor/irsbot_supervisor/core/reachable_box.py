"""Motion of the joints until they stand: the reachable box of the stopping theorem, docs/explanation/guarantee.md.

Per joint: it accelerates with at most a, up to V. From the time T at which the brakes act it slows down with at least d
until it stands. From a speed v forward it moves by at most

    t1 = min((V - v)/a, T),  v1 = min(v + a T, V),  s = v t1 + a t1^2/2 + V (T - t1) + v1^2/(2 d)

forward, also if it brakes harder, earlier or in another order, or turns round.
"""

from __future__ import annotations

from irsbot_msgs_py.records import Floats
from irsbot_supervisor.core.estimation.estimate import Speeds
from irsbot_supervisor.core.settings import Settings


class ReachableBox:
    """Applies the limits of the drives."""

    def __init__(self, settings: Settings) -> None:
        self._limits = tuple(
            zip(settings.acceleration_limit, settings.velocity_limit, settings.deceleration_limit, strict=True)
        )
        self._error, self._jitter_s = position_error(settings), settings.stamp_jitter_s
        self._recovery = recovery_speeds(settings)
        self.errors = self.errors_at(settings.velocity_limit)
        """rad or m: largest error of a joint position at the time of its stamp."""

    def errors_at(self, rates: Floats) -> Floats:
        """rad or m: the same of joints at these rates, rad/s or m/s."""
        return tuple([self._error + self._jitter_s * abs(rate) for rate in rates])

    def until_rest(self, speeds: Speeds, free_s: float) -> tuple[list[float], list[float]]:
        """rad or m forward and backward until the joints stand, if the brakes act after `free_s`."""
        forward, backward = [], []
        for up, down, (gain, fastest, brake) in zip(speeds.forward, speeds.backward, self._limits, strict=True):
            forward.append(_until_rest(up, gain, fastest, brake, free_s))
            backward.append(forward[-1] if up == down else _until_rest(down, gain, fastest, brake, free_s))
        return forward, backward

    def recovering(self, free_s: float) -> list[float]:
        """rad or m in each direction until joints stand that move at recovery speed."""
        limits = zip(self._recovery, self._limits, strict=True)
        return [rate * free_s + 0.5 * rate * rate / brake for rate, (_gain, _fastest, brake) in limits]

    def slowly(self, span_s: float) -> list[float]:
        """rad or m: largest displacement of each joint within a time at recovery speed."""
        return [rate * span_s for rate in self._recovery]

    def following(self, rates: Floats, first_s: float, last_s: float) -> tuple[list[float], list[float]]:
        """rad or m: lowest and highest displacements of joints that keep their rates and brake together between
        `first_s` and `last_s`: from `first_s` on until they stand."""
        low, high = [], []
        for rate, (_gain, _fastest, brake) in zip(rates, self._limits, strict=True):
            begin, end = rate * first_s, rate * last_s + 0.5 * rate * abs(rate) / brake
            low.append(min(begin, end))
            high.append(max(begin, end))
        return low, high

    def going(self, speeds: Speeds, free_s: float) -> tuple[list[float], list[float]]:
        """rad or m forward and backward within `free_s`."""
        limits = zip(speeds.forward, speeds.backward, self._limits, strict=True)
        ways = [
            (_going(up, gain, fastest, free_s)[0], _going(down, gain, fastest, free_s)[0])
            for up, down, (gain, fastest, _brake) in limits
        ]
        return [up for up, _ in ways], [down for _, down in ways]

    def longest(self, span_s: float) -> list[float]:
        """rad or m: largest displacement of each joint within a time."""
        return [fastest * span_s for _gain, fastest, _brake in self._limits]

    def stop_s(self, speeds: Speeds, free_s: float) -> float:
        """s until the last joint stands, if the brakes act after `free_s`."""
        fastest = zip(map(max, speeds.forward, speeds.backward), self._limits, strict=True)
        return free_s + max([_going(v, gain, most, free_s)[1] / brake for v, (gain, most, brake) in fastest])


def _going(v: float, gain: float, fastest: float, free_s: float) -> tuple[float, float]:
    """Displacement, and speed at its end. A joint that already exceeds its limit keeps its speed."""
    if v >= fastest:
        return v * free_s, v
    faster_s = (fastest - v) / gain
    if faster_s >= free_s:
        return (v + 0.5 * gain * free_s) * free_s, v + gain * free_s
    return (v + 0.5 * gain * faster_s) * faster_s + fastest * (free_s - faster_s), fastest


def _until_rest(v: float, gain: float, fastest: float, brake: float, free_s: float) -> float:
    way, last = _going(v, gain, fastest, free_s)
    return way + 0.5 * last * last / brake


def position_error(settings: Settings) -> float:
    """rad or m: largest error of a measured joint position."""
    return 0.5 * settings.encoder_resolution + settings.encoder_offset


def recovery_speeds(settings: Settings) -> Floats:
    """rad/s or m/s: up to these speeds joints count as moving at recovery speed."""
    return tuple([settings.recovery_share * fastest + settings.standstill_speed for fastest in settings.velocity_limit])
