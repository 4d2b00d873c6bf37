"""`stiffness`: deflection of a robot of tubes, and the loss of margin by bending."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.table import Table

from irsbot_kinematics import BadInput, Robot, stiffness
from irsbot_kinematics.analysis.rectangle import Limits
from irsbot_kinematics.numerics.arithmetic import Array
from irsbot_kinematics.stiffness import Load, Structure
from irsbot_supervisor.cli.common import Failed, measure, numbers, out, print_json

TWIST = ("dx", "dy", "dz", "rx", "ry", "rz")
WRENCH = ("fx", "fy", "fz", "mx", "my", "mz")
ROUNDING = 1e-12
"""1: entries this much smaller than the largest are printed as 0."""
SIDEWAYS = (0.0, 100.0, 0.0, 0.0, 0.0, 0.0)
"""N, N m: load across the plane of motion, as in the paper."""

Design = Annotated[str | None, typer.Argument(metavar="ROBOT", help="elastic design or YAML file; none: list them")]
Set = Annotated[list[str] | None, typer.Option("--set", help="replace a length, such as spacing=0.4 or beta=30deg")]
Rigid = Annotated[list[str] | None, typer.Option(help="kind of tube that does not deform, such as elbow")]
Of = Annotated[str | None, typer.Option("--robot", help="robot that gives the lengths, preset or YAML file")]
Ranges = Annotated[
    tuple[float, float, float, float] | None,
    typer.Option("--box", metavar="LOW HIGH LOW HIGH", help="ranges of x and z for --map and --bound, m"),
]


def show(
    name: Design = None,
    pose: Annotated[list[str] | None, typer.Argument(metavar="[X Z]", help="pose of the platform point, m")] = None,
    robot: Of = None,
    set_: Set = None,
    rigid: Rigid = None,
    wrench: Annotated[
        tuple[float, float, float, float, float, float],
        typer.Option(metavar="FX FY FZ MX MY MZ", help="load at P, N and N m"),
    ] = SIDEWAYS,
    mass: Annotated[float | None, typer.Option(help="kg at P, for the first natural frequency")] = None,
    force: Annotated[float, typer.Option(help="N of any direction, for the loss of margin by bending")] = 0.0,
    moment: Annotated[float, typer.Option(help="N m of any direction, likewise")] = 0.0,
    payload: Annotated[float, typer.Option(help="kg of platform and payload, likewise")] = 0.0,
    acceleration: Annotated[float, typer.Option(help="m/s2, the largest of the platform, likewise")] = 0.0,
    bound: Annotated[bool, typer.Option("--bound", help="bound the error of bending over the workspace")] = False,
    type1: Annotated[float, typer.Option(help="smallest Type 1 margin of a pose for --bound")] = 0.15,
    type2: Annotated[float, typer.Option(help="smallest Type 2 margin, likewise")] = 0.15,
    constraint: Annotated[float, typer.Option(help="smallest constraint margin, likewise")] = 0.04,
    map_: Annotated[bool, typer.Option("--map", help="map the deflection under --wrench over the workspace")] = False,
    target: Annotated[Path, typer.Option("-o", "--output", help="of --map: .png or .npz")] = Path("stiffness.png"),
    box: Ranges = None,
    nodes: Annotated[int, typer.Option(help="nodes of the map along each axis", min=2, max=2000)] = 201,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Stiffness, deflection, frequency and masses of a robot of tubes, and the loss of margin by bending.

    Without ROBOT: the shipped designs, and the tables of the paper compared with the model.

    Example: irsbot stiffness irsbot2_table2 0 -0.8 --wrench 0 100 0 0 0 0 --mass 1.5.
    """
    if name is None:
        _overview(as_json)
        return
    design = stiffness.load(name, robot=robot, **changes(set_, rigid))
    if not isinstance(design, Structure):
        if pose or map_ or bound:
            raise BadInput("a design of chains has one posture: give no pose, --map or --bound")
        facts = _design_facts(design) | _elastic_facts(design, (), wrench, mass)
    elif map_:
        _map(design, wrench, _ranges(box), nodes, target, as_json)
        return
    elif bound:
        _bound(design, Load(force, moment, payload, acceleration), Limits(type1, type2, constraint), box, as_json)
        return
    elif pose:
        at = numbers(pose, "the pose", 2)
        facts = _design_facts(design) | {"pose": at} | _elastic_facts(design, at, wrench, mass)
        facts |= {"margins": _margin_facts(design, at, Load(force, moment, payload, acceleration))}
    else:
        facts = _design_facts(design) | {"statistics": _statistics(design)}
    if as_json:
        print_json(facts)
    else:
        _print(facts)


def _statistics(design: Structure) -> dict[str, float] | None:
    """Statistics over the assumed poses; None if the robot does not reach all of them."""
    try:
        return stiffness.statistics(design)._asdict()
    except BadInput:
        return None


def changes(set_: list[str] | None, rigid: list[str] | None) -> dict[str, Any]:
    """Changes for `stiffness.load`. Raises BadInput."""
    found: dict[str, Any] = {}
    for entry in set_ or []:
        key, equals, value = entry.partition("=")
        if not equals:
            raise BadInput(f"'{entry}' must be name=value, such as spacing=0.4 or beta=30deg")
        found[key] = value if key == "platform_joint" else measure(key, value)
    return found | ({"rigid": tuple(rigid)} if rigid else {})


def _ranges(box: tuple[float, float, float, float] | None) -> tuple[tuple[float, float], tuple[float, float]] | None:
    return None if box is None else (box[:2], box[2:])


def _design_facts(design: stiffness.Design) -> dict[str, Any]:
    tubes = [
        {
            "kind": kind,
            "number": part.number,
            "outer_m": part.tube.outer,
            "inner_m": part.tube.inner,
            "length_m": part.tube.length,
            "material": part.tube.material.name,
            "rigid": part.tube.rigid,
            "mass_kg": part.number * part.tube.mass,
        }
        for kind, part in design.parts().items()
    ]
    assumed = list(design.assumed) if isinstance(design, Structure) else []
    names = {"design": design.name, "family": design.family, "description": design.description}
    return names | {"tubes": tubes, "mass_kg": stiffness.mass(design), "assumed": assumed}


def _elastic_facts(
    design: stiffness.Design, pose: tuple[float, ...], wrench: tuple[float, ...], mass: float | None
) -> dict[str, Any]:
    facts = {"stiffness": stiffness.matrix(design, pose), "wrench": wrench}
    facts |= {"deflection": stiffness.deflection(design, pose, wrench)}
    if mass is not None:
        facts |= {"mass_at_p_kg": mass, "frequency_hz": stiffness.frequency(design, pose, mass)}
    return facts


def _margin_facts(design: Structure, pose: tuple[float, ...], load: Load) -> dict[str, Any]:
    """Margins of the rigid posture, and their certified lower bounds under the load."""
    robot = Robot(design.mechanism)
    at = robot.posture(robot.inverse(pose, design.working_mode))
    found = stiffness.pose_errors(design, np.array([pose]), load)
    slack = float(found.slack_m[0])
    mechanism, still = design.mechanism, (0.0,) * len(at.joints)
    sure = [bound(at, still, slack) for bound in (mechanism.certified_bounds, mechanism.sharp_bounds)]
    return {
        "load": {**asdict(load), "total_force_n": load.force},
        "slack_m": slack,
        "displacement_m": float(found.displacement_m[0]),
        "lateral_m": float(found.lateral_m[0]),
        "rigid": {"type1": min(at.type1), "type2": at.type2, "constraint": at.constraint},
        "bent_at_least": {
            "type1": max(min(one.type1) for one in sure),
            "type2": max(one.type2 for one in sure),
            "constraint": max(one.constraint for one in sure),
        },
    }


def _print(facts: dict[str, Any]) -> None:
    out.print(f"{facts['design']}: {facts['description'] or facts['family']}")
    table = Table("tube", "number", "outer [mm]", "inner [mm]", "length [mm]", "material", "mass [kg]")
    for tube in facts["tubes"]:
        sizes = [f"{1e3 * tube[key]:.4g}" for key in ("outer_m", "inner_m", "length_m")]
        kind = tube["kind"] + (" (rigid)" if tube["rigid"] else "")
        table.add_row(kind, str(tube["number"]), *sizes, tube["material"], f"{tube['mass_kg']:.4g}")
    out.print(table)
    out.print(f"mass of the tubes: {facts['mass_kg']:.4g} kg")
    if facts["assumed"]:
        out.print(f"assumed, not printed in the source: {', '.join(facts['assumed'])}")
    if "statistics" in facts:
        found = facts["statistics"]
        if found is None:
            out.print("the 20 assumed poses of the paper are not all in its reach")
            return
        sizes = [f"{name} {found[f'{name}_mm']:.4g}" for name in ("largest", "mean", "deviation")]
        out.print(f"100 N along y0 over the 20 assumed poses: {', '.join(sizes)} mm")
        return
    table = Table("", *TWIST, title="stiffness at P, base axes [N, m, rad]")
    for name, row in zip(WRENCH, _tidy(facts["stiffness"]), strict=True):
        table.add_row(name, *[f"{value:.4g}" for value in row])
    out.print(table)
    load = " ".join(f"{part:g}" for part in facts["wrench"])
    moved = ", ".join(f"{name} {value:.7g}" for name, value in zip(TWIST, _tidy(facts["deflection"]), strict=True))
    out.print(f"deflection under {load} (N, N m): {moved} (m, rad)")
    if "frequency_hz" in facts:
        out.print(f"first natural frequency with {facts['mass_at_p_kg']:g} kg at P: {facts['frequency_hz']:.4g} Hz")
    if facts.get("margins", {}).get("slack_m"):
        _print_margins(facts["margins"])


def _tidy(values: Array) -> Array:
    """Replace entries that differ from 0 only by rounding."""
    tidy: Array = np.where(np.abs(values) > ROUNDING * np.abs(values).max(), values, 0.0)
    return tidy


def _print_margins(found: dict[str, Any]) -> None:
    force, moment = found["load"]["total_force_n"], found["load"]["moment_nm"]
    table = Table(f"margins, {force:.4g} N and {moment:g} N m of any direction", "rigid", "bent, at least")
    for name in ("type1", "type2", "constraint"):
        table.add_row(name, f"{found['rigid'][name]:.4f}", f"{found['bent_at_least'][name]:.4f}")
    out.print(table)
    sizes = [f"{1e3 * found[f'{name}_m']:.4g} mm" for name in ("slack", "displacement", "lateral")]
    out.print(f"slack of a leg {sizes[0]}; P moves by at most {sizes[1]} in the plane, {sizes[2]} across it")


def _bound(
    design: Structure,
    load: Load,
    limits: Limits,
    box: tuple[float, float, float, float] | None,
    as_json: bool,
) -> None:
    if not (load.force > 0.0 or load.moment_nm > 0.0):
        raise BadInput("--bound needs a load: give --force, --moment or --payload")
    found = stiffness.compliance_error(design, load, limits, _ranges(box))
    if as_json:
        print_json({**asdict(found), "limits": limits._asdict(), "total_force_n": load.force})
        return
    out.print(f"{design.name}: {load.force:.4g} N and {load.moment_nm:g} N m of any direction, {found.samples} poses")
    worst = ", ".join(f"{value:.4g}" for value in found.worst_pose)
    out.print(f"slack of a leg: {1e3 * found.slack_m:.4g} mm, largest at ({worst})")
    out.print(f"of that {1e3 * found.refinement_m:.2g} mm because sampling more finely still raised it")
    moved, across = 1e3 * found.displacement_m, 1e3 * found.lateral_m
    out.print(f"the platform point moves by at most {moved:.4g} mm in the plane, {across:.4g} mm across it")
    out.print(f"settings for the supervisor: compliance: counted, compliance_slack_m: {found.slack_m:.6g}")


def _map(
    design: Structure,
    wrench: tuple[float, ...],
    box: tuple[tuple[float, float], tuple[float, float]] | None,
    nodes: int,
    target: Path,
    as_json: bool,
) -> None:
    if target.suffix not in (".png", ".npz"):
        raise BadInput(f"cannot write '{target}': the suffix must be .png or .npz")
    found = stiffness.deflection_map(design, wrench, box, (nodes, nodes))
    known = found.displacement[np.isfinite(found.displacement)]
    if not known.size:
        raise Failed("no pose of the box is reached and regular: nothing to map")
    if target.suffix == ".npz":
        np.savez_compressed(target, x=found.x, z=found.z, twist=found.twist, status=found.status, wrench=found.wrench)
    else:
        from irsbot_supervisor.plots.stiffness import draw_deflection  # matplotlib takes a second to load

        load = " ".join(f"{part:g}" for part in wrench)
        draw_deflection(found, f"{design.name}: wrench {load} (N, N m) at P", target)
    facts = {"poses": known.size, "least_m": known.min(), "median_m": np.median(known), "largest_m": known.max()}
    if as_json:
        print_json({**{key: float(value) for key, value in facts.items()}, "file": target})
        return
    sizes = [f"{key.removesuffix('_m')} {1e3 * value:.4g}" for key, value in facts.items() if key != "poses"]
    out.print(f"{known.size} poses, displacement of P in mm: {', '.join(sizes)}")
    out.print(f"written to {target}")


def _overview(as_json: bool) -> None:
    rows = stiffness.table()
    if as_json:
        designs = {name: stiffness.load(name).description for name in stiffness.presets()}
        cases = [
            {**row._asdict(), "printed": row.printed._asdict(), "found": row.found and row.found._asdict()}
            for row in rows
        ]
        print_json({"designs": designs, "tables": cases})
        return
    table = Table("design", "description")
    for name in stiffness.presets():
        table.add_row(name, stiffness.load(name).description)
    out.print(table)
    table = Table("case", "printed", "model", title="mm under 100 N along y0: largest, mean, deviation; kg")
    for number, row in enumerate(rows, 1):
        table.add_row(f"{number} {row.case}", _figures(row.printed), _figures(row.found))
    out.print(table)
    for remark in dict.fromkeys(row.remark for row in rows):
        which = ", ".join(str(number) for number, row in enumerate(rows, 1) if row.remark == remark)
        out.print(f"{which}: {remark}")


def _figures(found: stiffness.Statistics | None) -> str:
    if found is None or np.isnan(found.largest_mm):
        return "-"
    return f"{found.largest_mm:.3f} {found.mean_mm:.3f} {found.deviation_mm:.3f} {found.mass_kg:.3f}"
