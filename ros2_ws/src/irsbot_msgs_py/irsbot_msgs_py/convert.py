"""Message <-> record, field by field: the only file that touches message fields.

Every field both ways, no defaults, no selection, no arithmetic except stamps; sequences become tuples. `frame_id` has
no place in the records, because nothing in them is a vector of a frame: it is dropped, and empty on the way out.
"""

from __future__ import annotations

from builtin_interfaces.msg import Time
from irsbot_msgs import msg as ros
from sensor_msgs.msg import JointState
from std_msgs.msg import Header

from irsbot_msgs_py.gate_status import GateCommand, GateOutcome, GateReason, GateStatus
from irsbot_msgs_py.health import RecorderHealth, RecorderState
from irsbot_msgs_py.records import Cause, Finding, JointSample, Level, SingularityState, Verdict
from irsbot_msgs_py.stamps import nanoseconds, sec_nanosec
from irsbot_msgs_py.summary import StateSummary


def time_msg(time_ns: int) -> Time:
    """Integer nanoseconds as builtin_interfaces/Time."""
    sec, nanosec = sec_nanosec(time_ns)
    return Time(sec=sec, nanosec=nanosec)


def header_msg(stamp_ns: int) -> Header:
    """A header with this stamp and no frame."""
    return Header(stamp=time_msg(stamp_ns))


def stamp_ns(header: Header) -> int:
    """The stamp of a header."""
    return nanoseconds(header.stamp.sec, header.stamp.nanosec)


def joint_sample(message: JointState, received_ns: int, seen_ns: int) -> JointSample:
    """A JointState as it arrived at `received_ns` (ROS clock) and `seen_ns` (steady clock)."""
    return JointSample(
        stamp_ns=stamp_ns(message.header),
        received_ns=received_ns,
        seen_ns=seen_ns,
        names=tuple(message.name),
        position=tuple(message.position),
        velocity=tuple(message.velocity),
        effort=tuple(message.effort),
    )


def joint_state_msg(sample: JointSample) -> JointState:
    """The JointState from which `joint_sample` reads this sample; the times of arrival are not part of it."""
    return JointState(
        header=header_msg(sample.stamp_ns),
        name=list(sample.names),
        position=sample.position,
        velocity=sample.velocity,
        effort=sample.effort,
    )


def finding_record(message: ros.Finding) -> Finding:
    """Finding.msg as a record."""
    return Finding(
        cause=Cause(message.cause),
        level=Level(message.level),
        value=message.value,
        limit=message.limit,
        unit=message.unit,
        text=message.text,
    )


def finding_msg(record: Finding) -> ros.Finding:
    """A finding as Finding.msg."""
    return ros.Finding(
        cause=int(record.cause),
        level=int(record.level),
        value=record.value,
        limit=record.limit,
        unit=record.unit,
        text=record.text,
    )


def verdict_record(message: ros.Verdict) -> Verdict:
    """Verdict.msg as a record."""
    return Verdict(
        stamp_ns=stamp_ns(message.header),
        level=Level(message.level),
        causes=Cause(message.causes),
        latched=message.latched,
        event=message.event,
        escape_direction=tuple(message.escape_direction),
        text=message.text,
        sequence=message.sequence,
        config_hash=message.config_hash,
        since_ns=message.since_ns,
        speed_scale=message.speed_scale,
        findings=tuple(map(finding_record, message.findings)),
        bypassed=Cause(message.bypassed),
        bypass_left=message.bypass_left,
        escape_cause=Cause(message.escape_cause),
    )


def verdict_msg(record: Verdict) -> ros.Verdict:
    """A verdict as Verdict.msg."""
    return ros.Verdict(
        header=header_msg(record.stamp_ns),
        level=int(record.level),
        causes=int(record.causes),
        latched=record.latched,
        event=record.event,
        escape_direction=record.escape_direction,
        text=record.text,
        sequence=record.sequence,
        config_hash=record.config_hash,
        since_ns=record.since_ns,
        speed_scale=record.speed_scale,
        findings=list(map(finding_msg, record.findings)),
        bypassed=int(record.bypassed),
        bypass_left=record.bypass_left,
        escape_cause=int(record.escape_cause),
    )


def state_record(message: ros.SingularityState) -> SingularityState:
    """SingularityState.msg as a record."""
    return SingularityState(
        stamp_ns=stamp_ns(message.header),
        robot=message.robot,
        sequence=message.sequence,
        received_ns=message.received_ns,
        seen_ns=message.seen_ns,
        level=Level(message.level),
        causes=Cause(message.causes),
        joint_position=tuple(message.joint_position),
        joint_velocity=tuple(message.joint_velocity),
        pose=tuple(message.pose),
        pose_rate=tuple(message.pose_rate),
        working_mode=tuple(message.working_mode),
        assembly_mode=message.assembly_mode,
        type1_margin=tuple(message.type1_margin),
        type2_margin=message.type2_margin,
        constraint_margin=message.constraint_margin,
        limb_margin=tuple(message.limb_margin),
        type1_uncertainty=tuple(message.type1_uncertainty),
        type2_uncertainty=message.type2_uncertainty,
        constraint_uncertainty=message.constraint_uncertainty,
        clearance=message.clearance,
        pressure_angle=tuple(message.pressure_angle),
        reaction=tuple(message.reaction),
        reaction_max=tuple(message.reaction_max),
        stop_margin=message.stop_margin,
        stop_cause=Cause(message.stop_cause),
        stop_limit=message.stop_limit,
        time_to_stop=message.time_to_stop,
        approaching=message.approaching,
        closure_residual=message.closure_residual,
        sample_age=message.sample_age,
        compute_time=message.compute_time,
    )


def state_msg(record: SingularityState) -> ros.SingularityState:
    """A state as SingularityState.msg."""
    return ros.SingularityState(
        header=header_msg(record.stamp_ns),
        robot=record.robot,
        sequence=record.sequence,
        received_ns=record.received_ns,
        seen_ns=record.seen_ns,
        level=int(record.level),
        causes=int(record.causes),
        joint_position=record.joint_position,
        joint_velocity=record.joint_velocity,
        pose=record.pose,
        pose_rate=record.pose_rate,
        working_mode=record.working_mode,
        assembly_mode=record.assembly_mode,
        type1_margin=record.type1_margin,
        type2_margin=record.type2_margin,
        constraint_margin=record.constraint_margin,
        limb_margin=record.limb_margin,
        type1_uncertainty=record.type1_uncertainty,
        type2_uncertainty=record.type2_uncertainty,
        constraint_uncertainty=record.constraint_uncertainty,
        clearance=record.clearance,
        pressure_angle=record.pressure_angle,
        reaction=record.reaction,
        reaction_max=record.reaction_max,
        stop_margin=record.stop_margin,
        stop_cause=int(record.stop_cause),
        stop_limit=record.stop_limit,
        time_to_stop=record.time_to_stop,
        approaching=record.approaching,
        closure_residual=record.closure_residual,
        sample_age=record.sample_age,
        compute_time=record.compute_time,
    )


def summary_record(message: ros.StateSummary) -> StateSummary:
    """StateSummary.msg as a record; its fields behind the state have the same names and types."""
    return StateSummary(state_record(message.state), *[getattr(message, name) for name in StateSummary._fields[1:]])


def summary_msg(record: StateSummary) -> ros.StateSummary:
    """A summary as StateSummary.msg."""
    return ros.StateSummary(**{**record._asdict(), "state": state_msg(record.state)})


def health_record(message: ros.RecorderHealth) -> RecorderHealth:
    """RecorderHealth.msg as a record."""
    return RecorderHealth(
        stamp_ns=stamp_ns(message.header),
        state=RecorderState(message.state),
        file=message.file,
        messages_written=message.messages_written,
        messages_dropped=message.messages_dropped,
        bytes_written=message.bytes_written,
        bytes_free=message.bytes_free,
        write_time_max=message.write_time_max,
        text=message.text,
    )


def health_msg(record: RecorderHealth) -> ros.RecorderHealth:
    """The recorder's health as RecorderHealth.msg."""
    return ros.RecorderHealth(
        header=header_msg(record.stamp_ns),
        state=int(record.state),
        file=record.file,
        messages_written=record.messages_written,
        messages_dropped=record.messages_dropped,
        bytes_written=record.bytes_written,
        bytes_free=record.bytes_free,
        write_time_max=record.write_time_max,
        text=record.text,
    )


def gate_status_record(message: ros.GateStatus) -> GateStatus:
    """GateStatus.msg as a record."""
    return GateStatus(
        stamp_ns=stamp_ns(message.header),
        command=GateCommand(message.command),
        outcome=GateOutcome(message.outcome),
        reason=GateReason(message.reason),
        cause=Cause(message.cause),
        share=message.share,
        text=message.text,
    )


def gate_status_msg(record: GateStatus) -> ros.GateStatus:
    """A status of the command gate as GateStatus.msg."""
    return ros.GateStatus(
        header=header_msg(record.stamp_ns),
        command=int(record.command),
        outcome=int(record.outcome),
        reason=int(record.reason),
        cause=int(record.cause),
        share=record.share,
        text=record.text,
    )
