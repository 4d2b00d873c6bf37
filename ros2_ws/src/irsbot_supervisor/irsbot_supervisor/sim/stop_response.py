"""Stop-response policy of a consumer: motion needs a fresh verdict that allows it."""

from __future__ import annotations

from irsbot_msgs_py.records import Level
from irsbot_supervisor.sim.errors import BadSetting


class StopResponse:
    """Turns verdicts into the allowed share of speed. Silence, STOP, UNKNOWN and invalid values mean brake."""

    def __init__(self, timeout_s: float, gated: bool = False) -> None:
        """timeout_s: how long a verdict is valid. gated: commands come through the command gate, which limits their
        speed and lets a stopped robot move out; a STOP with a speed scale above 0 then allows motion."""
        if not 0.0 < timeout_s < float("inf"):
            raise BadSetting(f"the verdict timeout must be positive and finite, got {timeout_s!r} s")
        self._timeout_ns = round(timeout_s * 1e9)
        self._gated = gated
        self._heard: tuple[int, float] | None = None  # replaced whole: another thread may read it

    def hear(self, level: int, speed_scale: float, now_ns: int) -> None:
        """Take in a verdict; steady clock."""
        moving = (Level.OK, Level.WARN, Level.STOP) if self._gated else (Level.OK, Level.WARN)
        allows = level in moving and 0.0 < speed_scale <= 1.0
        self._heard = (now_ns, (1.0 if self._gated else speed_scale) if allows else 0.0)

    def allowed(self, now_ns: int) -> float:
        """Share of full speed that is allowed now, 0..1; 0 means brake.

        A verdict that arrived after `now_ns` is valid as long as one before: a consumer may catch up after a stall.
        """
        if self._heard is None:
            return 0.0
        heard_ns, scale = self._heard
        return scale if abs(now_ns - heard_ns) <= self._timeout_ns else 0.0
