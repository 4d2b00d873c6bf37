"""The command line `irsbot`."""

from __future__ import annotations

import sys

import typer

from irsbot_kinematics import InvalidGeometry, KinematicsError, NotAssembled, Unreachable
from irsbot_kinematics.stiffness import NoSize, SingularPosture
from irsbot_supervisor.cli import (
    algebra,
    bags,
    bench,
    check,
    design,
    faults,
    kinematics,
    limits,
    map,
    mechanism,
    policy,
    replay,
    report,
    runs,
    settings,
    sizing,
    stiffness,
    urdf,
)
from irsbot_supervisor.cli.common import NUMBERS, Failed, err
from irsbot_supervisor.core.motion import BadTrajectory
from irsbot_supervisor.core.settings import InvalidSettings
from irsbot_supervisor.mcap_writer import BagError
from irsbot_supervisor.sim.errors import SimulationError
from irsbot_supervisor.suite import SuiteError

app = typer.Typer(
    help="Singularity supervision of parallel robots. Not a certified safety device.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command("demo")(runs.demo)
app.command("up")(runs.up)
app.command("robots")(kinematics.list_robots)
app.command("ik", context_settings=NUMBERS)(kinematics.inverse)
app.command("dk", context_settings=NUMBERS)(kinematics.direct)
app.command("evaluate")(kinematics.evaluate)
app.command("replay")(replay.replay)
app.command("check-trajectory")(check.check_trajectory)
app.command("check-mechanism")(mechanism.check_mechanism)
app.command("info")(bags.info)
app.command("salvage")(bags.salvage)
app.command("settings")(settings.settings)
app.command("limits")(limits.limits)
app.command("report")(report.report)
app.command("bench")(bench.bench)
app.command("faults")(faults.faults)
app.command("map")(map.draw)
app.command("stiffness", context_settings=NUMBERS)(stiffness.show)
app.command("policy")(policy.policy)
app.command("urdf")(urdf.write)
design.app.command("size")(sizing.size)
app.add_typer(design.app, name="design")
app.add_typer(algebra.app, name="algebra")

BAD_INPUT = (InvalidSettings, BadTrajectory, InvalidGeometry, BagError, SimulationError, KinematicsError)
"""What a user can cause; each says in one sentence what is wrong and what would be right."""


def main() -> None:
    """Run a command; exit code 0 done, 1 the checked thing failed, 2 bad usage or input. No traceback for either."""
    try:
        app(prog_name="irsbot", standalone_mode=True)
    except (Failed, Unreachable, NotAssembled, SingularPosture, NoSize, SuiteError) as error:
        err.print(f"irsbot: {error}")
        sys.exit(1)
    except BAD_INPUT as error:
        err.print(f"irsbot: {error}")
        sys.exit(2)
    except OSError as error:
        err.print(f"irsbot: {error.filename or 'system'}: {error.strerror or error}")
        sys.exit(2)
