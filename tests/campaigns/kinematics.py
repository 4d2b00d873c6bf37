"""Kinematics and margins of the IRSBot-2 on a large scale, against the robot in space (oracles/irsbot2_3d.py).

    python tests/campaigns/kinematics.py            # some minutes
    python tests/campaigns/kinematics.py --quick    # seconds; also run by the tests
    python tests/campaigns/kinematics.py --part sharp

round trip   random poses, every working mode: status against the annuli of both legs, pose against pose
margins      random designs and postures: Type 1, Type 2 and constraint margins against points, axes, singular values
loci         presets and random designs: margins along the curves of parallel singularities and at constraint points
guarantees   random designs, postures and boxes of joints: no margin in a box is below what was promised for it
geometry     the same for machines of every kind of which every length and place is off, each on its own
sharp        the same for bounds of second order, exact machines and wrong ones in turn; the worst points are searched
clearances   random designs and postures: no point of a locus of the same working mode is nearer than the clearance

Exit code 1 if anything exceeds its limit.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

PACKAGE = Path(__file__).parents[2] / "ros2_ws/src/irsbot_kinematics"
sys.path[:0] = [str(PACKAGE), str(PACKAGE / "test/oracles")]

from kinematics_bounds import geometry, guarantees, sharp  # type: ignore[import-not-found]  # noqa: E402
from kinematics_cases import PRESETS, Result, Tick  # type: ignore[import-not-found]  # noqa: E402
from kinematics_postures import (  # type: ignore[import-not-found]  # noqa: E402
    clearances,
    margins,
    round_trip,
    singular_loci,
)

PARTS = ("round trip", "margins", "loci", "guarantees", "geometry", "sharp", "clearances")


def run(quick: bool, seed: int, progress: Progress | None = None, only: str | None = None) -> list[Result]:
    """All parts, or one; `quick` is a thousandth of the work."""
    poses, designs, postures, points = (4_000, 40, 60, 200) if quick else (1_000_000, 2_000, 300, 4_000)
    parts: list[tuple[str, int, Callable[[Tick], Result]]] = [
        ("round trip", poses, lambda tick: round_trip(poses, seed, tick)),
        ("margins", designs, lambda tick: margins(designs, postures, seed + 1, tick)),
        ("loci", designs // 4 + len(PRESETS), lambda tick: singular_loci(designs // 4, points, seed + 2, tick)),
        ("guarantees", designs // 4, lambda tick: guarantees(designs // 4, postures // 4, 60, seed + 3, tick)),
        ("geometry", designs, lambda tick: geometry(designs, postures // 20, seed + 6, tick)),
        ("sharp", designs, lambda tick: sharp(designs, postures // 20, seed + 5, tick)),
        ("clearances", designs // 4, lambda tick: clearances(designs // 4, postures, points // 2, seed + 4, tick)),
    ]
    results = []
    for name, total, part in parts:
        if only not in (None, name):
            continue
        task = progress.add_task(name, total=total) if progress else None

        def tick(done: int, task: object = task) -> None:
            if progress and task is not None:
                progress.advance(task, done)

        results.append(part(tick))
    return results


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="a short version")
    parser.add_argument("--part", choices=PARTS, help="one part alone")
    parser.add_argument("--seed", type=int, default=1, help="other numbers, same statement")
    options = parser.parse_args()
    console = Console()
    with Progress(console=console) as progress:
        results = run(options.quick, options.seed, progress, options.part)
    table = Table("part", "cases", "boxes", "largest error", "wrong", "")
    for result in results:
        table.add_row(
            result.name,
            f"{result.cases:,}",
            f"{result.boxes:,}" if result.boxes else "",
            f"{result.worst:.2e}",
            str(result.wrong),
            "ok" if result.passed else "FAILED",
        )
    console.print(table)
    return 0 if all(result.passed for result in results) else 1


if __name__ == "__main__":
    sys.exit(main())
