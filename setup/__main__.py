"""Entry of ./irsbot: set-up, then the command. Standard library only, because nothing is installed yet."""

from __future__ import annotations

import os
import shlex
import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import FrameType
from typing import NoReturn

import checks
import compiled
import problems
import progress
import steps
from place import Place

USAGE = """\
Usage: ./irsbot COMMAND [ARGS]

  setup         set up whatever is missing; every command does that first
                --compiled: compile the core and the kinematics, too
                --plain: do without again
  test [ARGS]   ruff, mypy and every test
                with ARGS pytest alone, given these: ./irsbot test -k margin
  python ARGS   the interpreter of the environment:
                ./irsbot python -c 'import rclpy'
  shell [ARGS]  a bash in which ROS 2 and the workspace are sourced

IRSBOT_PLAIN=1 runs plain Python, without any machine code.
Uses a sourced ROS 2 Jazzy, or installs one from wheels in .venv
(IRSBOT_ROS=wheels insists on that). IRSBOT_PYTHON names the Python 3.10, 3.11
or 3.12 to start from.
"""
SIGPIPE_CODE = 128 + 13  # of a command whose reader has closed the pipe, as of every program that this signal ends
WITHOUT_SETUP = "The other commands, such as demo, are listed once ./irsbot setup was run.\n"


class Interrupted(KeyboardInterrupt):
    """A request to end, with its signal; Ctrl-C is a KeyboardInterrupt without one."""


def main(arguments: list[str]) -> int:
    """Run one command; the exit code, if the command did not take over the process."""
    for number in (signal.SIGTERM, signal.SIGHUP):
        if signal.getsignal(number) is not signal.SIG_IGN:  # as nohup wants it
            signal.signal(number, interrupt)
    here = Path(__file__).resolve().parent.parent
    sourced = os.environ.get("IRSBOT_ROS") == "sourced"
    place = Place(here, sourced, sys.executable if sourced else os.path.realpath(sys.executable))
    try:
        return run(place, arguments)
    except problems.ProblemError as problem:
        print(f"irsbot: {problem}", file=sys.stderr)
        return 2
    except progress.CommandError as error:
        print(
            f"{error}\nirsbot: a step of the set-up failed as shown above, all of it is in {place.log}", file=sys.stderr
        )
        return 1
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # buffered output has no reader
        return SIGPIPE_CODE
    except OSError as error:
        print(f"irsbot: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as asked:
        print("irsbot: interrupted, the same command resumes", file=sys.stderr)
        return 128 + (asked.args[0] if asked.args else signal.SIGINT)


def run(place: Place, arguments: Sequence[str]) -> int:
    """Set up, then run the command."""
    command, *rest = arguments or ["--help"]
    if command in ("--help", "-h", "help"):
        print(USAGE, end="", flush=True)
        if steps.missing_steps(place):
            print(WITHOUT_SETUP, end="")
            return 0
        print("The commands of the suite:", flush=True)
    if command == "setup" and rest not in ([], [compiled.COMPILED], [compiled.PLAIN]):
        raise problems.ProblemError(f"setup takes {compiled.COMPILED} or {compiled.PLAIN}, got {' '.join(rest)}")
    steps.prepare(place)
    if command == "setup":
        steps.renew_machine_code(place)
        compiled.prepare(place, *rest)
    env = compiled.added_to(place.environment(), place)
    if command == "setup":
        print("irsbot: set up")
        return 0
    if command == "test":
        if place.sourced:
            problems.need_modules(place.python, problems.CHECK_MODULES)
        checks.forget_removed(place.byte_code)
        return checks.run_checks(checks.checks(place.interpreter, rest), place.root, env)
    if command == "python":
        become([place.interpreter, *rest], env)
    if command == "shell":
        open_shell(place, rest, env)
    become([place.interpreter, "-m", "irsbot_supervisor", *arguments], {**env, "IRSBOT_COMMAND": "./irsbot"})


def open_shell(place: Place, arguments: Sequence[str], env: Mapping[str, str]) -> NoReturn:
    """Bash in the environment; if it is interactive, the user's own start-up file runs first."""
    if arguments:
        become(["bash", *arguments], env)
    changed = {name: value for name, value in env.items() if os.environ.get(name) != value}
    exports = "\n".join(f"export {name}={shlex.quote(value)}" for name, value in changed.items())
    become(["bash", "--rcfile", str(place.root / "setup" / "shell.bashrc")], {**env, "IRSBOT_EXPORTS": exports})


def become(command: Sequence[str], env: Mapping[str, str]) -> NoReturn:
    """Replace this process by the command."""
    os.execvpe(command[0], list(command), env)


def interrupt(number: int, frame: FrameType | None) -> NoReturn:
    """End a set-up on a signal as Ctrl-C does."""
    raise Interrupted(number)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
