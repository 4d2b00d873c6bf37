"""Garbage in the messages: wrong numbers, lengths, names and bytes.

This module decides from the message alone whether it contains the position of the robot: every joint named once, arrays
that fit, positions that are finite and true. Then it must be accepted; otherwise rejected and counted.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite, nan

import numpy as np

from irsbot_msgs_py.cdr import decode_joint_state, encode_joint_state
from irsbot_msgs_py.errors import CdrError
from irsbot_msgs_py.records import JointSample, Level, SingularityState
from irsbot_supervisor.validation.harness.motion import PERIOD_S, works
from irsbot_supervisor.validation.harness.rows import Job, Row, Tally
from irsbot_supervisor.validation.harness.stream import PERIOD_NS, WARM_UP, InputStream

NAME = "garbage"
MUST = "right by name or rejected and counted, never an exception, never a NaN margin called OK"

NUMBERS = (nan, inf, -inf, 1e308, -1e308, 5e-324, -5e-324, 1e-300, 1e16, 1e6, 180.0, 7.0, -0.0)
FIELDS = ("position", "velocity", "effort")
MOST_EXTRA = 50
"""Joints of other robots in one message."""
BETWEEN = 4
"""Largest number of good samples between two messages of garbage."""
SETTLED = 25
"""Number of periods after which a changed stamp lies in the past; until then true samples are out of order. 20 ms ahead
are allowed."""
FAR = 1e6
"""rad or m: farther than any joint."""
PLAY = 2.0
"""Periods of motion at the velocity limit by which a position may be off and count as motion: one since the good sample
before it, there and back."""

Bad = Callable[[JointSample, np.random.Generator], JointSample]


def run(job: Job) -> Row:
    """The row: a case is one message. Each follows on good ones, on a robot at work."""
    tally = Tally(NAME, job)
    kinds: tuple[Bad, ...] = (
        one_number,
        all_numbers,
        lengths,
        missing,
        duplicate,
        extra,
        permuted,
        miswired,
        raw_bytes,
    )
    names = job.robots or works()
    rngs = [np.random.default_rng([job.seed, k]) for k in range(len(names))]
    streams = [InputStream(name, rng) for name, rng in zip(names, rngs, strict=True)]
    for stream in streams:
        stream.run(WARM_UP)
    for k in range(job.amount):
        which = k % len(names)
        stream, rng, kind = streams[which], rngs[which], kinds[k // len(names) % len(kinds)]
        stream.run(1 + int(rng.integers(BETWEEN)))
        stream.advance()
        unsafe, failed = _try(stream, kind, rng, tally)
        where = f"{names[which]}, {kind.__name__}"
        tally.case(unsafe and f"{where}: {unsafe}", failed and f"{where}: {failed}")
        if kind is raw_bytes:
            stream.run(SETTLED)
        if stream.verdict is not None and stream.verdict.latched:
            tally.add("resets")
            _reset(stream)
    return tally.row()


def _try(stream: InputStream, kind: Bad, rng: np.random.Generator, tally: Tally) -> tuple[str, str]:
    """Deliver one message; returns what was unsafe, and what failed."""
    counted = sum(stream.supervisor.rejections.values())
    sample = kind(stream.sample(), rng)
    answer = stream.feed(sample)
    state = answer.state
    if state is None:
        return "", "no state for a sample"
    rejected = sum(stream.supervisor.rejections.values()) - counted
    tally.add("rejected", rejected)
    nans = state.level <= Level.WARN and not _has_margins(state, stream)
    if nans:
        return f"{state.level.name} with margins that are not numbers", ""
    if not _is_whole(sample, stream.settings.joint_names):
        unsafe = f"{stream.level.name} after {sample}"[:200] if stream.moves or state.level <= Level.WARN else ""
        return unsafe, "" if rejected == 1 else "not counted as rejected"
    stated = [sample.position[sample.names.index(joint)] for joint in stream.settings.joint_names]
    off = max(
        abs(q - true) / (limit * PERIOD_S)
        for q, true, limit in zip(stated, stream.position, stream.settings.velocity_limit, strict=True)
    )
    ahead = max(sample.stamp_ns - stream.received_ns, 0) / PERIOD_NS  # a stamp that is younger leaves more time to move
    if state.level <= Level.WARN and not off <= PLAY + ahead:
        return f"{state.level.name} although positions are {off * PERIOD_S:.3g} s at full speed off", ""
    if off == 0.0 and sample.stamp_ns == stream.received_ns:
        tally.add("right by name")
        if state.level > Level.WARN and not rejected:
            return "", f"{state.level.name} for a message that is right by name"
        if not rejected and state.joint_position != stream.position:
            return "joints were mixed up", ""
        if rejected:
            return "", f"rejected although it is right by name: {answer.verdict.text if answer.verdict else ''}"
    return "", ""


def _is_whole(sample: JointSample, joints: tuple[str, ...]) -> bool:
    """True if every joint is named once, the arrays fit, and all positions are numbers that joints can have."""
    count = len(sample.names)
    if not all(sample.names.count(joint) == 1 for joint in joints):
        return False
    if len(sample.position) != count or not {len(sample.velocity), len(sample.effort)} <= {0, count}:
        return False
    return all(abs(sample.position[sample.names.index(joint)]) <= FAR for joint in joints)


def _has_margins(state: SingularityState, stream: InputStream) -> bool:
    """True if all numbers that a verdict needs are there."""
    numbers = [*state.joint_position, *state.joint_velocity, *state.pose, *state.type1_margin, *state.limb_margin]
    numbers += [state.type2_margin, state.stop_margin]
    return all(map(isfinite, numbers)) and len(state.joint_position) == len(stream.settings.joint_names)


def _reset(stream: InputStream) -> None:
    """Reset a stop at standstill, and continue the work."""
    stream.standing = True
    stream.run(WARM_UP)
    stream.reset()
    stream.standing = False
    stream.run(WARM_UP)


# --- what is in the messages --------------------------------------------------------------------------------------


def one_number(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """One number of one array."""
    field = str(rng.choice(FIELDS))
    values = list(getattr(sample, field) or (0.0,) * len(sample.names))
    values[int(rng.integers(len(values)))] = NUMBERS[int(rng.integers(len(NUMBERS)))]
    return _with(sample, field, values)


def all_numbers(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """All numbers of one array."""
    values = [NUMBERS[int(rng.integers(len(NUMBERS)))] for _ in sample.names]
    return _with(sample, str(rng.choice(FIELDS)), values)


def lengths(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """Arrays that are too short or too long."""
    for field in FIELDS:
        sample = _with(sample, field, rng.uniform(-1.0, 1.0, int(rng.integers(6))).tolist())
    return sample


def missing(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """Joints left out, with their numbers; or under another name."""
    order = [k for k in range(len(sample.names)) if rng.random() < 0.5]
    if rng.random() < 0.3:
        return sample._replace(
            names=tuple(name if k in order else f"{name}\N{DEGREE SIGN}" for k, name in enumerate(sample.names))
        )
    return _picked(sample, order)


def duplicate(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """A joint named more than once, with its numbers or with others."""
    count = len(sample.names)
    again = _picked(sample, [*range(count), *rng.integers(0, count, 1 + int(rng.integers(3))).tolist()])
    return again if rng.random() < 0.5 else _with(again, "position", rng.uniform(-1.0, 1.0, len(again.names)).tolist())


def extra(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """Joints of another robot before, between and behind, with any numbers."""
    count = len(sample.names)
    others = 1 + int(rng.integers(MOST_EXTRA))
    order = rng.permutation(count + others).tolist()
    names = [*sample.names, *(f"other_{k % 40}" for k in range(others))]
    numbers = [NUMBERS[int(rng.integers(len(NUMBERS)))] for _ in range(others)]
    sample = sample._replace(names=tuple(names[k] for k in order))
    for field in ("position", "velocity"):
        values = [*getattr(sample, field), *numbers]
        sample = _with(sample, field, [values[k] for k in order])
    return sample


def permuted(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """Another order of the joints, names and numbers alike."""
    return _picked(sample, rng.permutation(len(sample.names)).tolist())


def miswired(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """Another order of the names alone."""
    return sample._replace(names=tuple(sample.names[k] for k in rng.permutation(len(sample.names))))


def raw_bytes(sample: JointSample, rng: np.random.Generator) -> JointSample:
    """Bytes of a message are changed, cut off or added, then decoded as in the node."""
    data = bytearray(encode_joint_state(sample))
    for _ in range(int(rng.integers(1, 6))):
        match int(rng.integers(4)):
            case 0:
                data[int(rng.integers(len(data)))] ^= 1 << int(rng.integers(8))
            case 1:
                data[int(rng.integers(len(data)))] = int(rng.integers(256))
            case 2:
                del data[1 + int(rng.integers(len(data))) :]
            case _:
                data += rng.bytes(int(rng.integers(1, 9)))
    try:
        return decode_joint_state(bytes(data), sample.received_ns, sample.seen_ns)
    except CdrError:
        return JointSample(0, sample.received_ns, sample.seen_ns, (), ())


def _with(sample: JointSample, field: str, values: list[float]) -> JointSample:
    match field:
        case "position":
            return sample._replace(position=tuple(values))
        case "velocity":
            return sample._replace(velocity=tuple(values))
    return sample._replace(effort=tuple(values))


def _picked(sample: JointSample, order: list[int]) -> JointSample:
    """Joints picked, repeated or left out by number."""
    sample = sample._replace(effort=(0.0,) * len(sample.names))
    for field in FIELDS:
        values = getattr(sample, field)
        sample = _with(sample, field, [values[k] for k in order])
    return sample._replace(names=tuple(sample.names[k] for k in order))
