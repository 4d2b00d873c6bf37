"""The steps of the set-up. Each is stamped with a key of its input, and repeated when the key changes."""

from __future__ import annotations

import fcntl
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import problems
import work
from fingerprint import fingerprint, workspace_parts
from place import Place
from progress import CommandError, Progress

FORMAT = "1"  # raise it when the work of a step changes


@dataclass(frozen=True)
class Step:
    """One step, the key of its base, and the key of its whole input."""

    title: str
    stamp: Path
    products: tuple[Path, ...]
    base: str
    key: str
    work: Callable[[Place, Progress, str], None]

    def state(self) -> str:
        """What the last set-up left here.

        "done"; "outdated": complete, on the same base, but made from something older; "begun": interrupted;
        "absent": not there, or standing on something else.
        """
        try:
            stamp = json.loads(self.stamp.read_text())
            complete, base, key = stamp["complete"], stamp["base"], stamp["key"]
        except (OSError, ValueError, KeyError, TypeError):
            return "absent"
        if not complete:
            return "begun"
        if base != self.base or not all(product.exists() for product in self.products):
            return "absent"
        return "done" if key == self.key else "outdated"

    def mark(self, *, complete: bool) -> None:
        """Write the stamp, whole or not at all."""
        self.stamp.parent.mkdir(parents=True, exist_ok=True)
        fresh = self.stamp.with_suffix(".new")
        fresh.write_text(json.dumps({"complete": complete, "base": self.base, "key": self.key}))
        fresh.replace(self.stamp)


def all_steps(place: Place) -> list[Step]:
    """Every step in order, each with the key of the one before as its base."""
    python = fingerprint([FORMAT, str(place.root), place.python, "{}.{}".format(*sys.version_info)])
    built = (place.install / "local_setup.bash", place.paths_file)
    if place.sourced:
        ros = fingerprint([python, place.underlay()["AMENT_PREFIX_PATH"]])
        before = []
    else:
        ros = fingerprint([python, (place.root / "setup" / "requirements.txt").read_bytes()])
        venv = place.venv
        before = [
            Step("Python", venv / "irsbot_python.json", (venv / "bin/python",), python, python, work.make_venv),
            Step("ROS 2 and libraries", venv / "irsbot_ros.json", (), python, ros, work.install_libraries),
        ]
    workspace = fingerprint([ros, *workspace_parts(place.workspace / "src")])
    return [*before, Step("workspace", place.build / "irsbot_build.json", built, ros, workspace, work.build_workspace)]


def missing_steps(place: Place) -> list[Step]:
    """The steps that are missing, in order.

    Steps after a missing one are not trusted, nor is an environment with an interrupted installation: it is made anew
    from its first step.
    """
    steps = all_steps(place)
    states = [step.state() for step in steps]
    if "begun" in states[:-1]:
        return steps
    return next((steps[number:] for number, state in enumerate(states) if state != "done"), [])


def prepare(place: Place) -> None:
    """Run the missing steps. Usually there are none, and then no lock is taken."""
    if not missing_steps(place):
        return
    with alone(place) as lock:
        steps = missing_steps(place)  # another one may have taken them meanwhile
        if steps:
            _need_everything_for(place, steps)
            with Progress(place.log, total=len(steps), keep_open=[lock]) as progress:
                for step in steps:
                    _take(step, place, progress)


def renew_machine_code(place: Place) -> None:
    """Make the machine code of bounds that have changed since the workspace was built."""
    if work.has_machine_code(place):
        return
    with (
        alone(place) as lock,
        Progress(place.log, total=1, keep_open=[lock]) as progress,
        progress.step("machine code"),
    ):
        work.make_machine_code(place, progress)


def _take(step: Step, place: Place, progress: Progress) -> None:
    try:
        with progress.step(step.title):
            before = step.state()
            step.mark(complete=False)
            step.work(place, progress, before)
            step.mark(complete=True)
    except (CommandError, OSError) as error:
        known = problems.explain(str(error))
        if known is None:
            raise
        raise problems.ProblemError(f"{known} (details: {place.log})") from error


@contextmanager
def alone(place: Place) -> Iterator[int]:
    """Hold the lock of the set-up: two set-ups in one directory would overwrite each other.

    The commands of the set-up inherit it, so that it outlives a set-up that was killed while one of them continues.
    """
    lock = os.open(place.root / "setup", os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("irsbot: another one is setting up here, waiting for it to end", file=sys.stderr, flush=True)
            fcntl.flock(lock, fcntl.LOCK_EX)
        yield lock
    finally:
        os.close(lock)


def _need_everything_for(place: Place, steps: list[Step]) -> None:
    """Raise ProblemError if the machine lacks something, before any work is done."""
    problems.need_own_build(steps[-1].stamp, (place.build, place.install))
    problems.need_compilers()
    if place.sourced:
        problems.need_tools("colcon", "cmake")
        problems.need_modules(place.python, problems.MODULES)
    elif steps[0].work is work.make_venv:
        problems.need_wheel_platform()
        problems.need_space(place.root)
        announcement = "irsbot: setting up, once: a few minutes, 0.5 GB to download, 1.3 GB on the disk"
        print(announcement, file=sys.stderr, flush=True)
