"""Scenarios as YAML.

    description: one line
    expect: {stop: true, causes: [TYPE2, BRAKING]}   # expected verdicts; causes may be left out;
                                                     # unknown: true or false where UNKNOWN must or must not come
                                                     # (left out: it may where a stop is expected, else it must not)
    robots:                                          # the first is the default; an entry may replace the keys below
      irsbot2_beta45: {start: [0.0, -0.75]}
    cycle:                                           # repeated as a whole for `seconds`; ends where it begins
      - {by: [[0.0, 0.025], [0.305, 0.0], [0.0, -0.025]], rounding_m: 0.02, speed: 0.9}
      - {by: [[0.0, 0.025], [-0.305, 0.0], [0.0, -0.025]], rounding_m: 0.02, speed: 0.9}
    seconds: 6.0                                     # .inf: for ever
    run:                                             # once, after the cycles
      - {to: [[0.0, -0.45]]}
    faults: "nan:count=10,at=2.0"
    elsewhere: cycle                                 # `stand` or `cycle`: a robot whose numbers are not in `robots`, or
                                                     # of other lengths than the shipped one of its name, stands or
                                                     # works about its own roomiest posture

A piece is a task-space move along poses (`by`: displacements, `to`: poses; straight, corners rounded), a joint move to
a pose in any working mode (`swing_to`, `working_mode`; straight in joint space), or a rest (`wait`, s). Moves begin and
end at rest; `speed` (0..1] is relative to the limits of the joints. Poses are task coordinates, SI.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import Any

from irsbot_kinematics import BadInput, Robot
from irsbot_kinematics.description import yaml_text
from irsbot_kinematics.mechanism import Floats, Signs
from irsbot_msgs_py.records import Cause
from irsbot_supervisor.replay.run_summary import ExpectedOutcome
from irsbot_supervisor.sim.errors import BadFault, BadScenario
from irsbot_supervisor.sim.faults import parse_faults
from irsbot_supervisor.sim.own_workspace import cycle_of, is_shipped, start_of
from irsbot_supervisor.sim.scenarios import JointMove, Piece, Scenario, TaskMove, Wait

_FOR_ROBOT = {"expect", "start", "working_mode", "cycle", "seconds", "run", "faults"}
_TOP = {"description", "robots", "elsewhere"} | _FOR_ROBOT
_ELSEWHERE = ("stand", "cycle")
_PIECES = {
    "by": {"rounding_m", "speed"},
    "to": {"rounding_m", "speed"},
    "swing_to": {"working_mode", "speed"},
    "wait": set[str](),
}


def scenario_names() -> tuple[str, ...]:
    """Names of the shipped scenarios."""
    files = resources.files("irsbot_supervisor").joinpath("scenarios").iterdir()
    return tuple(sorted(Path(file.name).stem for file in files if file.name.endswith(".yaml")))


def scenario_robots(name_or_path: str) -> tuple[str, ...]:
    """Robots for which a scenario has numbers, the default first. Raises BadScenario."""
    return tuple(_read(name_or_path)[2]["robots"])


def read_scenario(name_or_path: str, robot: Robot | None = None) -> Scenario:
    """A shipped scenario by name, or one from a YAML file, for a robot; if none is given, for its default robot.

    A robot that the file does not name uses the entry of its topology. If the file has `elsewhere`, and the robot is
    not the shipped one of that name, it moves in its own workspace. Raises BadScenario.
    """
    name, place, stated = _read(name_or_path)
    robots: Mapping[str, Any] = stated["robots"]
    if robot is not None and "elsewhere" in stated and not (robot.name in robots and is_shipped(robot)):
        return _in_own_workspace(name, stated, robot, place)
    wanted = next(iter(robots)) if robot is None else robot.name
    entry = wanted if wanted in robots or robot is None else robot.mechanism.kind
    if entry not in robots:
        raise BadScenario(f"{place} has no robot '{wanted}'; it has {', '.join(robots)}")
    own = robots[entry] or {}
    _known(own, _FOR_ROBOT, f"{place}: robots.{entry}")
    merged = {**{key: value for key, value in stated.items() if key in _FOR_ROBOT}, **own}
    if "start" not in merged or not (merged.get("cycle") or merged.get("run")):
        raise BadScenario(f"{place}: robot '{entry}' needs start, and cycle or run")
    where = f"{place} for {entry}"
    return Scenario(
        name=name,
        description=str(stated.get("description", "")),
        robot=wanted,
        expect=_expectation(merged.get("expect"), where),
        start=_vector(merged["start"], f"{where}: start"),
        working_mode=_mode(merged.get("working_mode"), where),
        cycle=_pieces(merged.get("cycle"), f"{where}: cycle"),
        seconds=_number(merged.get("seconds", float("inf")), f"{where}: seconds", endless=True),
        run=_pieces(merged.get("run"), f"{where}: run"),
        faults=_faults(merged.get("faults", ""), where),
    )


def _in_own_workspace(name: str, stated: Mapping[str, Any], robot: Robot, place: str) -> Scenario:
    what = stated["elsewhere"]
    if what not in _ELSEWHERE:
        raise BadScenario(f"{place}: elsewhere is {what!r}, must be {' or '.join(_ELSEWHERE)}")
    start, cycle = (start_of(robot), ()) if what == "stand" else cycle_of(robot)
    run = () if cycle else (Wait(0.0),)
    description = str(stated.get("description", "")) if what == "stand" else "there and back about its roomiest posture"
    expect = _expectation(stated.get("expect"), place)
    return Scenario(
        name,
        description,
        robot.name,
        expect,
        start,
        cycle=cycle,
        run=run,
        faults=_faults(stated.get("faults", ""), place),
    )


def _read(name_or_path: str) -> tuple[str, str, dict[str, Any]]:
    """Its name, its name in messages, and its content."""
    path = Path(name_or_path)
    if path.suffix in (".yaml", ".yml"):
        try:
            name, place, text = path.stem, str(path), path.read_text(encoding="utf-8")
            stated = yaml_text.parsed(text, place)
        except OSError as error:
            raise BadScenario(f"{path}: {error.strerror}") from None
        except UnicodeDecodeError:
            raise BadScenario(f"{path}: not a text in UTF-8") from None
        except BadInput as error:
            raise BadScenario(str(error)) from None
    elif name_or_path in scenario_names():
        name = place = name_or_path
        file = resources.files("irsbot_supervisor").joinpath(f"scenarios/{name}.yaml")
        stated = yaml_text.shipped(file.read_text(encoding="utf-8"))
    else:
        raise BadScenario(f"no scenario '{name_or_path}'; known are {', '.join(scenario_names())}, or give a YAML file")
    _known(stated, _TOP, place)
    robots = stated.get("robots")
    if not isinstance(robots, dict) or not robots or not all(isinstance(name, str) for name in robots):
        raise BadScenario(f"{place}: robots must name at least one robot, each by a text")
    return name, place, stated


def _known(stated: Any, keys: set[str], where: str) -> None:
    if not isinstance(stated, dict):
        raise BadScenario(f"{where}: expected a mapping with the keys {', '.join(sorted(keys))}")
    if unknown := sorted(str(key) for key in stated if key not in keys):
        raise BadScenario(f"{where}: unknown key '{unknown[0]}'; known are {', '.join(sorted(keys))}")


def _pieces(stated: Any, where: str) -> tuple[Piece, ...]:
    if stated is None:
        return ()
    if not isinstance(stated, list):
        raise BadScenario(f"{where}: expected a list of pieces")
    return tuple(_piece(piece, f"{where}[{i}]") for i, piece in enumerate(stated))


def _piece(stated: Any, where: str) -> Piece:
    kinds = [kind for kind in _PIECES if isinstance(stated, dict) and kind in stated]
    if len(kinds) != 1:
        raise BadScenario(f"{where}: a piece has exactly one of {', '.join(_PIECES)}")
    kind = kinds[0]
    _known(stated, _PIECES[kind] | {kind}, where)
    if kind == "wait":
        return Wait(_number(stated[kind], f"{where}: wait"))
    speed = _number(stated.get("speed", 1.0), f"{where}: speed")
    if kind == "swing_to":
        return JointMove(_vector(stated[kind], where), _mode(stated.get("working_mode"), where), speed)
    if not isinstance(stated[kind], list):
        raise BadScenario(f"{where}: {kind} is a list of poses")
    points = tuple(_vector(point, f"{where}: {kind}[{i}]") for i, point in enumerate(stated[kind]))
    return TaskMove(points, kind == "by", _number(stated.get("rounding_m", 0.0), f"{where}: rounding_m"), speed)


def _expectation(stated: Any, where: str) -> ExpectedOutcome:
    _known(stated, {"stop", "causes", "unknown"}, f"{where}: expect")
    if not isinstance(stated.get("stop"), bool):
        raise BadScenario(f"{where}: expect.stop must be true or false, got {stated.get('stop')!r}")
    if not isinstance(stated.get("unknown"), bool | None):
        raise BadScenario(f"{where}: expect.unknown must be true or false, got {stated['unknown']!r}")
    causes, names = Cause.NONE, stated.get("causes") or []
    if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        raise BadScenario(f"{where}: expect.causes must be a list of names such as [TYPE2, BRAKING], got {names!r}")
    for name in names:
        if name not in Cause.__members__:
            raise BadScenario(f"{where}: no cause '{name}'; known are {', '.join(Cause.__members__)}")
        causes |= Cause[name]
    return ExpectedOutcome(stated["stop"], causes, stated.get("unknown"))


def _vector(stated: Any, where: str) -> Floats:
    if not isinstance(stated, list):
        raise BadScenario(f"{where}: expected a list of numbers, got {stated!r}")
    return tuple(_number(value, where, signed=True) for value in stated)


def _number(stated: Any, where: str, *, signed: bool = False, endless: bool = False) -> float:
    is_number = isinstance(stated, (int, float)) and not isinstance(stated, bool)
    if is_number and (isfinite(stated) or (endless and stated > 0.0)) and (signed or stated >= 0.0):
        return float(stated)
    raise BadScenario(f"{where}: expected a {'' if signed else 'positive '}number, got {stated!r}")


def _mode(stated: Any, where: str) -> Signs | None:
    if stated is None:
        return None
    if not isinstance(stated, list) or any(type(sign) is not int or sign not in (-1, 1) for sign in stated):
        raise BadScenario(f"{where}: working_mode is a list of 1 and -1, got {stated!r}")
    return tuple(stated)


def _faults(stated: Any, where: str) -> str:
    try:
        parse_faults(str(stated))
    except BadFault as error:
        raise BadScenario(f"{where}: faults: {error}") from None
    return str(stated)
