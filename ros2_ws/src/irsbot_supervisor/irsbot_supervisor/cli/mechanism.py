"""`check-mechanism`: the laws of `irsbot_kinematics.conformance`, tried on one robot."""

from __future__ import annotations

from typing import Annotated

import typer
from rich.progress import Progress, TextColumn, TimeElapsedColumn
from rich.table import Table
from rich.text import Text

from irsbot_kinematics import BadInput
from irsbot_kinematics.conformance import JOINTS, LAWS, Check, conformance
from irsbot_supervisor.cli.common import Failed, err, out, print_json, robot_named

MOST_JOINTS = 100_000
"""Beyond this the answer takes hours and is no better."""


def check_mechanism(
    robot: Annotated[str, typer.Argument(help="preset name, or YAML file that names a mechanism of yours")],
    joints: Annotated[int, typer.Option(help="random joint positions to try")] = JOINTS,
    seed: Annotated[int, typer.Option(help="of the random numbers")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Does a mechanism keep the laws on which supervision stands: closure, Jacobians, forces, margins, guarantees.

    Exit code 1 if one is broken, with the posture and the numbers that break it.

    Example: irsbot check-mechanism docs/examples/prr3/prr3.yaml
    """
    if robot.endswith(".py") or ".py:" in robot:
        raise BadInput(f"'{robot}' has no lengths; give the YAML file of a robot with 'mechanism: {robot}'")
    if not 1 <= joints <= MOST_JOINTS:
        raise BadInput(f"--joints is {joints}, must be in 1..{MOST_JOINTS}")
    machine = robot_named(robot)
    checks: list[Check] = []
    with Progress(TextColumn("{task.description}"), TimeElapsedColumn(), console=err, transient=True) as progress:
        task = progress.add_task("postures", total=len(LAWS) + 1)
        for check in conformance(machine, joints=joints, seed=seed):
            checks.append(check)
            progress.update(task, advance=1, description=f"law {len(checks)} of {len(LAWS) + 1}: {check.law} done")
    broken = [check for check in checks if check.broken]
    if as_json:
        laws = [{**check._asdict(), "holds": not check.broken} for check in checks]
        print_json({"robot": machine.name, "mechanism": machine.mechanism.kind, "holds": not broken, "laws": laws})
    else:
        _print(checks)
    if broken:
        for check in broken:
            err.print(f"{check.law} ({check.words.rstrip('.')}): {check.broken}")
        raise Failed(f"{machine.name} breaks {len(broken)} of {len(LAWS) + 1} laws: {', '.join(c.law for c in broken)}")
    if not as_json:
        out.print(f"{machine.name} keeps all {len(checks)} laws")


def _print(checks: list[Check]) -> None:
    table = Table("law", "tried", "worst", "allowed", "unit", "holds")
    for check in checks:
        holds = Text("NO", "bold red") if check.broken else Text("yes", "green")
        table.add_row(check.law, str(check.tried), f"{check.worst:.2g}", f"{check.allowed:.2g}", check.unit, holds)
    out.print(table)
