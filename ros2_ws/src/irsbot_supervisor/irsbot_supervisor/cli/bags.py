"""`info` and `salvage`: the content of a bag, and the intact part of a damaged one."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from irsbot_msgs_py.cdr import decode_state, decode_verdict
from irsbot_msgs_py.errors import CdrError
from irsbot_supervisor.bag.bag import Bag
from irsbot_supervisor.bag.loss import Loss
from irsbot_supervisor.bag.message import Message
from irsbot_supervisor.bag.salvage import salvage as salvage_bag
from irsbot_supervisor.bag.topics import STATE, VERDICT
from irsbot_supervisor.cli.common import Failed, existing, out, print_json
from irsbot_supervisor.replay.robots_in_bag import Sources, namespace_of, robots_in

BagPath = Annotated[Path, typer.Argument(help="bag folder or file; MCAP files may be damaged")]
AsJson = Annotated[bool, typer.Option("--json", help="print JSON")]


def info(bag: BagPath, as_json: AsJson = False) -> None:
    """Topics, messages, time span, configuration and damage of a bag.

    Example: irsbot info runs/demo/bag
    """
    facts = _facts(existing(bag, "the bag"))
    if as_json:
        print_json(facts)
        return
    table = Table("topic", "type", "messages")
    for topic in facts["topics"]:
        table.add_row(topic["name"], topic["type"], str(topic["messages"]))
    out.print(table)
    out.print(f"{facts['messages']} messages in {facts['duration_s']:.3f} s, {facts['bytes']} bytes")
    for robot in facts["robots"]:
        known = f", configuration {robot['config_hash']}" if robot["config_hash"] and len(facts["robots"]) > 1 else ""
        out.print(f"namespace {robot['namespace']}: robot {robot['robot'] or 'not recorded'}{known}")
    if len(facts["robots"]) <= 1:
        out.print(f"configuration {facts['config_hash'] or 'not recorded'}")
    out.print(f"damage: {facts['loss']['text']}", markup=False)


def salvage(
    bag: BagPath,
    output: Annotated[Path, typer.Option("--output", "-o", help="new bag folder, or new file ending in .mcap")],
    as_json: AsJson = False,
) -> None:
    """Copy the intact part of a damaged bag to a new bag. Exit code 1 if something was lost.

    Example: irsbot salvage runs/killed/bag -o runs/saved.
    """
    saved = salvage_bag(existing(bag, "the bag"), output)
    if as_json:
        print_json({"output": output, "messages": saved.messages, "loss": _loss(saved.loss)})
    else:
        out.print(f"{saved.messages} messages written to {output}", markup=False)
    if saved.loss:
        raise Failed(f"'{bag}': {saved.loss}")


def _facts(bag: Path) -> dict[str, Any]:
    with Bag(bag) as opened:
        counts: Counter[str] = Counter()
        first_ns = last_ns = None
        newest: dict[str, Message] = {}
        for message in opened.messages():
            newest[message.topic] = message
            counts[message.topic] += 1
            first_ns = message.log_ns if first_ns is None else min(first_ns, message.log_ns)
            last_ns = message.log_ns if last_ns is None else max(last_ns, message.log_ns)
        topics = [topic for topic in opened.topics() if counts[topic.name]]
        robots = [_robot(namespace, found, newest) for namespace, found in robots_in(topics).items()]
        attached = [record.metadata.get("config_hash") for reader in opened.readers for record in reader.metadata]
        heard = [robot["config_hash"] for robot in robots] if len(robots) == 1 else []
        return {
            "bag": bag,
            "files": [reader.path for reader in opened.readers],
            "bytes": sum(file.stat().st_size for reader in opened.readers for file in _files(reader.path)),
            "messages": counts.total(),
            "start_ns": first_ns,
            "duration_s": (last_ns - first_ns) / 1e9 if first_ns is not None and last_ns is not None else 0.0,
            "topics": [{"name": t.name, "type": t.type, "messages": counts[t.name]} for t in opened.topics()],
            "robots": robots,
            "config_hash": next((known for known in (*reversed(attached), *heard) if known), None),
            "loss": _loss(opened.loss),
        }


def _robot(namespace: str, found: Sources, newest: Mapping[str, Message]) -> dict[str, Any]:
    """One robot of a bag, from the newest messages of its supervisor."""
    stated: dict[str, Any] = {"namespace": namespace, "joint_states": found.joints, "supervisors": found.supervisors}
    stated |= {"robot": None, "config_hash": None}
    for message in newest.values():
        if namespace_of(message.topic) in found.supervisors:
            with contextlib.suppress(CdrError):
                if message.type == STATE:
                    stated["robot"] = decode_state(message.data).robot
                elif message.type == VERDICT:
                    stated["config_hash"] = decode_verdict(message.data).config_hash
    return stated


def _files(path: Path) -> list[Path]:
    return sorted(path.iterdir()) if path.is_dir() else [path]


def _loss(loss: Loss) -> dict[str, Any]:
    return {**asdict(loss), "text": str(loss)}
