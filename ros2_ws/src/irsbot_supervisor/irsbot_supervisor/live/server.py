"""Serves the live page and feeds it.

A page asks for the next few frames and each tells the newest, so that a slow one falls behind in no queue: what it
shows was true after it had asked. What a page says is never read.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import ipaddress
import os
import socket
import time
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import jinja2
from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from irsbot_msgs_py.records import SingularityState
from irsbot_supervisor.live.feed import Feed, Known
from irsbot_supervisor.live.scene import Scene, drawn
from irsbot_supervisor.processes.worker import Task, Worker
from irsbot_supervisor.report.page import page_text

if TYPE_CHECKING:
    from irsbot_supervisor.processes.monitoring import Monitor

FRAME_S = 1.0 / 31.0
"""s between two looks, and between two frames of a page: a little less than at 30 Hz, so that 30 arrive."""

FRAMES = 3
"""Frames for which a page asks at once: a tenth of a second. To hear a question costs as much as to tell a frame."""

SCRIPTS = ("plots.js", "mechanism.js", "live_plots.js", "live_view.js", "live.js")
LARGEST_QUESTION = 16
"""Bytes of what a page may say."""


class LivePage:
    """The page of one listener."""

    def __init__(self, listener: Monitor) -> None:
        self._listener, self._worker = listener, Worker()
        self._feed = Feed(self._draw)
        self._looked = asyncio.Event()
        self._ended = False
        self._page = page()
        self._host = ""

    async def run(self, host: str, port: int, told: Callable[[str], None]) -> None:
        """Serve for ever. told: called with the address once it answers. Raises OSError for a port that is taken."""
        self._host = host
        server: Server
        try:
            async with serve(
                self._talk, host, port, process_request=self._respond, max_size=LARGEST_QUESTION, compression=None
            ) as server:
                told(f"http://{host}:{next(iter(server.sockets)).getsockname()[1]}")
                try:
                    begin = time.monotonic()
                    while True:
                        self._feed.hear(self._listener.take(), time.monotonic())
                        self._wake()
                        begin = max(begin + FRAME_S, time.monotonic() - FRAME_S)  # the looks take time of their own
                        await asyncio.sleep(begin - time.monotonic())
                finally:  # the server waits for its connections, and they wait for a look
                    self._ended = True
                    self._wake()
        finally:
            self._worker.close()

    async def _talk(self, connection: ServerConnection) -> None:
        known = Known()
        with contextlib.suppress(ConnectionClosed):
            async for _asked in connection:
                for left in reversed(range(FRAMES)):
                    if not self._ended:
                        await self._looked.wait()
                    if self._ended:
                        return
                    await connection.send(self._feed.answer(known, left))

    def _wake(self) -> None:
        """Go on with every page that waits for a look."""
        self._looked.set()
        self._looked.clear()

    def _respond(self, connection: ServerConnection, request: Request) -> Response | None:
        """The page at /, the socket at /live; nothing for pages of others, which a browser would let talk to us."""
        at = request.headers.get("Host", "")
        origin = request.headers.get("Origin")
        if not names_us(at, self._host) or (origin is not None and urlsplit(origin).netloc != at):
            return connection.respond(HTTPStatus.FORBIDDEN, "this page is for browsers that call it by its own name\n")
        if request.path == "/live":
            return None
        if request.path != "/":
            return connection.respond(HTTPStatus.NOT_FOUND, "the page is /\n")
        response = connection.respond(HTTPStatus.OK, self._page)
        del response.headers["Content-Type"]
        response.headers["Content-Type"] = "text/html; charset=utf-8"
        response.headers["Cache-Control"] = "no-store"
        return response

    def _draw(self, scene: Scene, state: SingularityState) -> None:
        loop = asyncio.get_running_loop()
        task = Task(drawn, (scene.record, scene.settings.working_mode, state.pose))

        def done(view: Any, error: Exception | None) -> None:
            shown = {"note": f"No drawing: {error}."} if error else view
            loop.call_soon_threadsafe(partial(self._feed.show, scene, shown))

        self._worker.submit(task, done)


def names_us(at: str, host: str) -> bool:
    """Whether a Host header names this machine as it can be trusted: by an address, or by a name that is ours. A name
    of somebody else's may point to us, and then a page of theirs would be taken for ours."""
    name = urlsplit(f"//{at}").hostname or ""
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return name in ("localhost", host.lower(), socket.gethostname().lower())
    return True


def page() -> str:
    """The page as HTML text; it asks for nothing but its own socket."""
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined)
    return environment.from_string(page_text("live.html.j2")).render(
        style=page_text("page.css") + page_text("live.css"), scripts=[page_text(name) for name in SCRIPTS]
    )


def run(listener: Monitor, host: str, port: int, told: Callable[[str], None]) -> None:
    """Serve until Ctrl-C. Raises OSError for a port that is taken."""
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(LivePage(listener).run(host, port, told))


def main() -> None:
    """The page as a node of a suite. Parameters: `host` and `port`."""
    from irsbot_supervisor.live.serving import serve_node  # needs ROS, and so does the next
    from irsbot_supervisor.processes.monitoring import Monitor

    with contextlib.suppress(
        OSError
    ):  # messages that come meanwhile do not interrupt another process; threads inherit it
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))
    with Monitor(int(os.environ.get("ROS_DOMAIN_ID", "0")), name="live_page") as listener:
        gc.freeze()  # what is loaded now stays
        serve_node(listener.node, partial(run, listener), "no page")


if __name__ == "__main__":
    main()
