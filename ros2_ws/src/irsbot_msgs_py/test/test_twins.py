"""The records say what the .msg files say: same fields, same order, same constants, same wire types."""

from __future__ import annotations

import re
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import pytest

from irsbot_msgs_py import cdr
from irsbot_msgs_py.cdr_layout import Kinds
from irsbot_msgs_py.gate_status import GateCommand, GateOutcome, GateReason, GateStatus
from irsbot_msgs_py.health import RecorderHealth, RecorderState
from irsbot_msgs_py.records import Cause, Finding, Level, SingularityState, Verdict
from irsbot_msgs_py.stamps import nanoseconds, sec_nanosec
from irsbot_msgs_py.summary import StateSummary

MSG = Path(__file__).resolve().parents[2] / "irsbot_msgs" / "msg"
CODES = {"bool": "?", "int8": "b", "uint8": "B", "int32": "i", "uint32": "I", "int64": "q", "uint64": "Q"}
CODES |= {"float64": "d", "string": "s", "std_msgs/Header": "header"}


class Definition(NamedTuple):
    fields: list[tuple[str, str]]  # type, name
    constants: dict[str, int]


def definition(name: str) -> Definition:
    """The lines of a .msg file, read with nothing but a regular expression."""
    fields, constants = [], {}
    for line in (MSG / f"{name}.msg").read_text().splitlines():
        if found := re.match(r"\s*(\S+)\s+(\w+)\s*=\s*(\d+)", line):
            constants[found[2]] = int(found[3])
        elif found := re.match(r"\s*([\w/\[\]]+)\s+(\w+)\s*(#.*)?$", line.split("#")[0]):
            fields.append((found[1], found[2]))
    return Definition(fields, constants)


def kinds_of(ros_type: str) -> Kinds:
    """What the codec has to have for a field: a structure is its fields, a sequence of structures is one kind."""
    name = ros_type.removeprefix("irsbot_msgs/").removesuffix("[]")
    if ros_type.startswith("irsbot_msgs/"):
        inside = tuple(kind for inner, _ in definition(name).fields for kind in kinds_of(inner))
        return (inside,) if ros_type.endswith("[]") else inside
    return (CODES[name] + "*" * ros_type.endswith("[]"),)


@pytest.mark.parametrize(
    "record",
    [SingularityState, StateSummary, Verdict, Finding, GateStatus, RecorderHealth],
    ids=lambda r: r.__name__,
)
def test_a_record_has_the_fields_of_its_message_in_order(record):
    names = [name for _, name in definition(record.__name__).fields]
    assert len(names) > 5
    assert ["stamp_ns" if name == "header" else name for name in names] == list(record._fields)


@pytest.mark.parametrize(
    ("name", "prefix", "enum"),
    [
        ("SingularityState", "CAUSE_", Cause),
        ("SingularityState", "", Level),
        ("Verdict", "", Level),
        ("RecorderHealth", "", RecorderState),
        ("GateStatus", "COMMAND_", GateCommand),
        ("GateStatus", "OUTCOME_", GateOutcome),
        ("GateStatus", "REASON_", GateReason),
    ],
)
def test_the_constants_of_a_message_are_its_enum(name: str, prefix: str, enum: type[Enum]):
    constants = definition(name).constants
    if prefix:
        mine = {key.removeprefix(prefix): value for key, value in constants.items() if key.startswith(prefix)}
    else:
        mine = {key: value for key, value in constants.items() if not key.startswith("CAUSE_")}
    assert mine == {key: member.value for key, member in enum.__members__.items()}


@pytest.mark.parametrize(
    ("name", "kinds"),
    [
        ("SingularityState", cdr.STATE),
        ("StateSummary", cdr.SUMMARY),
        ("Verdict", cdr.VERDICT),
        ("Finding", cdr.FINDING),
    ],
)
def test_the_codec_knows_the_types_of_the_message(name: str, kinds: Kinds):
    assert kinds_of(f"irsbot_msgs/{name}") == kinds


def test_the_extremes_of_a_summary_are_in_the_order_of_their_fields():
    numbered = StateSummary(*range(len(StateSummary._fields)))
    named = numbered._asdict()
    for end, found in (("min", numbered.smallest), ("max", numbered.largest)):
        margins = ("type1", "type2", "constraint", "limb", "stop")
        assert found == tuple(named[f"{margin}_margin_{end}"] for margin in margins)


@pytest.mark.parametrize("time_ns", [0, 1, -1, 999_999_999, 10**9, -(10**9), 1_700_000_000_123_456_789])
def test_a_stamp_splits_into_two_parts_that_make_it_again(time_ns: int):
    sec, nanosec = sec_nanosec(time_ns)
    assert 0 <= nanosec < 10**9  # builtin_interfaces/Time: the fraction counts forward, before 1970 too
    assert nanoseconds(sec, nanosec) == time_ns
