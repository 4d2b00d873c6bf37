"""Progress of long commands on stderr: bars on a terminal, a line now and then in a file."""

from __future__ import annotations

from time import monotonic
from typing import Any

from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
    TimeRemainingColumn,
)

from irsbot_supervisor.cli.common import err

REMIND_S = 30.0
"""s between two lines where there is no terminal."""


class Bars(Progress):
    """Bars that rich draws on a terminal. Elsewhere it draws none; then lines say how far a long work is."""

    def __init__(self, *columns: ProgressColumn, transient: bool = True) -> None:
        """transient: the bars disappear at the end."""
        hidden = transient and not err.is_terminal
        super().__init__(TextColumn("{task.description}"), *columns, console=err, transient=transient, disable=hidden)
        self._told_s = monotonic()

    def advance(self, task_id: TaskID, advance: float = 1) -> None:
        super().advance(task_id, advance)
        self._tell(task_id)

    def update(self, task_id: TaskID, **changes: Any) -> None:
        super().update(task_id, **changes)
        self._tell(task_id)

    def _tell(self, task_id: TaskID) -> None:
        now_s = monotonic()
        if err.is_terminal or now_s - self._told_s < REMIND_S:
            return
        self._told_s, task = now_s, self._tasks[task_id]
        of = "" if task.total is None else f" of {task.total:g}"
        err.print(f"{task.description}  {task.completed:g}{of}  {task.elapsed or 0.0:.0f} s")


def progress_bar() -> Bars:
    """A bar that disappears at the end; its tasks need a total."""
    return Bars(BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
