"""`report`: a recorded run as one self-contained page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from irsbot_kinematics import BadInput
from irsbot_supervisor.bag.whole_file import write_whole
from irsbot_supervisor.cli import fleet
from irsbot_supervisor.cli.cluster import SchedulerOption, WorkersOption, cluster_of
from irsbot_supervisor.cli.common import out, print_json
from irsbot_supervisor.cli.replay import (
    BagsArgument,
    MechanismOption,
    NamespaceOption,
    RobotOption,
    SettingsOption,
    TopicOption,
    judged_with_progress,
)
from irsbot_supervisor.fleet.search import bags_in


def report(
    bags: BagsArgument,
    pages: Annotated[
        Path, typer.Option("-o", "--output", help="page to write, .html; without a suffix the folder of several pages")
    ],
    robot: RobotOption = None,
    settings: SettingsOption = None,
    namespace: NamespaceOption = None,
    topic: TopicOption = None,
    mechanism: MechanismOption = None,
    scheduler: SchedulerOption = None,
    workers: WorkersOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="print JSON")] = False,
) -> None:
    """Write one self-contained page about a run: verdicts, margins, motion and the mechanism over time.

    Example: irsbot report runs/demo/bag -o run.html

    A folder gets a page for each bag and one of all: irsbot report bags -o runs/fleet
    """
    found = bags_in(bags)
    if pages.suffix and len(found) > 1:
        raise BadInput(f"cannot write '{pages}': {len(found)} bags need a folder, without a suffix")
    if pages.suffix not in ("", ".html"):
        raise BadInput(f"cannot write '{pages}': the suffix must be .html")
    if pages.suffix and scheduler is not None:
        raise BadInput("--scheduler is for a folder of pages; one page is made here")
    try:
        from irsbot_supervisor.report.page import page, page_data  # nothing else needs a template
    except ImportError as error:
        raise BadInput(f"a page needs {error.name}: 'pip install jinja2'") from None
    if pages.suffix:
        alone = judged_with_progress(found[0], robot, settings, None, namespace, topic, mechanism)
        write_whole(pages, page(page_data(alone)).encode())
        if as_json:
            print_json({"bag": found[0], "robot": alone.robot, "file": pages, "summary": alone.summary})
        else:
            out.print(f"written to {pages}")
        return
    options = fleet.options_of(robot, settings, namespace, topic, mechanism)
    rows = fleet.judged(found, options, cluster_of(scheduler, workers), pages, page=True)
    fleet.show(rows, pages, as_json)
    fleet.raise_if_not_judged(rows)
