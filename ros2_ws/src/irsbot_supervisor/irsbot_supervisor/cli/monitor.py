"""`monitor`: a running suite in a terminal, live."""

from __future__ import annotations

import time
from typing import Annotated, Any

import typer
from rich.live import Live

from irsbot_msgs_py.records import cause_names
from irsbot_supervisor.cli.common import Failed, namespace_from, out, print_json, refuse
from irsbot_supervisor.cli.operate import AsJson, Domain, Namespace, Patience
from irsbot_supervisor.cli.tables.monitor import screen
from irsbot_supervisor.cli.web import (
    FOXGLOVE_PORT,
    WEB_HOST,
    WEB_PORT,
    FoxgloveHost,
    FoxglovePort,
    WebHost,
    WebPort,
    check_foxglove,
    check_page,
)
from irsbot_supervisor.processes.observed import Seen

FRAME_S = 0.1
"""s between two pictures: fast enough for an eye, slow enough for SSH."""


COUNTED_S = 1.2
"""s until rates are known: the second over which they are counted, and the time until the first state comes."""


def monitor(
    once: Annotated[bool, typer.Option("--once", help="one look, then end")] = False,
    domain: Domain = 0,
    namespace: Namespace = "",
    wait: Patience = 5.0,
    as_json: AsJson = False,
    web: Annotated[bool, typer.Option("--web", help="serve a page for browsers in place of the terminal")] = False,
    web_host: WebHost = WEB_HOST,
    web_port: WebPort = WEB_PORT,
    foxglove: Annotated[bool, typer.Option("--foxglove", help="serve Foxglove in place of the terminal")] = False,
    foxglove_host: FoxgloveHost = WEB_HOST,
    foxglove_port: FoxglovePort = FOXGLOVE_PORT,
) -> None:
    """Watch a running suite: level, margins against their limits, rates, ages, changes. Ctrl-C ends it.

    With --once or --json the command prints one picture; exit code 1 if it receives no verdict.

    With --web a browser shows the same and the mechanism in its workspace, live. With --foxglove the Foxglove app
    connects and shows the topics. Neither can change anything.

    Example: irsbot monitor --namespace left.
    """
    place = namespace_from(namespace)
    served = "--web" if web else "--foxglove"
    if (web or foxglove) and (once or as_json):
        refuse(f"{served} goes on until Ctrl-C: leave out --once and --json")
    if web and foxglove:
        refuse("--web and --foxglove are two commands here; `irsbot up` takes both")
    if web:
        check_page(web_host, web_port)
    if foxglove:
        check_foxglove(foxglove_host, foxglove_port)
        from irsbot_supervisor.live import foxglove as relay
        from irsbot_supervisor.processes.polling import Polling

        with Polling(domain, place, "foxglove") as node:
            relay.run(
                node, foxglove_host, foxglove_port, lambda address: out.print(f"Foxglove: {address}   Ctrl-C ends it")
            )
        return
    from irsbot_supervisor.processes.monitoring import Monitor  # needs ROS, which the other commands do not

    if web:
        from irsbot_supervisor.live.server import run, stand_back

        stand_back()
    with Monitor(domain, place) as listener:
        if web:
            run(listener, web_host, web_port, lambda address: out.print(f"live page: {address}   Ctrl-C ends it"))
            return
        if once or as_json:
            _look_once(listener, wait, as_json)
            return
        try:
            with Live(
                screen(listener.look(0.0), time.monotonic()), console=out, screen=True, auto_refresh=False
            ) as live:
                while True:
                    seen = listener.look(FRAME_S)
                    live.update(screen(seen, time.monotonic()), refresh=True)
        except KeyboardInterrupt:
            pass


def _look_once(listener: Any, wait: float, as_json: bool) -> None:
    """Wait for a verdict, then for rates and limits."""
    deadline = time.monotonic() + wait
    seen: Seen = listener.look(FRAME_S)
    while (seen.verdict is None or not seen.limits) and time.monotonic() < deadline:
        seen = listener.look(FRAME_S)
    if seen.verdict is not None:
        seen = listener.look(COUNTED_S)
    if as_json:
        print_json(facts(seen))
    else:
        out.print(screen(seen, time.monotonic()))
    if seen.verdict is None:
        raise Failed(f"no verdict on supervisor/verdict in {wait:g} s")


def facts(seen: Seen) -> dict[str, Any]:
    """The picture as data."""
    return {
        "level": seen.level,
        "causes": cause_names(seen.verdict.causes) if seen.verdict else "",
        "verdict": seen.verdict._asdict() if seen.verdict else None,
        "state": seen.state._asdict() if seen.state else None,
        "limits": {name: value for name, value in seen.limits.items() if name.endswith(("_stop", "_warn"))},
        "verdict_age_s": seen.verdict_age_s,
        "state_age_s": seen.state_age_s,
        "verdict_hz": seen.verdict_hz,
        "state_hz": seen.state_hz,
        "changes": [change._asdict() for change in seen.changes],
    }
