"""A request to a service that is made again until an answer comes. No ROS of its own: it calls a client of rclpy."""

from __future__ import annotations

import time
from typing import Any

AGAIN_S = 1.0
"""s without an answer after which a request is made again: far longer than a node takes to answer one."""


class Asking:
    """One request. It must do no harm if it comes twice: a reset names its stop, settings are values.

    The middleware drops the answers to a client that the server has not discovered completely, and the client cannot
    see when it has.
    """

    def __init__(self, client: Any, request: Any) -> None:
        """client: of rclpy, whose service is there. The first call is made by `answered`."""
        self._client, self._request = client, request
        self._calls: list[Any] = []
        self._due_s = 0.0

    def answered(self) -> bool:
        """True once an answer has come; calls the service if it is time. Serve callbacks in between."""
        if any(call.done() for call in self._calls):
            return True
        if time.monotonic() >= self._due_s:
            self._calls.append(self._client.call_async(self._request))
            self._due_s = time.monotonic() + AGAIN_S
        return False

    @property
    def answer(self) -> Any:
        """The first answer. Only after `answered`."""
        return next(call.result() for call in self._calls if call.done())
