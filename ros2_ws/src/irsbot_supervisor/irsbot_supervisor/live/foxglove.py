"""Serves a running suite to Foxglove: its topics as they are, CDR with the definition of each message.

A topic is heard only while somebody looks at it, so that nothing is drawn or sent for nobody. Verdicts are always
heard: Foxglove keeps showing the last one, so it has to be told of a silence.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from functools import partial

import foxglove
from diagnostic_msgs.msg import DiagnosticArray
from irsbot_msgs.msg import SingularityState, Verdict
from rclpy.subscription import Subscription
from visualization_msgs.msg import MarkerArray

from irsbot_msgs_py.records import CONSUMER_TIMEOUT_S
from irsbot_msgs_py.stamps import NS_PER_S
from irsbot_supervisor.bag.message_definitions import definition
from irsbot_supervisor.live.serving import serve_node
from irsbot_supervisor.processes.polling import NEWEST, Polling, taken, waited_ns

LOOK_S = 1.0 / 30.0
"""s between two looks. Every message is passed on, none is left out."""

VERDICT = "supervisor/verdict"
SHOWN: dict[str, type] = {
    "supervisor/state": SingularityState,
    VERDICT: Verdict,
    "supervisor/markers": MarkerArray,
    "/diagnostics": DiagnosticArray,
}
"""Topics, relative to the namespace of the suite -> their messages."""

SILENCE, SILENCE_EVERY_S = "silence", 1.0
"""Identifier of the status of a silent supervisor, and s after which it is said again, for whoever comes later."""


class Relay:
    """One topic and its channel."""

    def __init__(self, listener: Polling, topic: str, context: foxglove.Context) -> None:
        """The name of the channel has no namespace, so that one layout fits every suite."""
        self._listener, self._topic = listener, topic
        kind = SHOWN[topic]
        name = f"{kind.__module__.partition('.')[0]}/msg/{kind.__name__}"
        schema = foxglove.Schema(name=name, encoding="ros2msg", data=definition(name).encode())
        self._channel = foxglove.Channel(
            f"/{topic.lstrip('/')}", message_encoding="cdr", schema=schema, context=context
        )
        self._subscription: Subscription | None = None

    def pass_on(self) -> int | None:
        """Pass on what has come; when the newest of it came, ns of the system clock."""
        looked_at, newest_ns = self._channel.has_sinks() or self._topic == VERDICT, None
        if looked_at and self._subscription is None:
            self._subscription = self._listener.listen(SHOWN[self._topic], self._topic, NEWEST)
        elif not looked_at and self._subscription is not None:
            self._listener.node.destroy_subscription(self._subscription)
            self._subscription = None
        if self._subscription is not None:
            for data, newest_ns in taken(self._subscription):
                self._channel.log(data, log_time=newest_ns)
        return newest_ns


class Silence:
    """Tells clients of a supervisor that says nothing."""

    def __init__(self, server: foxglove.WebSocketServer) -> None:
        self._server, self._heard_s, self._told_s = server, time.monotonic(), 0.0

    def hear(self, arrived_ns: int | None) -> None:
        """After every look. arrived_ns: of the newest verdict, None if there was none."""
        now_s = time.monotonic()
        if arrived_ns is not None:
            self._heard_s = now_s - waited_ns(arrived_ns) / NS_PER_S
        if now_s - self._heard_s <= CONSUMER_TIMEOUT_S:
            if self._told_s:
                self._server.remove_status([SILENCE])
                self._told_s = 0.0
        elif now_s - self._told_s > SILENCE_EVERY_S:
            self._told_s = now_s
            text = f"no verdict for {now_s - self._heard_s:.1f} s: what is shown is past, a consumer brakes"
            self._server.publish_status(text, foxglove.StatusLevel.Error, SILENCE)


def run(listener: Polling, host: str, port: int, told: Callable[[str], None]) -> None:
    """Serve until Ctrl-C. told: called with the address once it answers. Raises OSError for a port that is taken."""
    context = foxglove.Context()
    relays = {topic: Relay(listener, topic, context) for topic in SHOWN}
    try:
        server = foxglove.start_server(name="irsbot", host=host, port=port, capabilities=[], context=context)
    except RuntimeError as error:
        raise OSError(str(error)) from None
    try:
        told(f"ws://{host}:{server.port}")
        silence = Silence(server)
        while True:
            arrived = {topic: relay.pass_on() for topic, relay in relays.items()}
            silence.hear(arrived[VERDICT])
            time.sleep(LOOK_S)
    except KeyboardInterrupt:
        pass
    finally:
        with suppress(KeyboardInterrupt):
            server.stop()


def main() -> None:
    """The server as a node of a suite. Parameters: `host` and `port`."""
    with Polling(int(os.environ.get("ROS_DOMAIN_ID", "0")), "", "foxglove") as listener:
        serve_node(listener.node, partial(run, listener), "nothing served")


if __name__ == "__main__":
    main()
