"""The state of a running suite as text for a terminal of at least 80 by 24 characters."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite

from rich.console import Group, RenderableType
from rich.text import Text

from irsbot_msgs_py.records import Level, SingularityState, cause_names
from irsbot_supervisor.core.margins import MARGIN_CAUSES, MARGIN_NAMES, MARGIN_TEXTS
from irsbot_supervisor.processes.observed import Seen
from irsbot_supervisor.replay.run_summary import margin_of

STYLES = {
    Level.OK: "black on green",
    Level.WARN: "black on yellow",
    Level.STOP: "bold white on red",
    Level.UNKNOWN: "bold white on magenta",
}
BAR = 40
"""Letters of a bar from 0 to 1."""

WIDTH = 80
EVENTS = 6


def screen(seen: Seen, now_s: float) -> RenderableType:
    """Level, margins as bars against their limits, motion, rates and ages, the newest changes."""
    lines = [*_head(seen), Text(), *_margins(seen), *_motion(seen.state), Text(), *_times(seen), Text("changes")]
    lines += [_change(seen, place, now_s) for place in range(max(len(seen.changes) - EVENTS, 0), len(seen.changes))][
        ::-1
    ]
    for line in lines:
        line.truncate(WIDTH, overflow="ellipsis")
    return Group(*lines)


def _head(seen: Seen) -> list[Text]:
    verdict = seen.verdict
    style = STYLES[seen.level]
    big = " ".join(seen.level.name).center(WIDTH)
    head = [Text(" " * WIDTH, style), Text(big, style), Text(" " * WIDTH, style)]
    if verdict is None:
        return [*head, Text("no verdict has come: a consumer brakes"), Text(), Text()]
    robot = seen.state.robot if seen.state else ""
    stop = f"stop {verdict.event} is latched" if verdict.latched else "nothing latched"
    late = "" if seen.level == verdict.level else f"last verdict {verdict.level.name}, too old; "
    facts = f"{robot}  configuration {verdict.config_hash[:12]}  {stop}, speed up to {verdict.speed_scale:.0%}"
    return [*head, Text(facts), Text(f"{late}{cause_names(verdict.causes) or 'no cause'}"), Text(verdict.text)]


def _margins(seen: Seen) -> list[Text]:
    """One line for each margin; margins that the robot does not have stay empty, so that the layout is constant."""
    lines = []
    for kind, name in zip(MARGIN_CAUSES, MARGIN_NAMES, strict=True):
        value = margin_of(seen.state, kind) if seen.state else float("nan")
        limits = [seen.limits.get(f"{name}_{which}") for which in ("stop", "warn")]
        line = Text(f"{MARGIN_TEXTS[kind]:<18}")
        if isfinite(value):
            line.append(f"{value:6.4f} ")
            line.append_text(bar(value, limits))
            line.append(f" stop {limits[0]:g}" if limits[0] is not None else "")
        else:
            line.append("not known" if kind.name == "TYPE2" else "-", "dim")
        lines.append(line)
    state = seen.state
    if state is not None and isfinite(state.stop_margin):
        left = f", braking begins in {state.time_to_stop:.3f} s" if isfinite(state.time_to_stop) else ""
        lines.append(Text(f"until standstill  {state.stop_margin:6.4f}, limit {state.stop_limit:g}{left}"))
    else:
        lines.append(Text("until standstill  not known"))
    return lines


def bar(value: float, limits: Sequence[float | None]) -> Text:
    """A margin, 0 to 1, with its stop limit | and warning limit :, coloured by the limit that it has crossed."""
    stop, warn = limits
    colour = (
        "red"
        if stop is not None and not value >= stop
        else "yellow"
        if warn is not None and not value >= warn
        else "green"
    )
    drawn = Text()
    for place in range(BAR):
        mark = next(
            (sign for limit, sign in ((stop, "|"), (warn, ":")) if limit is not None and int(limit * BAR) == place), ""
        )
        filled = place < round(value * BAR)
        drawn.append(mark or ("█" if filled else "·"), "bold" if mark else colour if filled else "dim")
    return drawn


def _motion(state: SingularityState | None) -> list[Text]:
    if state is None:
        return [Text("joints  not known"), Text("pose    not known")]
    return [
        Text("joints  " + "  ".join(f"{q:.4f}" for q in state.joint_position)),
        Text("pose    " + "  ".join(f"{x:.4f}" for x in state.pose)),
    ]


def _times(seen: Seen) -> list[Text]:
    state = seen.state
    states = f"states {seen.state_hz:5.0f} Hz, {_age(seen.state_age_s)}"
    verdicts = f"verdicts {seen.verdict_hz:4.0f} Hz, {_age(seen.verdict_age_s)}"
    sample = f"sample {state.sample_age * 1e3:.1f} ms old" if state else ""
    if state is not None and isfinite(state.compute_time):
        sample += f", computing {state.compute_time * 1e3:.2f} ms"
    return [Text(f"{states}; {verdicts}"), Text(sample)]


def _age(age_s: float) -> str:
    return f"last {age_s:.2f} s ago" if isfinite(age_s) else "never heard"


def _change(seen: Seen, place: int, now_s: float) -> Text:
    change = seen.changes[place]
    line = Text(f"{now_s - change.time_s:8.2f} s ago ")
    line.append(f"{change.level.name:<8}", STYLES[change.level])
    return line.append(f" {cause_names(change.causes)}: {change.text}" if change.causes else "")
