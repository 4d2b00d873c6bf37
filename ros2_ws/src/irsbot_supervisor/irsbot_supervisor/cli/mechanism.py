"""`check-mechanism`: tries the laws of `irsbot_kinematics.conformance` on one robot."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer
from rich.progress import TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from irsbot_kinematics import BadInput
from irsbot_kinematics.conformance import JOINTS, LAWS, Check, conformance
from irsbot_supervisor.cli.common import Failed, err, out, print_json, robot_named
from irsbot_supervisor.cli.new_mechanism_files import SKELETONS, skeleton
from irsbot_supervisor.cli.outputs import check_target
from irsbot_supervisor.cli.progress import Bars

MOST_JOINTS = 100_000
"""More joint positions take hours and do not improve the answer."""


def check_mechanism(
    robot: Annotated[str, typer.Argument(help="preset name, or YAML file that names a mechanism of yours")],
    joints: Annotated[int, typer.Option(help="random joint positions to try")] = JOINTS,
    seed: Annotated[int, typer.Option(help="of the random numbers", min=0)] = 1,
    only: Annotated[list[str] | None, typer.Option(help="check this law alone; may be repeated")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Check that a mechanism keeps the laws that supervision needs.

    They concern closure, Jacobians, forces, margins and certified bounds.
    Exit code 1 if one is broken, with the posture and the numbers that break it.

    Example: irsbot check-mechanism docs/examples/prr3/prr3.yaml.
    """
    if robot.endswith(".py") or ".py:" in robot:
        raise BadInput(f"'{robot}' has no lengths; give the YAML file of a robot with 'mechanism: {robot}'")
    if not 1 <= joints <= MOST_JOINTS:
        raise BadInput(f"--joints is {joints}, must be in 1..{MOST_JOINTS}")
    machine = robot_named(robot)
    checks: list[Check] = []
    total = 1 + (len(set(only)) if only else len(LAWS))  # that there are postures comes first
    with Bars(TimeElapsedColumn()) as progress:
        task = progress.add_task("postures", total=total)
        for check in conformance(machine, joints=joints, seed=seed, only=only or ()):
            checks.append(check)
            progress.update(task, advance=1, description=f"law {len(checks)} of {total}: {check.law} done")
    broken = [check for check in checks if check.broken]
    if as_json:
        laws = [{**check._asdict(), "holds": not check.broken} for check in checks]
        print_json({"robot": machine.name, "mechanism": machine.mechanism.kind, "holds": not broken, "laws": laws})
    else:
        _print(checks)
    if broken:
        for check in broken:
            err.print(f"{check.law} ({check.words.rstrip('.')}): {check.broken}")
        raise Failed(f"{machine.name} breaks {len(broken)} of {total} laws: {', '.join(c.law for c in broken)}")
    if not as_json:
        out.print(f"{machine.name} keeps all {total} laws" if not only else f"{machine.name} keeps {', '.join(only)}")


def new_mechanism(
    name: Annotated[str, typer.Argument(help="of the class, such as Prr3")],
    legs: Annotated[int, typer.Option(help="number of legs")] = 3,
    platform: Annotated[
        str, typer.Option(help="planar (two translations and a turn) or spatial (translations)")
    ] = "planar",
    folder: Annotated[Path, typer.Option("--out", help="where both files are written")] = Path(),
    force: Annotated[bool, typer.Option("--force", help="replace files that exist")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Write a skeleton of your own mechanism and its robot file; you fill in its equations.

    Example: irsbot new-mechanism Prr3 --legs 3 --platform planar.
    """
    if not re.fullmatch(r"[A-Z][A-Za-z0-9]*", name):
        raise BadInput(f"'{name}' is no name of a class: a capital letter, then letters and digits, such as Prr3")
    if (platform, legs) not in SKELETONS:
        known = ", ".join(f"{kind} with {count} legs" for kind, count in SKELETONS)
        raise BadInput(f"there is no skeleton of a {platform} platform with {legs} legs; there are {known}")
    files = [folder / f"{name.lower()}{suffix}" for suffix in (".py", ".yaml")]
    for file in files:
        check_target(file, [], "" if force else "--force")
    folder.mkdir(parents=True, exist_ok=True)
    for file, text in zip(files, skeleton(name, platform, legs), strict=True):
        file.write_text(text, encoding="utf-8")
    if as_json:
        print_json({"files": files})
    else:
        out.print(
            f"written to {files[0]} and {files[1]}; fill in the equations, then ./irsbot check-mechanism {files[1]}"
        )


def _print(checks: list[Check]) -> None:
    table = Table("law", "tried", "worst", "allowed", "unit", "holds")
    for check in checks:
        holds = Text("NO", "bold red") if check.broken else Text("yes", "green")
        table.add_row(check.law, str(check.tried), f"{check.worst:.2g}", f"{check.allowed:.2g}", check.unit, holds)
    out.print(table)
