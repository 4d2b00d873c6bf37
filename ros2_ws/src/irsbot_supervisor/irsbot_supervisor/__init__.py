"""Singularity supervision of parallel robots. What stands in `__all__` is stable, and needs no ROS.

from irsbot_supervisor import JointSample, Supervisor, certify, judge_bag, read_settings
settings, robot = read_settings("irsbot2", latency_s=0.004)     # shipped robot or YAML file; keywords override
step = Supervisor(settings, robot).step(JointSample(...))       # judge samples offline: step.verdict, step.state
certify(robot, settings, times_s, positions).safe               # does a planned motion keep every stop limit
judge_bag("bags/type2").events                                  # judge a recorded run again

Names are loaded when they are first asked for: the import itself costs no numpy, and nodes load what they need.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from irsbot_msgs_py.records import (
        Cause,
        JointSample,
        Level,
        Reset,
        SingularityState,
        Tick,
        Verdict,
    )
    from irsbot_supervisor.bag.bag import Bag
    from irsbot_supervisor.bag.errors import BagError
    from irsbot_supervisor.configuration.feasibility import settings_from
    from irsbot_supervisor.configuration.loading import read_settings, read_values
    from irsbot_supervisor.core.events import Configure, Step
    from irsbot_supervisor.core.settings import InvalidSettings, Settings
    from irsbot_supervisor.core.supervisor import Supervisor
    from irsbot_supervisor.replay.judgement import BagJudgement, LevelInterval, SmallestMargin, judge_bag
    from irsbot_supervisor.trajectory.certificate import Certificate, Violation
    from irsbot_supervisor.trajectory.joint_path import BadTrajectory
    from irsbot_supervisor.trajectory.survey import Run, Survey, survey
    from irsbot_supervisor.trajectory.task_space import certify_poses, survey_poses
    from irsbot_supervisor.trajectory.verification import certify

__version__ = "0.1.0"

__all__ = [
    "BadTrajectory",
    "Bag",
    "BagError",
    "BagJudgement",
    "Cause",
    "Certificate",
    "Configure",
    "InvalidSettings",
    "JointSample",
    "Level",
    "LevelInterval",
    "Reset",
    "Run",
    "Settings",
    "SingularityState",
    "SmallestMargin",
    "Step",
    "Supervisor",
    "Survey",
    "Tick",
    "Verdict",
    "Violation",
    "certify",
    "certify_poses",
    "judge_bag",
    "read_settings",
    "read_values",
    "settings_from",
    "survey",
    "survey_poses",
]

_MODULES = {
    "irsbot_msgs_py.records": ("Cause", "JointSample", "Level", "Reset", "SingularityState", "Tick", "Verdict"),
    "irsbot_supervisor.bag.bag": ("Bag",),
    "irsbot_supervisor.bag.errors": ("BagError",),
    "irsbot_supervisor.configuration.feasibility": ("settings_from",),
    "irsbot_supervisor.configuration.loading": ("read_settings", "read_values"),
    "irsbot_supervisor.core.settings": ("InvalidSettings", "Settings"),
    "irsbot_supervisor.core.events": ("Configure", "Step"),
    "irsbot_supervisor.core.supervisor": ("Supervisor",),
    "irsbot_supervisor.replay.judgement": ("BagJudgement", "LevelInterval", "SmallestMargin", "judge_bag"),
    "irsbot_supervisor.trajectory.certificate": ("Certificate", "Violation"),
    "irsbot_supervisor.trajectory.joint_path": ("BadTrajectory",),
    "irsbot_supervisor.trajectory.survey": ("Run", "Survey", "survey"),
    "irsbot_supervisor.trajectory.task_space": ("certify_poses", "survey_poses"),
    "irsbot_supervisor.trajectory.verification": ("certify",),
}
"""Module of each public name; the imports above, for the interpreter (PEP 562)."""


def __getattr__(name: str) -> Any:
    for module, names in _MODULES.items():
        if name in names:
            value = getattr(importlib.import_module(module), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'irsbot_supervisor' has no attribute '{name}'")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
