"""No error of a callback is lost, and none ends the node: it becomes a verdict UNKNOWN."""

from __future__ import annotations

from collections.abc import Callable

Fail = Callable[[Exception], None]
"""Told of an error in a callback."""


def guarded(callback: Callable[[], None], fail: Fail) -> Callable[[], None]:
    """A timer's callback whose errors are told."""

    def call() -> None:
        try:
            callback()
        except Exception as error:
            fail(error)

    return call
