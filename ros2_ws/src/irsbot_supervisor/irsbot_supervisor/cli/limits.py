"""`limits`: proposes every limit of the supervision for a machine, with the reason."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
import yaml

from irsbot_kinematics import BadInput
from irsbot_kinematics.description.urdf import joint_ranges
from irsbot_supervisor.cli.common import Failed, err, existing, folding_table, out, print_json
from irsbot_supervisor.configuration.loading import PARAMETERS, read_settings, robot_of, shipped_values
from irsbot_supervisor.configuration.machine_times import bounding_for, proposals, proposed_bounding
from irsbot_supervisor.configuration.proposal import LimitProposal, Plant, Proposal, propose
from irsbot_supervisor.configuration.sample_time import TRIED, cuts_that_pay, longest_times
from irsbot_supervisor.configuration.stopping_cost import places_above_stop
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.core.stopping import cuts_of

FORCE_RATIO = 20.0 / 3.0
"""Default: the legs of a fast light robot carry about ten times the load in its own accelerations."""

RATE_HZ = 1000.0
"""Default: joint states per second of a usual controller."""

MEASURED_S = 60.0
"""Default: duration of a measurement."""


def limits(
    robot: Annotated[str, typer.Argument(help="preset name or YAML file")],
    speed: Annotated[str | None, typer.Option(help="largest speed, rad/s or m/s; 12 or 12,12")] = None,
    deceleration: Annotated[str | None, typer.Option(help="deceleration, rad/s2 or m/s2; 400 or 400,400")] = None,
    acceleration: Annotated[str | None, typer.Option(help="acceleration; as deceleration if left out")] = None,
    latency: Annotated[float | None, typer.Option(help="s from the arrival of a sample to the first braking")] = None,
    rate: Annotated[float, typer.Option(help="joint states per second", min=1.0, max=20000.0)] = RATE_HZ,
    stamp_jitter: Annotated[float | None, typer.Option(help="largest error of a stamp, s")] = None,
    encoder_resolution: Annotated[float | None, typer.Option(help="smallest step of a joint, rad or m")] = None,
    encoder_offset: Annotated[float | None, typer.Option(help="largest error of a joint's zero, rad or m")] = None,
    geometry_tolerance: Annotated[float | None, typer.Option(help="largest error of a leg, m")] = None,
    force_ratio: Annotated[float, typer.Option(help="admissible leg force over the load")] = FORCE_RATIO,
    description: Annotated[Path | None, typer.Option("--urdf", help="URDF with the ranges of the joints")] = None,
    measure: Annotated[
        bool, typer.Option("--measure", help="run the suite here and propose times from its measurements")
    ] = False,
    seconds: Annotated[
        float | None, typer.Option(help=f"duration of --measure, s; {MEASURED_S:g} if left out", min=1.0, max=3600.0)
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", help="write the settings here, as ROS parameters")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Propose every limit of the supervision, with the reason. Options that are left out use the shipped settings.

    Exit code 1 if the robot could not be stopped from its speed within its margins. With --measure the command proposes
    only stale_s, heartbeat_s, latency_s, bounding_s and judging_s, from measurements on this computer; exit code 1 then
    means that the computer does not keep those in force.

    Example: irsbot limits irsbot2 --speed 12 --deceleration 400 --rate 500 -o mine.yaml.
    """
    machine = robot_of(robot)
    shipped = shipped_values(machine)
    if measure:
        drives = (speed, deceleration, acceleration, latency)
        others = (stamp_jitter, encoder_resolution, encoder_offset, geometry_tolerance, description)
        if any(value is not None for value in (*drives, *others)) or force_ratio != FORCE_RATIO:
            raise BadInput("--measure takes the robot's own settings, and only --seconds, --rate, -o and --json")
        _measured(robot, seconds or MEASURED_S, rate, output, as_json)
        return
    if seconds is not None:
        raise BadInput("--seconds belongs to --measure")

    def given(name: str, value: float | None) -> float:
        return float(shipped.get(name, getattr(Settings, name)) if value is None else value)

    plant = Plant(
        _numbers(speed, "--speed", shipped.get("velocity_limit")),
        _numbers(deceleration, "--deceleration", shipped.get("deceleration_limit")),
        given("latency_s", latency),
        rate,
        given("encoder_resolution", encoder_resolution),
        given("encoder_offset", encoder_offset),
        given("geometry_tolerance_m", geometry_tolerance),
        force_ratio,
        _numbers(acceleration, "--acceleration", shipped.get("acceleration_limit", ())),
        given("stamp_jitter_s", stamp_jitter),
        given("judging_s", None),
        given("bounding_s", None),
    )
    names = [joint.name for joint in machine.mechanism.joints]
    ranges = _ranges(description, names) if description is not None else []
    proposed = propose(machine, robot, plant)
    proposed.proposals.extend(ranges)
    if as_json:
        print_json(
            {
                "settings": {"robot": robot, **{one.name: one.value for one in proposed.proposals}},
                "reasons": {one.name: one.why for one in proposed.proposals},
                "stopping": [row._asdict() for row in proposed.stopping],
                "all_joints_together": proposed.together,
                "costs": [row._asdict() for row in proposed.costs],
                "contradiction": proposed.fault,
            }
        )
    else:
        _print(proposed, [joint.unit for joint in machine.mechanism.joints])
    if proposed.fault:
        raise Failed(proposed.fault)
    if output is not None:
        output.write_text(settings_text(robot, proposed), encoding="utf-8")
        if not as_json:
            out.print(f"written to {output}")


def _ranges(description: Path, names: list[str]) -> list[Proposal]:
    """The ranges of the joints as settings. Raises BadInput, OSError."""
    text = existing(description, "the URDF").read_bytes()
    try:
        lower, upper = joint_ranges(text, names)
    except BadInput as error:
        raise BadInput(f"{description}: {error}") from None
    why = f"as {description.name} has it"
    return [Proposal("position_lower", lower, why), Proposal("position_upper", upper, why)]


def _measured(robot: str, seconds: float, rate_hz: float, output: Path | None, as_json: bool) -> None:
    """Times that this computer keeps. Raises Failed where it does not keep those in force."""
    settings, machine = read_settings(robot)
    from irsbot_supervisor.processes.measuring import measure  # needs ROS, which the rest does not

    if not as_json:
        err.print(f"the suite runs for {seconds:g} s; load this computer as it will be at work")
    met, period_s = measure(robot, seconds, rate_hz), 1.0 / rate_hz
    if not as_json:
        err.print("now steps near the limits are timed")
    places = places_above_stop(settings, machine.mechanism)
    longest_s = longest_times(settings, machine, period_s, {*TRIED, cuts_of(settings)}, places)
    box_s = {cuts: bounding_for(longest_s[cuts], cuts) for cuts in TRIED}
    cuts = cuts_that_pay(settings, machine.mechanism, box_s, period_s, places)
    bounding = proposed_bounding(settings, longest_s, cuts)
    found = proposals(settings, met, period_s, bounding, cuts)
    if as_json:
        print_json([one._asdict() for one in found])
    else:
        table = folding_table("setting", "in force [s]", "longest met [s]", "proposed [s]", "why")
        for one in found:
            table.add_row(one.name, f"{one.now:g}", f"{one.met:.4g}", f"{one.value:g}", one.why)
        out.print(table)
    if output is not None:
        lines = [f"    {one.name}: {_yaml(one.value)}  # {one.why}" for one in found]
        head = f"# Measured by `irsbot limits --measure` in {seconds:g} s\n/**:\n  {PARAMETERS}:\n"
        output.write_text(head + "\n".join(lines) + "\n", encoding="utf-8")
    if missed := [one for one in found if not one.kept]:
        stated = ", ".join(f"{one.name} of {one.now:g} s (proposed: {one.value:g} s)" for one in missed)
        raise Failed(f"this computer does not keep {stated}")


def settings_text(robot: str, proposed: LimitProposal) -> str:
    """The proposed settings as a file of ROS parameters for any node, each with its reason."""
    lines = ["# Proposed by `irsbot limits`; units and meanings: irsbot settings", "/**:", f"  {PARAMETERS}:"]
    lines.append(f"    robot: {_yaml(robot)}")
    lines += [f"    {name}: {_yaml(value)}  # {why}" for name, value, why in proposed.proposals]
    return "\n".join(lines) + "\n"


def _yaml(value: Any) -> str:
    plain = list(value) if isinstance(value, tuple) else value
    return yaml.safe_dump(plain, default_flow_style=True, width=10_000).splitlines()[0]


def _print(proposed: LimitProposal, units: list[str]) -> None:
    table = folding_table("setting", "value", "why")
    for one in proposed.proposals:
        value = ", ".join(f"{number:g}" for number in one.value) if isinstance(one.value, tuple) else f"{one.value:g}"
        table.add_row(one.name, value, one.why)
    out.print(table)
    table = folding_table("joint", "needs to stop", "platform moves", "available at best", "of the speed", "limited by")
    for row in proposed.stopping:
        table.add_row(
            row.joint,
            f"{row.needs:.3g} {row.unit}",
            _metres(row.platform_m),
            f"{row.room:.3g} {row.unit}",
            f"{row.share:.0%}",
            f"{row.margin}_stop" if row.margin else "-",
        )
    out.print(table)
    out.print(f"all joints at once, in the worst combination: {proposed.together:.0%} of the speed could be stopped")
    out.print("\nCost: how far joints can move until they stand, and in how many postures a resting robot is stopped")
    table = folding_table(
        "machine", "brakes act after", "from rest", "platform", "from full speed", "platform", "stopped at rest"
    )
    for cost in proposed.costs:
        table.add_row(
            cost.machine,
            f"{cost.free_s * 1e3:.3g} ms",
            _ways(cost.from_rest, units),
            _metres(cost.platform_rest_m),
            _ways(cost.from_full, units),
            _metres(cost.platform_full_m),
            f"{cost.stopped:.0%} of postures",
        )
    out.print(table)


def _ways(ways: tuple[float, ...], units: list[str]) -> str:
    return ", ".join(dict.fromkeys(f"{way:.3g} {unit}" for way, unit in zip(ways, units, strict=True)))


def _metres(way: float) -> str:
    return f"{way:.3g} m" if way == way else "-"


def _numbers(text: str | None, option: str, shipped: object) -> tuple[float, ...]:
    if text is None:
        if not isinstance(shipped, (list, tuple)):
            raise BadInput(f"this robot has no shipped settings: give {option}")
        return tuple(float(value) for value in shipped)
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise BadInput(f"{option} is one number for all joints, or one each as in 12,12; got '{text}'") from None
