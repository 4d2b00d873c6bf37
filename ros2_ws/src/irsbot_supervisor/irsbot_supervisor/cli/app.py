"""The command line `irsbot`."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from typing import Annotated, Any

import typer
from typer.models import CommandInfo

from irsbot_kinematics import NotAssembled, Unreachable
from irsbot_kinematics.stiffness import NoSize, SingularPosture
from irsbot_supervisor import __version__
from irsbot_supervisor.cli import (
    algebra,
    bags,
    bench,
    check,
    demo,
    design,
    docs,
    evaluate,
    faults,
    kinematics,
    limits,
    map,
    mechanism,
    monitor,
    operate,
    policy,
    replay,
    report,
    settings,
    sizing,
    stiffness,
    sweep,
    up,
    urdf,
)
from irsbot_supervisor.cli.common import BAD_INPUT, NUMBERS, Failed, err, out
from irsbot_supervisor.cli.outputs import guarded
from irsbot_supervisor.processes.suite import SuiteError

app = typer.Typer(
    help="Singularity supervision of parallel robots. Not a certified safety device.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    add_completion=False,
)
app.command("demo")(demo.demo)
app.command("up")(up.up)
app.command("robots")(kinematics.list_robots)
app.command("ik", context_settings=NUMBERS)(kinematics.inverse)
app.command("dk", context_settings=NUMBERS)(kinematics.direct)
app.command("evaluate")(evaluate.evaluate)
app.command("replay")(replay.replay)
app.command("check-trajectory")(check.check_trajectory)
app.command("verdict")(operate.verdict)
app.command("monitor")(monitor.monitor)
app.command("reset")(operate.reset)
app.command("set", context_settings=NUMBERS)(operate.set_)
app.command("check-mechanism")(mechanism.check_mechanism)
app.command("new-mechanism")(mechanism.new_mechanism)
app.command("info")(bags.info)
app.command("salvage")(bags.salvage)
app.command("settings")(settings.settings)
app.command("limits")(limits.limits)
app.command("report")(report.report)
app.command("bench")(bench.bench)
app.command("faults")(faults.faults)
app.command("docs")(docs.docs)
app.command("map")(map.draw)
app.command("stiffness", context_settings=NUMBERS)(stiffness.show)
app.command("policy")(policy.policy)
app.command("urdf")(urdf.write)
design.app.command("sweep")(sweep.sweep)
design.app.command("size")(sizing.size)
for name, group in (("send", operate.app), ("design", design.app), ("algebra", algebra.app)):
    app.add_typer(group, name=name, short_help=str(group.info.help).partition("\n")[0].rstrip("."))


def _commands() -> Iterator[CommandInfo]:
    """Every command, also those of groups."""
    for group in (app, operate.app, design.app, algebra.app):
        yield from group.registered_commands


for command in _commands():
    assert command.callback is not None
    command.short_help = (command.callback.__doc__ or "").partition("\n")[0].partition(". ")[0].rstrip(".")  # never cut
    if command.callback is not bags.salvage:  # a bag is always a new one
        command.callback = guarded(command.callback)


def _say_version(asked: bool) -> None:
    if asked:
        out.print(f"irsbot {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    _version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="print the version")
    ] = False,
) -> None:
    pass


USAGE_ERROR: Any = typer.BadParameter.__bases__[0]
"""Exception of typer for a command line that it cannot parse; it has no public name."""

SIGPIPE_CODE = 128 + 13
"""Exit code of a command whose reader has closed the pipe, as of every program that this signal ends."""


def main() -> None:
    """Run a command; exit code 0 done, 1 a check failed, 2 bad usage or input. Prints no traceback for these."""
    program = os.environ.get("IRSBOT_COMMAND", "irsbot")  # as the user called it
    for command in _commands():
        if command.callback is not None and command.callback.__doc__:
            command.callback.__doc__ = command.callback.__doc__.replace("Example: irsbot", f"Example: {program}")
    for group in app.registered_groups:
        assert group.typer_instance is not None
        group.help = str(group.typer_instance.info.help).replace("Example: irsbot", f"Example: {program}")
    try:
        code = app(prog_name=program, standalone_mode=False)
        sys.stdout.flush()
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # buffered output has no reader
        sys.exit(SIGPIPE_CODE)
    except USAGE_ERROR as error:
        _say_usage(error)
        sys.exit(2)
    except (Failed, Unreachable, NotAssembled, SingularPosture, NoSize, SuiteError) as error:
        err.print(f"irsbot: {error}")
        sys.exit(1)
    except BAD_INPUT as error:
        err.print(f"irsbot: {error}")
        sys.exit(2)
    except OSError as error:
        err.print(f"irsbot: {error.filename or 'system'}: {error.strerror or error}")
        sys.exit(2)
    if code:
        sys.exit(code)


def _say_usage(error: Any) -> None:
    """Print one line and the command for more help; the whole help if no command was given."""
    context = error.ctx
    if context is not None and type(error).__name__ == "NoArgsIsHelpError":
        err.print(context.get_help())
        return
    where = f"; see {context.command_path} --help" if context is not None else ""
    err.print(f"irsbot: {' '.join(error.format_message().split()).rstrip('.')}{where}")
