"""The command line `irsbot`.

Only the module of the command that is called is loaded; all of them for the list of commands.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from typing import Annotated, Any, NamedTuple

import typer
from typer.models import CommandInfo

from irsbot_kinematics import NotAssembled, Unreachable
from irsbot_kinematics.stiffness import NoSize, SingularPosture
from irsbot_msgs_py.process.start import refuse_missing
from irsbot_supervisor import __version__
from irsbot_supervisor.cli.common import BAD_INPUT, NUMBERS, Failed, err, out
from irsbot_supervisor.cli.outputs import guarded
from irsbot_supervisor.processes.suite import SuiteError


class Place(NamedTuple):
    """Where a command is: a module of this package and a function in it."""

    module: str
    function: str
    takes_numbers: bool = False  # a negative number is an argument, not an option


COMMANDS = {
    "demo": Place("demo", "demo"),
    "up": Place("up", "up"),
    "robots": Place("kinematics", "list_robots"),
    "ik": Place("kinematics", "inverse", takes_numbers=True),
    "dk": Place("kinematics", "direct", takes_numbers=True),
    "evaluate": Place("evaluate", "evaluate"),
    "replay": Place("replay", "replay"),
    "check-trajectory": Place("check", "check_trajectory"),
    "verdict": Place("operate", "verdict"),
    "monitor": Place("monitor", "monitor"),
    "reset": Place("operate", "reset"),
    "set": Place("operate", "set_", takes_numbers=True),
    "check-mechanism": Place("mechanism", "check_mechanism"),
    "new-mechanism": Place("mechanism", "new_mechanism"),
    "info": Place("bags", "info"),
    "salvage": Place("bags", "salvage"),
    "settings": Place("settings", "settings"),
    "limits": Place("limits", "limits"),
    "report": Place("report", "report"),
    "bench": Place("bench", "bench"),
    "faults": Place("faults", "faults"),
    "docs": Place("docs", "docs"),
    "map": Place("map", "draw"),
    "stiffness": Place("stiffness", "show", takes_numbers=True),
    "policy": Place("policy", "policy"),
    "urdf": Place("urdf", "write"),
}
GROUPS = {"send": "operate", "design": "design", "algebra": "algebra"}
"""Group of commands -> module whose `app` has them."""

ELSEWHERE = {"design": {"sweep": Place("sweep", "sweep"), "size": Place("sizing", "size")}}
"""Members of a group from other modules."""

UNGUARDED = ("salvage",)
"""Commands that write, without the rule for files: a bag is always a new one."""


def app_of(names: Iterable[str]) -> typer.Typer:
    """The command line with these commands and groups."""
    app = typer.Typer(
        help="Singularity supervision of parallel robots. Not a certified safety device.",
        no_args_is_help=True,
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
    )
    app.callback()(_options)
    for name in names:
        if name in COMMANDS:
            app.registered_commands.append(_command(name))
        else:
            group = _group(name)
            app.add_typer(group, name=name, short_help=str(group.info.help).partition("\n")[0].rstrip("."))
    return app


def whole_app() -> typer.Typer:
    """The command line with everything."""
    return app_of((*COMMANDS, *GROUPS))


def commands_of(app: typer.Typer) -> Iterator[CommandInfo]:
    """Every command, also those of groups."""
    yield from app.registered_commands
    for group in app.registered_groups:
        assert group.typer_instance is not None
        yield from group.typer_instance.registered_commands


@cache
def _command(name: str) -> CommandInfo:
    place = COMMANDS[name]
    made = CommandInfo(name, callback=_function(place), context_settings=NUMBERS if place.takes_numbers else None)
    _finish(made, name)
    return made


@cache
def _group(name: str) -> typer.Typer:
    app: typer.Typer = import_module(f"irsbot_supervisor.cli.{GROUPS[name]}").app
    for member, place in ELSEWHERE.get(name, {}).items():
        app.command(member)(_function(place))
    for made in app.registered_commands:
        _finish(made, made.name or "")
    return app


def _function(place: Place) -> Callable[..., Any]:
    function: Callable[..., Any] = getattr(import_module(f"irsbot_supervisor.cli.{place.module}"), place.function)
    return function


def _finish(made: CommandInfo, name: str) -> None:
    """The first sentence is the summary, never cut; files are written by one rule."""
    assert made.callback is not None
    made.short_help = (made.callback.__doc__ or "").partition("\n")[0].partition(". ")[0].rstrip(".")
    if name not in UNGUARDED:
        made.callback = guarded(made.callback)


def _say_version(asked: bool) -> None:
    if asked:
        out.print(f"irsbot {__version__}")
        raise typer.Exit


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
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115  its caller has closed it
    _end_in_order_when_told_to()
    called = sys.argv[1] if len(sys.argv) > 1 else ""
    try:
        app = app_of([called]) if called in COMMANDS or called in GROUPS else whole_app()
    except ModuleNotFoundError as error:
        refuse_missing(error)
    _name_the_program(app, program)
    try:
        code = app(prog_name=program, standalone_mode=False)
        sys.stdout.flush()
    except BrokenPipeError:
        _drop_output()
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
        err.print(f"irsbot: {f'{error.filename}: ' if error.filename else ''}{error.strerror or error}")
        if not error.filename:  # standard output, on a full disk
            _drop_output()
        sys.exit(2)
    if code:
        sys.exit(code)


def _drop_output() -> None:
    """Nobody takes what is buffered; Python would try once more at its end."""
    with suppress(OSError):  # a stream without a file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def _end_in_order_when_told_to() -> None:
    """Treat SIGTERM, from a service manager or CI, as Ctrl-C: bags are closed and drafts of files removed."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)


def _name_the_program(app: typer.Typer, program: str) -> None:
    """In the examples of the help texts."""
    for command in commands_of(app):
        if command.callback is not None and command.callback.__doc__:
            command.callback.__doc__ = command.callback.__doc__.replace("Example: irsbot", f"Example: {program}")
    for group in app.registered_groups:
        assert group.typer_instance is not None
        group.help = str(group.typer_instance.info.help).replace("Example: irsbot", f"Example: {program}")


def _say_usage(error: Any) -> None:
    """Print one line and the command for more help; the whole help if no command was given."""
    context = error.ctx
    if context is not None and type(error).__name__ == "NoArgsIsHelpError":
        err.print(context.get_help())
        return
    where = f"; see {context.command_path} --help" if context is not None else ""
    err.print(f"irsbot: {' '.join(error.format_message().split()).rstrip('.')}{where}")
