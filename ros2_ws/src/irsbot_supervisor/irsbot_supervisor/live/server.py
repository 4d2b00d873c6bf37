"""Serves the live page and feeds it.

A page requests a few frames at a time. Each frame has the newest state, so a slow page skips frames and never shows one
that is older than its request. What a page says is never read.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import ipaddress
import os
import socket
from collections.abc import Callable
from functools import partial
from http import HTTPStatus
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

import jinja2
from websockets.asyncio.server import Server, ServerConnection, broadcast, serve
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

FRAMES = 6
"""Frames for which a page asks at once: a fifth of a second. To hear a question costs as much as to tell a frame."""

SCRIPTS = ("plots.js", "mechanism.js", "live_plots.js", "live_view.js", "live.js")
LARGEST_QUESTION = 16
"""Bytes of what a page may say."""


class Visitor:
    """An open page."""

    def __init__(self) -> None:
        self.known = Known()
        self.left = 0  # frames that it has asked for and was not told yet


class LivePage:
    """The page of one listener."""

    def __init__(self, listener: Monitor) -> None:
        self._listener, self._worker = listener, Worker()
        self._feed = Feed(self._draw)
        self._visitors: dict[ServerConnection, Visitor] = {}
        self._timer: asyncio.TimerHandle | None = None  # of the next look
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
                await self._looks()
        finally:
            self._worker.close()

    async def _looks(self) -> None:
        """Hear and tell for ever, by a timer: a task that sleeps would wake the loop twice for each look."""
        loop = asyncio.get_running_loop()
        failed: asyncio.Future[None] = loop.create_future()

        def look(due_s: float) -> None:
            try:
                self._feed.hear(self._listener.take(), loop.time())
                self._tell()
            except Exception as error:
                failed.set_exception(error)
                return
            due_s = max(due_s + FRAME_S, loop.time() - FRAME_S)  # the looks take time of their own
            self._timer = loop.call_at(due_s, look, due_s)

        look(loop.time())
        try:
            await failed
        finally:
            if self._timer is not None:
                self._timer.cancel()

    async def _talk(self, connection: ServerConnection) -> None:
        visitor = self._visitors[connection] = Visitor()
        try:
            with contextlib.suppress(ConnectionClosed):
                async for _asked in connection:
                    visitor.left = FRAMES
        finally:
            del self._visitors[connection]

    def _tell(self) -> None:
        """Tell every page that has asked, unless it has not taken the frame before: a later one will be newer."""
        for connection, visitor in self._visitors.items():
            if visitor.left and not connection.transport.get_write_buffer_size():
                visitor.left -= 1
                broadcast([connection], self._feed.answer(visitor.known, visitor.left))

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


def stand_back() -> None:
    """Messages that wake this process from now on do not interrupt another one. Threads inherit it: call this before
    the middleware is started."""
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def run(listener: Monitor, host: str, port: int, told: Callable[[str], None]) -> None:
    """Serve until Ctrl-C. Raises OSError for a port that is taken."""
    gc.freeze()  # what is loaded now stays
    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(LivePage(listener).run(host, port, told))


def main() -> None:
    """The page as a node of a suite. Parameters: `host` and `port`."""
    from irsbot_supervisor.live.serving import serve_node  # needs ROS, and so does the next
    from irsbot_supervisor.processes.monitoring import Monitor

    stand_back()
    with Monitor(int(os.environ.get("ROS_DOMAIN_ID", "0")), name="live_page") as listener:
        serve_node(listener.node, partial(run, listener), "no page")


if __name__ == "__main__":
    main()
