"""`map`: margins over the workspace, as numbers and as pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics import BadInput
from irsbot_kinematics.analysis.workspace_maps import QUANTITIES
from irsbot_supervisor.cli.cluster import SchedulerOption, WorkersOption, cluster_of
from irsbot_supervisor.cli.common import out, print_json
from irsbot_supervisor.cli.map_many import draw_many
from irsbot_supervisor.cli.map_one import FORCE, PICTURES, Wanted, draw_robot


def draw(
    robots: Annotated[list[str], typer.Argument(metavar="ROBOT...", help="preset names or YAML files")],
    what: Annotated[str, typer.Option(help=f"one of {', '.join((*QUANTITIES, FORCE))}")] = "type2",
    dataset: Annotated[
        Path,
        typer.Option(
            "-o",
            "--output",
            help=".png, .svg or .pdf for a picture, .npz for the numbers; for several robots a folder, without a "
            "suffix",
        ),
    ] = Path("map.png"),
    suffix: Annotated[str, typer.Option("--format", help="of the files in a folder: png, svg, pdf or npz")] = "png",
    mode: Annotated[str | None, typer.Option(help="working mode; the usual one if left out")] = None,
    box: Annotated[
        tuple[float, float, float, float] | None,
        typer.Option(metavar="LOW HIGH LOW HIGH", help="ranges of the first two coordinates, m"),
    ] = None,
    joint_space: Annotated[
        bool, typer.Option("--joints", help="over the first two joints, usual assembly mode")
    ] = False,
    at: Annotated[list[float] | None, typer.Option(help="value of a further coordinate; once for each")] = None,
    load: Annotated[float | None, typer.Option(help="of --what force: N, of any direction; 10 if left out")] = None,
    moment: Annotated[float | None, typer.Option(help="likewise: N m, of either sign; 0 if left out")] = None,
    admissible: Annotated[float | None, typer.Option(help="likewise: N that a leg may carry")] = None,
    centre: Annotated[
        str | None, typer.Option(help="likewise: pose, as 0,-0.8, around which the force workspace is found")
    ] = None,
    nodes: Annotated[int, typer.Option(help="nodes of the grid along each axis", min=2, max=4000)] = 400,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Map a margin over the workspace of one working mode, with loci, constraint points and the free rectangle.

    With --what force: the largest leg force under a load of any direction, and where it stays admissible.

    Example: irsbot map irsbot2_beta45 --what type2 -o map.png

    Several robots give a file each: irsbot map irsbot2 five_bar irsbot2_csc -o maps
    """
    if what not in (*QUANTITIES, FORCE):
        raise BadInput(f"--what is '{what}', must be one of {', '.join((*QUANTITIES, FORCE))}")
    if what != FORCE and any(option is not None for option in (load, moment, admissible, centre)):
        raise BadInput("--load, --moment, --admissible and --centre belong to --what force")
    cluster = cluster_of(scheduler, workers)
    force = 10.0 if load is None else load, moment or 0.0
    wanted = Wanted(what, mode, box, joint_space, tuple(at or ()), *force, admissible, centre, nodes)
    if len(robots) == 1 and dataset.suffix:
        if dataset.suffix not in (*PICTURES, ".npz"):
            raise BadInput(f"cannot write '{dataset}': the suffix must be {', '.join(PICTURES)} or .npz")
        drawn = draw_robot(robots[0], wanted, dataset)
        if as_json:
            print_json({**drawn.facts, "file": dataset})
            return
        for line in drawn.lines:
            out.print(line)
        out.print(f"written to {dataset}")
        return
    if dataset.suffix:
        raise BadInput(f"cannot write '{dataset}': {len(robots)} maps need a folder, without a suffix")
    if f".{suffix}" not in (*PICTURES, ".npz"):
        raise BadInput(f"--format is '{suffix}', must be png, svg, pdf or npz")
    draw_many(robots, wanted, f".{suffix}", dataset, cluster, as_json)
