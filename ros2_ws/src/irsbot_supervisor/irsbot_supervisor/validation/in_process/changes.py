"""Random changes of settings while supervising: each is applied as a whole or refused in the call, and none ends a
stop."""

from __future__ import annotations

from dataclasses import asdict, fields
from math import inf, nan
from typing import Any

import numpy as np

from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.core.events import Configure
from irsbot_supervisor.core.settings import InvalidSettings, Settings
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally
from irsbot_supervisor.validation.harness.stream import ROBOTS, WARM_UP, InputStream

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
"""Number of settings changed at once."""
LATCHED = 0.3
"""Share of the changes during a latched stop."""
HARMLESS = ("load_force_n", "payload_kg", "load_moment_nm", "gravity_m_s2", "reaction_limit_n")
"""Settings of which every value in the range is valid, so that half of the changes should be accepted."""
LEAST_OF_EACH = 0.1
"""1: least share of changes that are accepted, and of those that are refused: else the other half was not tried."""


def run(job: Job) -> Row:
    """The row: a case is a set of changes for a robot at work or a stopped one."""
    tally = Tally(NAME, job)
    tally.figures.update({"accepted": 0.0, "refused": 0.0})
    rng = np.random.default_rng(job.seed)
    streams = [InputStream(name, rng) for name in ROBOTS]
    for k in range(job.amount):
        stream = streams[k % len(streams)]
        if stream.verdict is None or rng.random() < 1.0 / 50.0:
            stream = streams[k % len(streams)] = InputStream(ROBOTS[k % len(streams)], rng)
            stream.run(WARM_UP)
            if rng.random() < LATCHED:
                stream.lose_track()
        values = random_changes(stream.supervisor.settings, rng)
        unsafe, failed = _configure(stream, values, tally)
        where = f"{ROBOTS[k % len(streams)]}, {values}"[:200]
        tally.case(unsafe and f"{where}: {unsafe}", failed and f"{where}: {failed}")
    for answer in ("accepted", "refused"):
        if not tally.figures[answer] >= LEAST_OF_EACH * job.amount:
            tally.many(0, 1, f"only {tally.figures[answer]:.0f} of {job.amount} changes were {answer}")
    return tally.row()


def random_changes(settings: Settings, rng: np.random.Generator) -> dict[str, Any]:
    """Some settings and new values: valid ones, contradictory ones, ones out of range, and meaningless ones."""
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


def _configure(stream: InputStream, changes: dict[str, Any], tally: Tally) -> tuple[str, str]:
    """Apply the changes; returns what was unsafe, and what failed."""
    stream.run(3)
    supervisor = stream.supervisor
    before, verdict = supervisor.settings, stream.verdict
    assert verdict is not None, "a line that runs has a verdict"
    tally.add("while a stop was latched", float(verdict.latched))
    unsafe = failed = ""
    try:
        settings = settings_from({**asdict(before), **changes}, supervisor.robot)
        stream.feed(Configure(stream.received_ns, stream.now_ns, settings))
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
    except Exception as error:  # any other exception breaks the contract of the call
        failed = f"{type(error).__name__}: {error}"
    stream.run(3)
    now = stream.verdict
    assert now is not None, "a verdict once given stays"
    if verdict.latched and not (now.latched and now.event == verdict.event and not stream.moves):
        unsafe = f"a latched stop was ended: {now.level.name}"
    if now.config_hash != supervisor.settings.config_hash:
        failed = failed or "the verdict names other settings than those in force"
    return unsafe, failed


def _is_in_force(now: Any, wanted: Any) -> bool:
    """True if a setting has the requested value: one value for all joints is repeated, empty names and modes are filled
    in, YAML's false is the word none."""
    if wanted is None or wanted in ((), []) or (type(wanted) is int and wanted == 0):
        return True
    if wanted is False and now == "none":
        return True
    each = tuple(wanted) if isinstance(wanted, (list, tuple)) else (wanted,)
    if isinstance(now, tuple):
        return now == each or now == each * len(now)
    return len(each) == 1 and bool(now == each[0])
