"""Rows whose nodes are separate processes, or whose files are damaged: the end of the campaign's table."""

from __future__ import annotations

from irsbot_supervisor.validation.harness.rows import Entry
from irsbot_supervisor.validation.with_nodes import floods, operators, outages, recorder, recorder_death, silence, soak

ENTRIES: tuple[Entry, ...] = (
    Entry(recorder.CUT, recorder.CUT_MUST, 200, 20, recorder.run_cut),
    Entry(recorder.FLIP, recorder.FLIP_MUST, 500, 20, recorder.run_flip),
    Entry(recorder_death.KILL, recorder_death.KILL_MUST, 50, 2, recorder_death.run_kill, needs_ros=True),
    Entry(recorder_death.LACK, recorder_death.LACK_MUST, 20, 2, recorder_death.run_lack, needs_ros=True),
    Entry(operators.LIFECYCLE, operators.LIFECYCLE_MUST, 1000, 40, operators.run_lifecycle, needs_ros=True),
    Entry(operators.PARAMETERS, operators.PARAMETERS_MUST, 2000, 60, operators.run_parameters, needs_ros=True),
    Entry(operators.RESETS, operators.RESETS_MUST, 4000, 200, operators.run_resets, needs_ros=True),
    Entry(floods.NAME, floods.MUST, 60, 6, floods.run, needs_ros=True),
    Entry(outages.NAME, outages.MUST, 64, 4, outages.run, needs_ros=True),
    Entry(silence.NAME, silence.MUST, 6400, 16, silence.run, needs_ros=True),
    Entry(soak.NAME, soak.MUST, 1800, 20, soak.run, needs_ros=True),
)
