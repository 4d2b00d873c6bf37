"""No error in a callback is lost, and none ends the node: it becomes a verdict UNKNOWN."""

from __future__ import annotations

from collections.abc import Callable

Fail = Callable[[Exception], None]
"""Called with an error in a callback."""


def guarded(callback: Callable[[], None], fail: Fail) -> Callable[[], None]:
    """A timer callback whose errors are reported."""

    def call() -> None:
        try:
            callback()
        except Exception as error:
            fail(error)

    return call
