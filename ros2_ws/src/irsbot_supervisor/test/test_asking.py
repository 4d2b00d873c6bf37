"""A request is made again where its answer is lost; the middleware loses one too rarely to wait for it here."""

from __future__ import annotations

import pytest

from irsbot_supervisor.processes import asking
from irsbot_supervisor.processes.asking import AGAIN_S, Asking


class FakeCall:
    def __init__(self, request: str, number: int) -> None:
        self.request, self.number, self.come = request, number, False

    def done(self) -> bool:
        return self.come

    def result(self) -> tuple[str, int]:
        return self.request, self.number


class FakeClient:
    """A client whose answers come when the test lets them."""

    def __init__(self) -> None:
        self.calls: list[FakeCall] = []

    def call_async(self, request: str) -> FakeCall:
        self.calls.append(FakeCall(request, len(self.calls)))
        return self.calls[-1]


def test_a_request_is_made_again_until_an_answer_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = 100.0
    monkeypatch.setattr(asking.time, "monotonic", lambda: now_s)
    client = FakeClient()
    one = Asking(client, "reset 3")
    assert not one.answered()
    now_s += 0.9 * AGAIN_S
    assert not one.answered()
    assert len(client.calls) == 1
    now_s += 0.2 * AGAIN_S
    assert not one.answered()
    assert [call.request for call in client.calls] == ["reset 3", "reset 3"]  # the first answer is lost
    client.calls[1].come = True
    now_s += 10.0 * AGAIN_S
    assert one.answered()
    assert one.answer == ("reset 3", 1)
    assert len(client.calls) == 2
