"""The command line `irsbot`."""

from __future__ import annotations

import sys

import typer

from irsbot_kinematics import NotAssembled, Unreachable
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
    replay,
    report,
    runs,
    settings,
    sizing,
    stiffness,
)
from irsbot_supervisor.cli.common import BAD_INPUT, NUMBERS, Failed, err
from irsbot_supervisor.cli.outputs import guarded
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
design.app.command("size")(sizing.size)
app.add_typer(design.app, name="design")
app.add_typer(algebra.app, name="algebra")
for group in (app, design.app, algebra.app):
    for command in group.registered_commands:
        if command.callback is not None and command.callback is not bags.salvage:  # a bag is always a new one
            command.callback = guarded(command.callback)


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
