"""Requests of operators and their scripts to a running supervisor: transitions, parameters and resets, at random and by
the thousand. No crash, no leak, and every answer is correct."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import asdict, fields
from math import inf, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from irsbot_msgs_py.records import Cause
from irsbot_supervisor.configuration.feasibility import settings_from
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import InvalidSettings, Settings
from irsbot_supervisor.processes.suite import SUPERVISOR, Node, Suite, free_domain
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally

if TYPE_CHECKING:  # needs ROS, which the list of rows does not
    from irsbot_supervisor.validation.harness.client import Tester

LIFECYCLE = "lifecycle"
LIFECYCLE_MUST = "random transitions: every request is answered, only an active node speaks, 0 crashes, leak < 1 MB"
PARAMETERS = "parameters-dds"
PARAMETERS_MUST = "random sets: refused or in force as a whole, as the settings themselves say, 0 crashes, leak < 1 MB"
RESETS = "resets-at-once"
TRIES = 3
"""Number of tries of the calls that must end a stop."""

RESETS_MUST = "1000 calls at once: an active cause is never reset, a stop is reset once, 0 crashes, leak < 1 MB"

LEAK_MB = 1.0
WARM_UP = 0.2
"""Share of the cases after which memory counts: heaps and histories grow at first."""

GROWTH = "memory [MB]"

GOOD, HIGH = [0.0, -0.85], [0.0, -0.6]
"""m: poses far from Type 2, where no late sample loses the branch. The second one is beyond the stop limit of
`CAUTIOUS`."""

CAUTIOUS = {"type1_stop": 0.7, "type1_warn": 0.8, "acceleration_limit": [10.0]}
"""Limits that are still far from the singularity: a robot may stand beyond them when they are lowered. Its drives are
slow, so that samples that wait behind a thousand calls do not stop it."""

AT_ONCE = 1000
"""Number of calls without waiting for an answer."""


@contextmanager
def _supervised(tally: Tally, pose: list[float], settings: dict[str, Any] | None = None) -> Iterator[Tester]:
    """A supervisor of a robot at rest; the row counts whether it is alive at the end."""
    from irsbot_supervisor.validation.harness.client import PATIENCE_S, Tester

    domain = free_domain()
    with (
        TemporaryDirectory(prefix="irsbot-operators-") as folder,
        Suite(Path(folder), domain, patience_s=PATIENCE_S) as suite,
        Tester(suite, domain) as tester,
    ):
        suite.start(Node("supervisor", SUPERVISOR, settings or {}))
        suite.start(Node("robot", "irsbot_supervisor.validation.harness.flood_source", {"pose": pose}))
        tester.listen()
        tester.until(lambda: tester.verdicts and not tester.verdicts[-1].causes & Cause.NO_DATA, "the robot is judged")
        yield tester
        code = suite.end("supervisor")
        stated = (Path(folder) / "supervisor.log").read_text()
        crashed = code != 0 or "Traceback" in stated
        tally.many(0, failed=crashed, note=f"exit code {code}: {stated[-300:]}" if crashed else "")
        internal = any(verdict.causes & Cause.INTERNAL for verdict in tester.verdicts)
        tally.many(0, failed=internal, note="an error inside" if internal else "")


class _Memory:
    """Memory that the supervisor has gained since the warm-up."""

    def __init__(self, tester: Tester, tally: Tally, warm: int) -> None:
        """warm: case at which counting begins."""
        self._tester, self._tally, self._warm = tester, tally, warm
        self._begin = nan

    def after(self, case: int) -> None:
        if case == self._warm:
            self._begin = self._tester.resident_mb("supervisor")

    def judge(self) -> None:
        growth = self._tester.resident_mb("supervisor") - self._begin
        self._tally.largest(GROWTH, growth)
        self._tally.many(0, failed=not growth < LEAK_MB, note="" if growth < LEAK_MB else f"grew by {growth:.2f} MB")


def run_lifecycle(job: Job) -> Row:
    """The row: a case is a request for a transition, possible or not. Shutting down is left out, because it ends the
    node."""
    from lifecycle_msgs.msg import Transition
    from lifecycle_msgs.srv import ChangeState

    ways = {  # state: transitions that it has, and where they lead
        "unconfigured": {Transition.TRANSITION_CONFIGURE: "inactive"},
        "inactive": {Transition.TRANSITION_CLEANUP: "unconfigured", Transition.TRANSITION_ACTIVATE: "active"},
        "active": {Transition.TRANSITION_DEACTIVATE: "inactive"},
    }
    requests = [*{way for state in ways.values() for way in state}, Transition.TRANSITION_CREATE, 99]
    tally, rng, state = Tally(LIFECYCLE, job), random.Random(job.seed), "active"
    with _supervised(tally, GOOD) as tester:
        memory = _Memory(tester, tally, int(WARM_UP * job.amount))
        change = tester.client(ChangeState, "supervisor/change_state")
        for case in range(job.amount):
            wish = rng.choice(requests if rng.random() < 0.5 else list(ways[state]))
            request = ChangeState.Request()
            request.transition.id = wish
            due, fault = ways[state].get(wish), ""
            if tester.ask(change, request).success != (due is not None):
                fault = f"transition {wish} in state {state}: answered wrongly"
            state = due or state
            tester.until(
                _silent(tester) if state != "active" else _speaking(tester), f"what a node does that is {state}"
            )
            tester.verdicts.clear()
            tally.case(failed=fault)
            memory.after(case)
        memory.judge()
    return tally.row()


def _speaking(tester: Tester) -> Callable[[], bool]:
    return lambda: tester.node.count_publishers("supervisor/verdict") > 0


def _silent(tester: Tester) -> Callable[[], bool]:
    return lambda: tester.node.count_publishers("supervisor/verdict") == 0


def run_parameters(job: Job) -> Row:
    """The row: a case is a set of up to three parameters in one call, most of them invalid. All calls come twice: some
    settings want more memory than others, so memory counts in the second round."""
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    tally, half = Tally(PARAMETERS, job), (job.amount + 1) // 2
    shipped, robot = read_settings("irsbot2")
    settings = shipped
    free = [entry for entry in fields(Settings) if not entry.metadata.get("read_only")]
    with _supervised(tally, GOOD) as tester:
        memory = _Memory(tester, tally, half)
        client = tester.client(SetParametersAtomically, "supervisor/set_parameters_atomically")

        def result_of(values: dict[str, Any]) -> Any:
            parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
            return tester.ask(client, SetParametersAtomically.Request(parameters=parameters)).result

        for case in range(job.amount):
            if case % half == 0:
                rng, settings = random.Random(job.seed), shipped
                assert result_of({entry.name: getattr(shipped, entry.name) for entry in free}).successful
            values = {entry.name: _value(rng, entry, settings) for entry in rng.sample(free, rng.randint(1, 3))}
            result = result_of(values)
            read = {name: _as_declared(getattr(settings, name), value) for name, value in values.items()}
            try:
                due = settings_from({**asdict(settings), **read}, robot) if _same_types(settings, read) else None
            except InvalidSettings:
                due = None
            fault = "" if result.successful == (due is not None) else f"{values}: answered {result.successful}"
            fault = fault or ("" if result.successful or result.reason else f"{values}: refused without a reason")
            settings = due or settings
            tally.add("accepted", due is not None)
            tally.case(failed=fault)
            memory.after(case)
        start = len(tester.verdicts)
        tester.until(lambda: len(tester.verdicts) > start + 3, "verdicts")
        hashed = tester.verdicts[-1].config_hash == settings.config_hash
        tally.many(0, failed=not hashed, note="" if hashed else "other settings are in force than were accepted")
        memory.judge()
    return tally.row()


def _value(rng: random.Random, entry: Any, settings: Settings) -> Any:
    """A value for a setting: near its present value, at the end of its range, or invalid."""
    now, low, high = getattr(settings, entry.name), entry.metadata.get("low"), entry.metadata.get("high")
    if entry.metadata.get("words"):
        return rng.choice([*entry.metadata["words"], "", "maybe"])
    choices = [nan, inf, -inf, 1e308, -1.0, 0.0, 5e-324, low, high, rng.uniform(low, high)]
    if isinstance(now, tuple):
        size = rng.choice((len(now), len(now), 1, 3))
        return [rng.choice([*choices, now[0], now[0]]) for _ in range(size)]
    return rng.choice([*choices, now * rng.uniform(0.8, 1.25), now * rng.uniform(0.8, 1.25), "word", 3])


def _as_declared(now: Any, value: Any) -> Any:
    """An integer stands for a number: the `ros2` tools send 3 where 3.0 is meant."""
    return float(value) if type(now) is float and type(value) is int else value


def _same_types(settings: Settings, values: dict[str, Any]) -> bool:
    """Parameters with the declared types: ROS checks the type before the node sees the value."""
    return all(isinstance(value, (list, type(getattr(settings, name)))) for name, value in values.items())


def run_resets(job: Job) -> Row:
    """The row: a case is a call, AT_ONCE of them without waiting for answers, on a robot that stands at a stop, then on
    one that stands in a good posture with a latched stop. Right and wrong event numbers alternate."""
    tally, rng = Tally(RESETS, job), random.Random(job.seed)
    half = max(job.amount // 2, 1)
    with _supervised(tally, HIGH, CAUTIOUS) as tester:
        tester.until(lambda: tester.verdicts[-1].latched, "a stop")
        event = tester.verdicts[-1].event
        memory = _Memory(tester, tally, int(WARM_UP * half))
        accepted = _reset(tester, tally, half, event, rng, memory)
        if accepted or not tester.verdicts[-1].latched:
            tally.case(unsafe=f"{accepted} resets of a cause that is still there")
        memory.judge()
        _move_limits_away(tester)
        accepted, tries = 0, 0
        while not accepted and tries < TRIES:  # samples that are late on a busy machine refuse all of them
            accepted, tries = _reset(tester, tally, job.amount - half, event, rng, None), tries + 1
        tally.many(0, failed=accepted != 1, note="" if accepted == 1 else f"one stop was reset {accepted} times")
        # A pause of the machine may have stopped the robot again: that is another stop.
        tester.until(lambda: not tester.verdicts[-1].latched or tester.verdicts[-1].event != event, "the stop ends")
    return tally.row()


def _move_limits_away(tester: Tester) -> None:
    """Lower the stop limits: the robot may stay in its posture, and the stop stays latched."""
    from rcl_interfaces.srv import SetParametersAtomically
    from rclpy.parameter import Parameter

    values = {f"{kind}_{what}": 0.01 for kind in ("type1", "type2", "constraint") for what in ("stop", "warn")}
    parameters = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
    client = tester.client(SetParametersAtomically, "supervisor/set_parameters_atomically")
    before = tester.verdicts[-1].config_hash
    assert tester.ask(client, SetParametersAtomically.Request(parameters=parameters)).result.successful
    tester.until(lambda: tester.verdicts[-1].config_hash != before, "the new limits")
    start = len(tester.verdicts)
    tester.until(lambda: len(tester.verdicts) > start + 20, "the causes have lapsed")
    assert tester.verdicts[-1].latched, f"a change of settings must not end a stop: {tester.verdicts[-1].text}"


def _reset(tester: Tester, tally: Tally, number: int, event: int, rng: random.Random, memory: _Memory | None) -> int:
    """Number of accepted calls; a wrong event number is never accepted."""
    from irsbot_msgs.srv import ResetStop

    client, accepted, done = tester.client(ResetStop, "supervisor/reset"), 0, 0
    while done < number:
        events = [rng.choice((event, event, event + 1000, 0)) for _ in range(min(AT_ONCE, number - done))]
        answers = [client.call_async(ResetStop.Request(event=e, operator_text="x" * 50)) for e in events]
        for answer in answers:
            tester.until(answer.done, "all answers")
        for e, answer in zip(events, answers, strict=True):
            yes = answer.result().accepted
            accepted += yes
            tally.case(unsafe=f"event {e} was reset, {event} is latched" if yes and e != event else "")
            if memory is not None:
                memory.after(done)
            done += 1
    return accepted
