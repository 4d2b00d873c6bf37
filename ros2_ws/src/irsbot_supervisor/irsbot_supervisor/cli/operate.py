"""`send`, `reset`, `set`, `verdict`: operate a running suite without the ros2 tool."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from irsbot_kinematics import BadInput
from irsbot_msgs_py.records import Level, Verdict, cause_names
from irsbot_supervisor.cli.common import NUMBERS, Failed, existing, namespace_from, numbers, out, print_json
from irsbot_supervisor.core.settings import Settings

if TYPE_CHECKING:
    from irsbot_supervisor.processes.operating import Answer, Operator

Domain = Annotated[int, typer.Option(help="DDS domain", envvar="ROS_DOMAIN_ID", min=0, max=232)]
Namespace = Annotated[str, typer.Option(help="namespace of the suite")]
Patience = Annotated[float, typer.Option(help="longest wait for an answer, s", min=0.1, max=600.0)]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON")]

app = typer.Typer(
    help="Send velocities, the way out of a stop or a trajectory through the command gate of a running suite.\n\n"
    "Example: irsbot send velocity 0.5 -0.5 --seconds 2",
    no_args_is_help=True,
    rich_markup_mode=None,
)

LONGEST_S = 3600.0
"""s: longest time for which velocities are sent."""


def verdict(
    follow: Annotated[bool, typer.Option("--follow", help="print every change until Ctrl-C")] = False,
    domain: Domain = 0,
    namespace: Namespace = "",
    wait: Patience = 5.0,
    as_json: AsJson = False,
) -> None:
    """Print the verdict of a running supervisor. Exit code 1 at STOP and UNKNOWN, and if no verdict comes.

    Example: irsbot verdict --follow.
    """
    with _operator(domain, namespace, wait) as operator:
        stated = _asked(operator.verdict)
        _tell(stated, as_json)
        try:
            while follow:
                before, stated = stated, _asked(operator.verdict)
                if (stated.level, stated.causes, stated.event, stated.latched) != (
                    before.level,
                    before.causes,
                    before.event,
                    before.latched,
                ):
                    _tell(stated, as_json)
        except KeyboardInterrupt:
            pass
    if stated.level >= Level.STOP:
        raise Failed(f"{stated.level.name}: the robot must brake")


def reset(
    event: Annotated[int, typer.Argument(help="number of the stop, from `irsbot verdict`", min=0)],
    by: Annotated[str, typer.Option(help="who resets")],
    because: Annotated[str, typer.Option(help="reason why it is safe")],
    seed_pose: Annotated[str | None, typer.Option(help="pose of the platform, as seen: 0.3,-0.75")] = None,
    domain: Domain = 0,
    namespace: Namespace = "",
    wait: Patience = 5.0,
    as_json: AsJson = False,
) -> None:
    """End a latched stop that a person has looked at. Exit code 1 if the supervisor refuses, with its reason.

    Example: irsbot reset 3 --by Ann --because "the work piece was taken out"
    """
    if not by.strip() or not because.strip():
        raise BadInput("--by and --because need the operator and the reason: both are recorded")
    parts = seed_pose.split(",") if seed_pose is not None else []
    pose = numbers(parts, "--seed-pose", len(parts))
    with _operator(domain, namespace, wait) as operator:
        answer = _asked(lambda: operator.reset(event, f"{by.strip()}: {because.strip()}", pose))
    _done(answer, f"stop {event} is reset", as_json)


def set_(
    words: Annotated[list[str], typer.Argument(metavar="NAME VALUE..", help="settings with their values")],
    domain: Domain = 0,
    namespace: Namespace = "",
    wait: Patience = 30.0,
    as_json: AsJson = False,
) -> None:
    """Change settings of a running supervisor, all of them or none. Exit code 1 if it refuses, with its reason.

    Example: irsbot set type2_warn 0.3 type2_stop 0.2
    """
    values = _values(words)
    with _operator(domain, namespace, wait) as operator:
        answer = _asked(lambda: operator.set(values))
    _done(answer, f"set {', '.join(values)}", as_json)


@app.command(context_settings=NUMBERS)
def velocity(
    rates: Annotated[list[str], typer.Argument(help="of every joint, rad/s or m/s, robot order")],
    seconds: Annotated[float, typer.Option(help="duration, s; then zero")] = 1.0,
    domain: Domain = 0,
    namespace: Namespace = "",
    wait: Patience = 5.0,
    as_json: AsJson = False,
) -> None:
    """Send joint velocities for a while, then zero. Exit code 1 if none of them passed the gate.

    Example: irsbot send velocity 0.5 -0.5 --seconds 2.
    """
    wanted = numbers(rates, "velocities", len(rates))
    _check_duration(seconds)
    with _operator(domain, namespace, wait) as operator:
        passed = _asked(lambda: operator.send_velocity(wanted, seconds))
    _tell_passed(wanted, passed, operator.held, as_json)


@app.command()
def escape(
    seconds: Annotated[float, typer.Option(help="longest duration, s; then zero")] = 10.0,
    domain: Domain = 0,
    namespace: Namespace = "",
    wait: Patience = 5.0,
    as_json: AsJson = False,
) -> None:
    """Move a stopped robot along its escape direction, slowly. Exit code 1 if there is none or nothing passed the gate.

    Example: irsbot send escape --seconds 5
    """
    _check_duration(seconds)
    with _operator(domain, namespace, wait) as operator:
        stated = _asked(operator.verdict)
        if not stated.escape_direction:
            why = f": ./irsbot reset {stated.event} says what stops the robot" if stated.latched else ""
            raise Failed(f"the verdict, {stated.level.name}, has no escape direction{why}")
        passed = _asked(lambda: operator.send_escape(seconds))
        _tell_passed(stated.escape_direction, passed, operator.held, as_json)
        if not as_json:
            after = _asked(operator.verdict)
            if after.latched and not after.escape_direction:
                out.print(f"no escape direction is left: ./irsbot reset {after.event}")
            else:
                _tell(after, as_json)


@app.command()
def trajectory(
    file: Annotated[Path, typer.Argument(help="CSV: time_s, the joints, and NAME_velocity or not")],
    domain: Domain = 0,
    namespace: Namespace = "",
    wait: Patience = 30.0,
    as_json: AsJson = False,
) -> None:
    """Send a motion of the joints. Exit code 1 if the gate holds the robot instead.

    Example: irsbot send trajectory motion.csv
    """
    from irsbot_supervisor.bag.columns import column_names, read_motion  # polars takes its time to load

    columns = column_names(existing(file, "the motion"))
    names = [name for name in columns if name != "time_s" and not name.endswith("_velocity")]
    times, positions, velocities = read_motion(file, names)
    if len(velocities) and np.any(velocities[-1]):
        raise BadInput(f"{file}: the last row must be at rest, its velocities are {velocities[-1].tolist()}")
    with _operator(domain, namespace, wait) as operator:
        passed = _asked(
            lambda: operator.send_trajectory(names, times.tolist(), positions.tolist(), velocities.tolist())
        )
    if as_json:
        print_json({"sent": len(times), "let_through": len(passed.points)})
    if len(passed.points) <= 1 < len(times):
        raise Failed(f"{_nothing_passed(operator.held)}; see `irsbot check-trajectory` and `irsbot verdict`")
    if not as_json:
        out.print(f"the gate let {len(passed.points)} points through, of {len(times)}")


def _operator(domain: int, namespace: str, wait: float) -> Operator:
    place = namespace_from(namespace)
    from irsbot_supervisor.processes.operating import Operator  # needs ROS, which the other commands do not

    return Operator(domain, place, wait)


def _asked(question: Any) -> Any:
    from irsbot_supervisor.processes.operating import NobodyThere

    try:
        return question()
    except NobodyThere as error:
        raise Failed(str(error)) from None


def _check_duration(seconds: float) -> None:
    """Raises BadInput."""
    if not 0.0 < seconds <= LONGEST_S:
        raise BadInput(f"--seconds is {seconds:g}, must be above 0 and at most {LONGEST_S:g}")


def _tell_passed(sent: Sequence[float], passed: Sequence[Sequence[float]], held: str, as_json: bool) -> None:
    """Print what passed the gate at most. Raises Failed if nothing did."""
    largest = max(passed, key=lambda row: max(map(abs, row), default=0.0), default=())
    if as_json:
        print_json({"sent": sent, "let_through": len(passed), "largest": largest})
    if any(sent) and not any(largest):
        raise Failed(f"{_nothing_passed(held)}; see `irsbot verdict`")
    if not as_json:
        out.print(f"passed, at most: {' '.join(f'{value:g}' for value in largest)}")


def _nothing_passed(held: str) -> str:
    """held: why the gate held the robot; empty if it was asked nothing, because a way out was gone at once."""
    return f"nothing passed the gate: {held}" if held else "nothing was sent to the gate"


def _done(answer: Answer, text: str, as_json: bool) -> None:
    if as_json:
        print_json(answer._asdict())
    if not answer.accepted:
        raise Failed(f"refused: {answer.message}")
    if not as_json:
        out.print(text)


def _tell(stated: Verdict, as_json: bool) -> None:
    causes = cause_names(stated.causes)
    if as_json:
        print_json(
            {
                **stated._asdict(),
                "level": stated.level.name,
                "causes": causes,
                "findings": [f.text for f in stated.findings],
            }
        )
        return
    stop = f", stop {stated.event} is latched: ./irsbot reset {stated.event}" if stated.latched else ""
    out.print(f"{stated.level.name}{f' ({causes})' if causes else ''}: speed up to {stated.speed_scale:.0%}{stop}")
    for finding in stated.findings:
        out.print(f"  {finding.text}")


def _values(words: list[str]) -> dict[str, Any]:
    """Names with their values, as the supervisor declares them. Raises BadInput."""
    known = {entry.name: entry for entry in fields(Settings)}
    found: dict[str, list[str]] = {}
    for word in words:
        if word in known and word not in found:
            found[word] = []
        elif not found:
            raise BadInput(f"no setting '{word}'; `irsbot settings` lists them")
        else:
            found[next(reversed(found))].append(word)
    values: dict[str, Any] = {}
    for name, stated in found.items():
        metadata = known[name].metadata
        if metadata.get("read_only"):
            raise BadInput(f"{name} is read at the start alone")
        if not stated or (len(stated) > 1 and not metadata.get("each_joint")):
            raise BadInput(f"{name} needs {'a value' if not stated else 'one value'}, got {' '.join(stated) or 'none'}")
        if metadata.get("words"):
            values[name] = stated[0]
            continue
        given = numbers(stated, name, len(stated))
        values[name] = list(given) if metadata.get("each_joint") else given[0]
    return values
