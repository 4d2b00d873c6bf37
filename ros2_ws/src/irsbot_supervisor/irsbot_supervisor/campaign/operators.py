"""What operators and their scripts may do to a running supervisor: transitions, parameters and resets, at random and
by the thousand. No crash, no leak, and every answer is the one that is due.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, fields
from math import inf, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from irsbot_msgs_py.records import Cause, Level
from irsbot_supervisor.campaign.rows import Job, Row, Tally
from irsbot_supervisor.core.limits import settings_from
from irsbot_supervisor.core.settings import InvalidSettings, Settings
from irsbot_supervisor.settings_file import read_settings
from irsbot_supervisor.suite import SUPERVISOR, Node, Suite, free_domain

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.campaign.peer import Peer

LIFECYCLE = "lifecycle"
LIFECYCLE_MUST = "random transitions: every request is answered, only an active node speaks, 0 crashes, leak < 1 MB"
PARAMETERS = "parameters-dds"
PARAMETERS_MUST = "random sets: refused or in force as a whole, as the settings themselves say, 0 crashes, leak < 1 MB"
RESETS = "resets-at-once"
RESETS_MUST = "1000 calls at once: an active cause is never reset, a stop is reset once, 0 crashes, leak < 1 MB"

LEAK_MB = 1.0
WARM_UP = 0.2
"""Share of the cases after which memory counts: heaps and histories grow at first."""

GROWTH = "memory [MB]"

GOOD, NEAR = [0.0, -0.85], [0.0, -1.17]
"""m: a pose far from every singularity, and one beyond the stop limit of `CAUTIOUS`."""

CAUTIOUS = {"type2_stop": 0.4, "type2_warn": 0.5, "acceleration_limit": [10.0]}
"""A robot beyond these limits is still far enough from the singularity: it may stand there when they are lowered. Its
drives are slow, so that samples that wait behind a thousand calls are no reason to stop it."""

AT_ONCE = 1000
"""Calls without waiting for an answer."""


@contextmanager
def _supervised(tally: Tally, pose: list[float], settings: dict[str, Any] | None = None) -> Iterator[Peer]:
    """A supervisor of a robot at rest; whether it lives at the end is counted."""
    from irsbot_supervisor.campaign.peer import Peer

    domain = free_domain()
    with (
        TemporaryDirectory(prefix="irsbot-operators-") as folder,
        Suite(Path(folder), domain) as suite,
        Peer(suite, domain) as peer,
    ):
        suite.start(Node("supervisor", SUPERVISOR, settings or {}))
        suite.start(Node("robot", "irsbot_supervisor.campaign.flood_source", {"pose": pose}))
        peer.listen()
        peer.until(lambda: peer.verdicts and not peer.verdicts[-1].causes & Cause.NO_DATA, "the robot is judged")
        yield peer
        code = suite.end("supervisor")
        said = (Path(folder) / "supervisor.log").read_text()
        crashed = code != 0 or "Traceback" in said
        tally.many(0, failed=crashed, note=f"exit code {code}: {said[-300:]}" if crashed else "")
        internal = any(verdict.causes & Cause.INTERNAL for verdict in peer.verdicts)
        tally.many(0, failed=internal, note="an error inside" if internal else "")


class _Memory:
    """What the supervisor has gained since it was warm."""

    def __init__(self, peer: Peer, tally: Tally, amount: int) -> None:
        self._peer, self._tally, self._warm = peer, tally, int(WARM_UP * amount)
        self._begin = nan

    def after(self, case: int) -> None:
        if case == self._warm:
            self._begin = self._peer.resident_mb("supervisor")

    def judge(self) -> None:
        growth = self._peer.resident_mb("supervisor") - self._begin
        self._tally.largest(GROWTH, growth)
        self._tally.many(0, failed=not growth < LEAK_MB, note="" if growth < LEAK_MB else f"grew by {growth:.2f} MB")


def run_lifecycle(job: Job) -> Row:
    """The row: a case is a request for a transition, possible or not. Shutting down is left out: it is the end."""
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    ways = {  # state: transitions that it has, and where they lead
        "unconfigured": {Transition.TRANSITION_CONFIGURE: "inactive"},
        "inactive": {Transition.TRANSITION_CLEANUP: "unconfigured", Transition.TRANSITION_ACTIVATE: "active"},
        "active": {Transition.TRANSITION_DEACTIVATE: "inactive"},
    }
    requests = [*{way for state in ways.values() for way in state}, Transition.TRANSITION_CREATE, 99]
    tally, rng, state = Tally(LIFECYCLE, job), random.Random(job.seed), "active"
    with _supervised(tally, GOOD) as peer:
        memory, change = _Memory(peer, tally, job.amount), peer.client(ChangeState, "supervisor/change_state")
        for case in range(job.amount):
            wish = rng.choice(requests if rng.random() < 0.5 else list(ways[state]))
            request = ChangeState.Request()
            request.transition.id = wish
            due, fault = ways[state].get(wish), ""
            if peer.ask(change, request).success != (due is not None):
                fault = f"transition {wish} in state {state}: answered wrongly"
            state = due or state
            peer.until(_silent(peer) if state != "active" else _speaking(peer), f"what a node does that is {state}")
            peer.verdicts.clear()
            tally.case(failed=fault)
            memory.after(case)
        memory.judge()
    return tally.row()


def _speaking(peer: Peer) -> Callable[[], bool]:
    return lambda: peer.node.count_publishers("supervisor/verdict") > 0


def _silent(peer: Peer) -> Callable[[], bool]:
    return lambda: peer.node.count_publishers("supervisor/verdict") == 0


def run_parameters(job: Job) -> Row:
    """The row: a case is a set of up to three parameters in one call, most of them nonsense."""
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    tally, rng = Tally(PARAMETERS, job), random.Random(job.seed)
    settings, robot = read_settings("irsbot2")
    free = [entry for entry in fields(Settings) if not entry.metadata.get("read_only")]
    with _supervised(tally, GOOD) as peer:
        memory = _Memory(peer, tally, job.amount)
        client = peer.client(SetParametersAtomically, "supervisor/set_parameters_atomically")
        for case in range(job.amount):
            values = {entry.name: _value(rng, entry, settings) for entry in rng.sample(free, rng.randint(1, 3))}
            parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
            result = peer.ask(client, SetParametersAtomically.Request(parameters=parameters)).result
            try:
                due = settings_from({**asdict(settings), **values}, robot) if _same_types(settings, values) else None
            except InvalidSettings:
                due = None
            fault = "" if result.successful == (due is not None) else f"{values}: answered {result.successful}"
            fault = fault or ("" if result.successful or result.reason else f"{values}: refused without a reason")
            settings = due or settings
            tally.add("accepted", due is not None)
            tally.case(failed=fault)
            memory.after(case)
        start = len(peer.verdicts)
        peer.until(lambda: len(peer.verdicts) > start + 3, "verdicts")
        hashed = peer.verdicts[-1].config_hash == settings.config_hash
        tally.many(0, failed=not hashed, note="" if hashed else "other settings are in force than were accepted")
        memory.judge()
    return tally.row()


def _value(rng: random.Random, entry: Any, settings: Settings) -> Any:
    """Something for a setting: near its value, at the edge of its range, or nonsense."""
    now, low, high = getattr(settings, entry.name), entry.metadata.get("low"), entry.metadata.get("high")
    if entry.metadata.get("words"):
        return rng.choice([*entry.metadata["words"], "", "maybe"])
    choices = [nan, inf, -inf, 1e308, -1.0, 0.0, 5e-324, low, high, rng.uniform(low, high)]
    if isinstance(now, tuple):
        size = rng.choice((len(now), len(now), 1, 3))
        return [rng.choice([*choices, now[0], now[0]]) for _ in range(size)]
    return rng.choice([*choices, now * rng.uniform(0.8, 1.25), now * rng.uniform(0.8, 1.25), "word", 3])


def _same_types(settings: Settings, values: dict[str, Any]) -> bool:
    """A parameter keeps the type it was declared with: that is for ROS to see, before anybody looks at the value."""
    return all(isinstance(value, (list, type(getattr(settings, name)))) for name, value in values.items())


def run_resets(job: Job) -> Row:
    """The row: a case is a call, AT_ONCE of them without waiting for answers, on a robot that stands at a stop, then on
    one that stands well with a stop latched. Event numbers are right and wrong in turn."""
    tally, rng = Tally(RESETS, job), random.Random(job.seed)
    half = max(job.amount // 2, 1)
    with _supervised(tally, NEAR, CAUTIOUS) as peer:
        peer.until(lambda: peer.verdicts[-1].latched, "a stop")
        event = peer.verdicts[-1].event
        memory = _Memory(peer, tally, half)
        accepted = _reset(peer, tally, half, event, rng, memory)
        if accepted or not peer.verdicts[-1].latched:
            tally.case(unsafe=f"{accepted} resets of a cause that is still there")
        memory.judge()
        _move_limits_away(peer)
        accepted = _reset(peer, tally, job.amount - half, event, rng, None)
        tally.many(0, failed=accepted != 1, note="" if accepted == 1 else f"one stop was reset {accepted} times")
        # A pause of the machine may have stopped the robot again: that is another stop.
        peer.until(lambda: not peer.verdicts[-1].latched or peer.verdicts[-1].event != event, "the stop ends")
    return tally.row()


def _move_limits_away(peer: Peer) -> None:
    """The stop limits are lowered: the robot may stand where it stands, the stop stays latched."""
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    values = {f"{kind}_{what}": 0.01 for kind in ("type1", "type2", "constraint") for what in ("stop", "warn")}
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    client = peer.client(SetParametersAtomically, "supervisor/set_parameters_atomically")
    assert peer.ask(client, SetParametersAtomically.Request(parameters=parameters)).result.successful
    before = peer.verdicts[-1].config_hash
    peer.until(lambda: peer.verdicts[-1].config_hash != before or peer.verdicts[-1].latched, "the new limits")
    start = len(peer.verdicts)
    peer.until(lambda: len(peer.verdicts) > start + 20, "the causes have lapsed")
    assert peer.verdicts[-1].level == Level.STOP, f"a change of settings must not end a stop: {peer.verdicts[-1].text}"


def _reset(peer: Peer, tally: Tally, number: int, event: int, rng: random.Random, memory: _Memory | None) -> int:
    """How many calls were accepted; a wrong event number never may be."""
    from irsbot_msgs.srv import ResetStop

    client, accepted, done = peer.client(ResetStop, "supervisor/reset"), 0, 0
    while done < number:
        events = [rng.choice((event, event, event + 1000, 0)) for _ in range(min(AT_ONCE, number - done))]
        answers = [client.call_async(ResetStop.Request(event=e, operator_text="x" * 50)) for e in events]
        for answer in answers:
            peer.until(answer.done, "all answers")
        for e, answer in zip(events, answers, strict=True):
            yes = answer.result().accepted
            accepted += yes
            tally.case(unsafe=f"event {e} was reset, {event} is latched" if yes and e != event else "")
            if memory is not None:
                memory.after(done)
            done += 1
    return accepted
