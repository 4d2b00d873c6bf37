"""Start of executables: a signal while the libraries load ends the process with exit code 0, and a missing library
gives one sentence; no traceback for either."""

from __future__ import annotations

import os
import signal
import sys
from importlib import import_module
from typing import NoReturn

from irsbot_msgs_py.process.usage import USAGE


def start(module: str) -> NoReturn:
    """Load a module and run its `main`, which has its own signal handlers."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    for number in before:
        signal.signal(number, lambda *_: os._exit(0))  # nothing has begun that would have to be ended
    try:
        main = import_module(module).main
    except ModuleNotFoundError as error:
        refuse_missing(error)
    for number, handler in before.items():
        signal.signal(number, handler)
    sys.exit(main())


def refuse_missing(error: ModuleNotFoundError) -> NoReturn:
    """End the process: a library is missing."""
    library = (error.name or "").split(".")[0]
    print(
        f"the Python library '{library}' is missing: docs/how_to/ros2_machine.md says how to install it",
        file=sys.stderr,
    )
    sys.exit(USAGE)
