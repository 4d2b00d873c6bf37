"""Messages, services, and what every node publishes, hears, serves and calls."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

from reference.text import code, page, table

SRC = Path(__file__).parents[3] / "ros2_ws" / "src"
INTERFACES = SRC / "irsbot_msgs"
POLICIES = SRC / "irsbot_supervisor" / "policies"
EVERY_NODE = ("/rosout", "/clock", "/parameter_events")
"""Topics that every node of ROS has."""

ABSOLUTE = ("/diagnostics", "/tf")
"""Topics of ours that do not move with the namespace."""

ACTION = "/_action/"


def pages() -> dict[str, str]:
    """Pages of messages, of services, and of the interfaces of nodes."""
    return {
        "reference/messages.md": _definitions("Messages", "msg"),
        "reference/services.md": _definitions("Services", "srv"),
        "reference/interfaces.md": _nodes(),
    }


def _definitions(title: str, kind: str) -> str:
    parts = []
    for file in sorted((INTERFACES / kind).glob(f"*.{kind}")):
        parts += [f"## {file.stem}", f"`irsbot_msgs/{kind}/{file.stem}`", f"```text\n{file.read_text().strip()}\n```"]
    said = "Request above the line `---`, answer below. " if kind == "srv" else ""
    intro = f"{said}Definitions of the package `irsbot_msgs`, with the meaning and the unit of every field."
    return page(title, intro, *parts)


def _nodes() -> str:
    parts = []
    for file in sorted(POLICIES.glob("*.policy.xml")):
        for profile in ElementTree.parse(file).iter("profile"):
            parts += [f"## {profile.attrib['node']}", _node(profile)]
    return page(
        "Topics, services and actions",
        "What each node of the suite uses. The lists are those of the shipped SROS2 policies, which are tested against "
        "running nodes; what every ROS node has is left out. Names without a slash in front are relative: they move "
        "with the namespace. All can be remapped. Types and quality of service: "
        "[on a ROS 2 machine](../how_to/ros2_machine.md#topics). `supervisor/follow_joint_trajectory` is served where "
        "control_msgs is installed, `/tf` and `bond` are published where tf2_msgs and bond are.",
        *parts,
    )


def _node(profile: ElementTree.Element) -> str:
    found: dict[str, list[str]] = {}
    verbs = {"publish": "publishes", "subscribe": "hears", "reply": "serves", "request": "calls"}
    for group in profile:
        for verb, said in verbs.items():
            if verb in group.attrib:
                names = [(entry.text or "").strip() for entry in group]
                found[said] = [name for name in names if _ours(name)]
                found.setdefault("serves the action", []).extend(
                    name.split(ACTION)[0] for name in names if name.endswith(f"{ACTION}send_goal")
                )
    rows = [(said, ", ".join(map(_shown, names))) for said, names in found.items() if names]
    return table(("", "names"), rows)


def _shown(name: str) -> str:
    return code(name if name in ABSOLUTE else name.lstrip("/"))


def _ours(name: str) -> bool:
    last = name.rpartition("/")[2]
    of_parameters = "parameter" in last or last in ("get_type_description",)
    return name not in EVERY_NODE and ACTION not in name and not of_parameters
