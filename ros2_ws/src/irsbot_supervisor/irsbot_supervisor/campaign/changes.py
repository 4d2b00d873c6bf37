"""Random changes of settings while supervising: in force whole or refused in the call, and no stop is ended by one."""

from __future__ import annotations

from dataclasses import asdict, fields
from math import inf, nan
from typing import Any

import numpy as np

from irsbot_supervisor.campaign.line import ROBOTS, WARM_UP, Line
from irsbot_supervisor.campaign.rows import Job, Row, Tally
from irsbot_supervisor.core.limits import settings_from
from irsbot_supervisor.core.pipeline import Configure
from irsbot_supervisor.core.settings import InvalidSettings, Settings

NAME = "settings"
MUST = "in force whole or refused in the call, the old ones stay; no exception, no latch cleared"

NONSENSE: tuple[Any, ...] = (
    nan,
    inf,
    -inf,
    -1.0,
    0.0,
    1e308,
    5e-324,
    True,
    False,
    None,
    "",
    "warn",
    "on",
    b"x",
    10**400,
)
NONSENSE += ((), [], [1.0], [1.0] * 3, [nan, 1.0], [[1.0]], {"a": 1}, {1}, object(), "\N{DEGREE SIGN}" * 1000)
MOST_CHANGED = 4
"""Settings changed at once."""
LATCHED = 0.3
"""Share of the changes that meet a latched stop."""
HARMLESS = ("load_force_n", "payload_kg", "load_moment_nm", "gravity_m_s2", "reaction_limit_n")
"""Settings of which every value in the range is valid: half of the changes are to be accepted ones."""


def run(job: Job) -> Row:
    """The row: a case is a set of changes, given to a robot at work or one that has been stopped."""
    tally = Tally(NAME, job)
    tally.figures.update({"accepted": 0.0, "refused": 0.0})
    rng = np.random.default_rng(job.seed)
    lines = [Line(name, rng) for name in ROBOTS]
    for k in range(job.amount):
        line = lines[k % len(lines)]
        if line.verdict is None or rng.random() < 1.0 / 50.0:
            line = lines[k % len(lines)] = Line(ROBOTS[k % len(lines)], rng)
            line.run(WARM_UP)
            if rng.random() < LATCHED:
                line.lose_track()
        values = random_changes(line.supervisor.settings, rng)
        unsafe, failed = _configure(line, values, tally)
        where = f"{ROBOTS[k % len(lines)]}, {values}"[:200]
        tally.case(unsafe and f"{where}: {unsafe}", failed and f"{where}: {failed}")
    return tally.row()


def random_changes(settings: Settings, rng: np.random.Generator) -> dict[str, Any]:
    """Some settings and their new values: good ones, such as contradict others, such as are out of range, and trash."""
    entries = {entry.name: entry for entry in fields(settings)}
    values: dict[str, Any] = {}
    for _ in range(1 + int(rng.integers(MOST_CHANGED))):
        name = str(rng.choice(HARMLESS)) if rng.random() < 0.4 else str(rng.choice(list(entries)))
        entry, now = entries[name], getattr(settings, name)
        low, high = entry.metadata.get("low"), entry.metadata.get("high")
        match int(rng.integers(8)) if name not in HARMLESS else int(rng.integers(4)):
            case 0 | 1 | 2 if low is not None:
                near = 10.0 ** rng.uniform(-0.3, 0.3)
                old = now if isinstance(now, tuple) else (now,)
                new = [float(min(max(value * near, low), high)) for value in old]
                values[name] = new if isinstance(now, tuple) else new[0]
            case 3 if low is not None and high is not None:
                values[name] = float(rng.uniform(low, high))
            case 4:
                values[name] = now
            case 5:
                values[f"{name}_" if rng.random() < 0.3 else name] = NONSENSE[int(rng.integers(len(NONSENSE)))]
            case 6 if isinstance(now, tuple):
                values[name] = [*now, *now][: int(rng.integers(2 * len(now)))]
            case _:
                values[name] = NONSENSE[int(rng.integers(len(NONSENSE)))]
    return values


def _configure(line: Line, changes: dict[str, Any], tally: Tally) -> tuple[str, str]:
    """Give the changes; what was unsafe, and what failed."""
    line.run(3)
    supervisor = line.supervisor
    before, verdict = supervisor.settings, line.verdict
    assert verdict is not None, "a line that runs has a verdict"
    tally.add("while a stop was latched", float(verdict.latched))
    unsafe = failed = ""
    try:
        settings = settings_from({**asdict(before), **changes}, supervisor.robot)
        line.feed(Configure(line.received_ns, line.now_ns, settings))
        tally.add("accepted")
        for name, value in changes.items():
            if not _is_in_force(getattr(supervisor.settings, name, None), value):
                failed = f"{name} is {getattr(supervisor.settings, name, None)!r} after the change"
        kept = {key: value for key, value in asdict(before).items() if key not in changes}
        if any(getattr(supervisor.settings, key) != value for key, value in kept.items()):
            failed = failed or "a setting changed that was not named"
    except InvalidSettings as error:
        tally.add("refused")
        if supervisor.settings is not before:
            failed = "refused, and the old settings are gone"
        elif not str(error) or "\n" in str(error):
            failed = f"a refusal that says nothing: {error!r}"
    except Exception as error:  # whatever it is, it is not what the call promises
        failed = f"{type(error).__name__}: {error}"
    line.run(3)
    now = line.verdict
    assert now is not None, "a verdict once given stays"
    if verdict.latched and not (now.latched and now.event == verdict.event and not line.moves):
        unsafe = f"a latched stop was ended: {now.level.name}"
    if now.config_hash != supervisor.settings.config_hash:
        failed = failed or "the verdict names other settings than those in force"
    return unsafe, failed


def _is_in_force(now: Any, wanted: Any) -> bool:
    """Whether a setting is what was asked for: one value for all joints is repeated, empty names and modes are filled
    in, YAML's false is the word none."""
    if wanted is None or wanted in ((), []) or (type(wanted) is int and wanted == 0):
        return True
    if wanted is False and now == "none":
        return True
    each = tuple(wanted) if isinstance(wanted, (list, tuple)) else (wanted,)
    if isinstance(now, tuple):
        return now == each or now == each * len(now)
    return len(each) == 1 and bool(now == each[0])
