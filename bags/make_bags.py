"""Makes the bags of this folder again: simulated runs in simulated time, the same every time.

    ./irsbot python bags/make_bags.py [NAME ...]

Run by hand when the recorded format or a scenario changes; the tests only replay. The stories in expected.json are
written by people and never touched here.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from pathlib import Path
from typing import NamedTuple

from irsbot_supervisor.configuration.loading import read_settings, shipped_values
from irsbot_supervisor.sim.closed_loop import cycles, record
from irsbot_supervisor.sim.simulation import simulation_from

HERE = Path(__file__).parent

RATE_HZ = 500.0
"""Half of the usual rate keeps every bag below 1 MB."""


class Run(NamedTuple):
    """One bag: what the robot does, for how long, and what goes wrong on the way."""

    robot: str
    scenario: str
    seconds: float
    faults: str = ""
    resets_s: tuple[float, ...] = ()
    """When an operator wants to end the stop in force."""
    cycle_s: float = 0.0
    """How long the scenario works before it does something else, a whole cycle at least; 0: as it says."""


RUNS = {
    "pick_and_place": Run("irsbot2", "pick_and_place", 1.7),
    "workspace_boundary": Run("irsbot2", "workspace_boundary", 1.3),
    "type2": Run("irsbot2_beta45", "type2", 1.3),
    "constraint": Run("irsbot2_csc", "constraint", 1.3),
    "orthoglide": Run("orthoglide", "demo", 2.1, cycle_s=1e-3),
    "cuspidal_loop": Run("rrr3_at_a_cusp.yaml", str(HERE / "around_a_cusp.yaml"), 5.5),
    "cuspidal_struts": Run("rpr3", "cusp", 4.5),
    "stop_and_reset": Run(
        "irsbot2", str(HERE / "down_and_up.yaml"), 1.5, "latency:by=0.03,at=0.4,lasting=0.15", (0.47, 0.9)
    ),
    "nan_positions": Run("irsbot2", "pick_and_place", 1.3, "nan:count=10,at=0.7"),
    "drop_out": Run("irsbot2", "pick_and_place", 1.5, "drop:count=100,at=0.7"),
    "glitch": Run("irsbot2", "pick_and_place", 1.3, "glitch:count=1,at=0.65"),
    "frozen_encoder": Run("irsbot2", "pick_and_place", 1.3, "freeze:which=position,at=0.65,lasting=0.2"),
    "clock_step": Run("irsbot2", "pick_and_place", 1.3, "stamp_shift:by=1.0,at=0.65,lasting=0.2"),
    "mode_flip": Run("irsbot2", "pick_and_place", 1.3, "mode_flip:at=0.65,lasting=0.1", (0.72, 1.0)),
}


def main() -> int:
    """Make the named bags, or all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(RUNS)}; all if left out")
    names = parser.parse_args().names or list(RUNS)
    if unknown := set(names) - set(RUNS):
        parser.error(f"no bag '{min(unknown)}'; there are {', '.join(RUNS)}")
    os.chdir(HERE)  # robot files are recorded by the path that is given: a relative one
    for name in names:
        make(name, RUNS[name])
    return 0


def make(name: str, run: Run) -> None:
    """Replace the recorded files of one bag; its story stays."""
    settings, robot = read_settings(run.robot)
    shipped = shipped_values(robot)
    values = {key: shipped[key] for key in ("velocity_limit", "deceleration_limit") if key in shipped}
    values |= {"robot": run.robot, "scenario": run.scenario, "rate_hz": RATE_HZ, "cycle_s": run.cycle_s}
    simulation = simulation_from({**values, "encoder_resolution": settings.encoder_resolution}, robot)
    folder = HERE / name
    expectation = (folder / "expected.json").read_text() if (folder / "expected.json").is_file() else None
    shutil.rmtree(folder, ignore_errors=True)
    record(cycles(simulation, robot, settings, run.faults or None, run.resets_s), run.seconds, robot, settings, folder)
    if expectation is not None:
        (folder / "expected.json").write_text(expectation)
    size = sum(file.stat().st_size for file in folder.iterdir())
    print(f"{name}: {run.seconds} s of {Path(run.scenario).stem} with {run.robot}, {size / 1024:.0f} KiB")


if __name__ == "__main__":
    sys.exit(main())
