"""Settings of the supervisor, and the ROS parameters of every node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from irsbot_kinematics import robots
from irsbot_msgs_py.process.priority import LIMITS, MEANING, PARAMETER, PRIORITY
from irsbot_supervisor.configuration.loading import read_settings
from irsbot_supervisor.core.settings import Settings
from irsbot_supervisor.nodes import recorder, supervisor
from irsbot_supervisor.sim.simulation import Simulation
from reference.text import code, page, table, value

SHOWN = "irsbot2"
"""The robot whose shipped values are shown."""


def pages() -> dict[str, str]:
    """reference/settings.md and reference/parameters.md."""
    return {"reference/settings.md": _settings(), "reference/parameters.md": _parameters()}


def _settings() -> str:
    shipped, _robot = read_settings(SHOWN)
    rows = [
        (code(entry.name), value(getattr(shipped, entry.name)), _unit(entry.metadata), _range(entry.metadata),
         entry.metadata["text"], "no" if entry.metadata.get("read_only") else "yes")
        for entry in fields(Settings)
    ]  # fmt: skip
    return page(
        "Settings",
        f"Limits and timing of the supervision. The values are those that are shipped for `{SHOWN}`; "
        f"`./irsbot settings ROBOT` prints those of another robot ({', '.join(robots())}), or of a robot file. "
        "Every setting is a parameter of the supervisor node. One value of a setting per joint counts for all joints. "
        "[How to choose limits](../how_to/limits.md).",
        table(("setting", "value", "unit", "range", "meaning", "may change while running"), rows),
    )


def _parameters() -> str:
    simulated = [
        (code(entry.name), value(entry.default), _unit(entry.metadata), _ends(entry.metadata["limits"]),
         entry.metadata["text"], "no")
        for entry in fields(Simulation)
    ]  # fmt: skip
    simulated.append((code("fault"), "the scenario's", "", "", "what goes wrong on the way to the consumer", "yes"))
    simulated.append((code(PARAMETER), value(PRIORITY), "", _ends(LIMITS), MEANING, "no"))
    recorded = [
        (code(name), value(default), _ends(limits), text)
        for name, (default, text, limits) in recorder.PARAMETERS.items()
    ]
    others = [
        (code(name), value(default), _ends(limits), text)
        for name, (default, text, limits) in supervisor.PARAMETERS.items()
    ]
    head = ("parameter", "default", "range", "meaning")
    return page(
        "ROS parameters",
        "## supervisor",
        "Every [setting](settings.md) is a parameter of the supervisor. These, read at the start alone, are besides:",
        table(head, others),
        "## recorder",
        "All are read at the start alone. [How to record](../how_to/recorder.md).",
        table(head, recorded),
        "## simulated_joints",
        "Limits default to those that are shipped for the robot. [How to simulate](../how_to/simulation.md).",
        table(("parameter", "default", "unit", "range", "meaning", "may change while running"), simulated),
        "## kinematics",
        table(head, [(code("robot"), "irsbot2", "", "preset name or YAML file of the robot")]),
        "## Every node",
        "`use_sim_time`, and `qos_overrides` as [bring-up](../how_to/bringup.md#quality-of-service) says.",
    )


def _ends(limits: tuple[float, float] | None) -> str:
    return f"{limits[0]:g}..{limits[1]:g}" if limits else ""


def _unit(metadata: Mapping[str, Any]) -> str:
    return "" if metadata["unit"] == "1" else str(metadata["unit"])


def _range(metadata: Mapping[str, Any]) -> str:
    if words := metadata.get("words"):
        return ", ".join(words)
    return f"{metadata['low']:g}..{metadata['high']:g}" if "low" in metadata else ""
