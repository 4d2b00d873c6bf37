"""The server of the live page: only who asks is told, who is told knows the newest, and strangers are refused."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

pytest.importorskip("websockets.asyncio.client", reason="needs websockets")

from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus

from irsbot_msgs_py.records import Cause, Level, Verdict
from irsbot_supervisor.live import server
from irsbot_supervisor.live.server import FRAMES, LivePage, names_us, page
from irsbot_supervisor.processes.observed import Observed, Seen

PATIENCE_S = 60.0
LONG = 300_000
VERDICT = Verdict(0, Level.OK, Cause.NONE, False, 0, (), "", 0, "", 0, 1.0, ())


class Listener:
    """Counts its looks, and tells of as many verdicts per second."""

    def __init__(self) -> None:
        self.looks = 0

    def take(self) -> Seen:
        self.looks += 1
        return Observed().look(0.0)._replace(verdict_hz=float(self.looks))


def served(visit: Callable[[int, Listener], Awaitable[None]]) -> None:
    """Visit a server on a free port."""

    async def both() -> None:
        told: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        listener: Any = Listener()
        serving = asyncio.create_task(LivePage(listener).run("127.0.0.1", 0, told.set_result))
        try:
            port = int((await told).rpartition(":")[2])
            await asyncio.wait_for(visit(port, listener), PATIENCE_S)
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)

    asyncio.run(both())


def test_each_question_is_answered_with_a_look_that_came_after_it() -> None:
    async def visit(port: int, listener: Listener) -> None:
        async with connect(f"ws://127.0.0.1:{port}/live") as socket:
            while listener.looks < 5:
                await asyncio.sleep(0)
            for _ in range(3):
                before = listener.looks
                await socket.send("")
                for left in reversed(range(FRAMES)):
                    told = json.loads(await socket.recv())
                    assert told["now"]["verdict_hz"] > before
                    assert told["left"] == left
                    before = told["now"]["verdict_hz"]

    served(visit)


def test_who_asks_once_is_told_a_few_frames_and_no_more() -> None:
    async def visit(port: int, listener: Listener) -> None:
        async with connect(f"ws://127.0.0.1:{port}/live") as socket:
            await socket.send("")
            for _ in range(FRAMES):
                await socket.recv()
            more, begin = asyncio.create_task(socket.recv()), listener.looks
            while listener.looks < begin + 3:
                await asyncio.sleep(0)
            assert not more.done()
            more.cancel()

    served(visit)


def test_who_does_not_ask_is_told_nothing() -> None:
    async def visit(port: int, listener: Listener) -> None:
        async with connect(f"ws://127.0.0.1:{port}/live") as silent:
            async with connect(f"ws://127.0.0.1:{port}/live") as asking:
                for _ in range(3):
                    await asking.send("")
                    await asking.recv()
            silent_hears = asyncio.create_task(silent.recv())
            begin = listener.looks
            while listener.looks < begin + 3:
                await asyncio.sleep(0)
            assert not silent_hears.done()
            silent_hears.cancel()

    served(visit)


class Wordy(Listener):
    """Each look tells of another long verdict."""

    def take(self) -> Seen:
        text = f"{self.looks} " + "x" * LONG
        return super().take()._replace(verdict=VERDICT._replace(text=text))


def test_frames_do_not_queue_for_a_page_that_asks_and_does_not_read(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "FRAME_S", 1e-3)

    async def both() -> None:
        told: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        listener: Any = Wordy()
        live = LivePage(listener)
        serving = asyncio.create_task(live.run("127.0.0.1", 0, told.set_result))
        port = int((await told).rpartition(":")[2])
        async with connect(f"ws://127.0.0.1:{port}/live", max_size=None, max_queue=1) as socket:
            begin = listener.looks
            while listener.looks < begin + 100:
                await socket.send("")
                await asyncio.sleep(0)
            (connection,) = live._visitors
            assert 0 < connection.transport.get_write_buffer_size() < 2 * LONG
            told_before = listener.looks
            while (json.loads(await socket.recv())["now"]["verdict_hz"]) <= told_before:  # it reads again
                await socket.send("")
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)

    asyncio.run(asyncio.wait_for(both(), PATIENCE_S))


def test_long_words_of_a_page_end_its_connection() -> None:
    async def visit(port: int, _listener: Listener) -> None:
        async with connect(f"ws://127.0.0.1:{port}/live") as socket:
            await socket.send("x" * 1000)
            with pytest.raises(ConnectionClosed):
                await socket.recv()

    served(visit)


def test_a_page_of_somebody_else_is_refused() -> None:
    async def visit(port: int, _listener: Listener) -> None:
        with pytest.raises(InvalidStatus) as refused:
            await connect(f"ws://127.0.0.1:{port}/live", origin="http://elsewhere.example")
        assert refused.value.response.status_code == 403
        async with connect(f"ws://127.0.0.1:{port}/live", origin=f"http://127.0.0.1:{port}") as own:
            await own.send("")
            assert json.loads(await own.recv())["now"]

    served(visit)


@pytest.mark.parametrize(
    ("named", "ours"),
    [
        ("localhost:8765", True),
        ("127.0.0.1:8765", True),
        ("[::1]:8765", True),
        ("192.168.3.4", True),
        ("robot.lab:80", True),
        ("elsewhere.example:8765", False),
        ("", False),
    ],
)
def test_names_of_others_that_point_here_are_not_ours(named: str, ours: bool) -> None:
    assert names_us(named, "Robot.lab") == ours


def test_the_page_is_at_the_root_and_nothing_else_is_there() -> None:
    async def visit(port: int, _listener: Listener) -> None:
        for path, status in (("/", b"200 OK"), ("/other", b"404 Not Found")):
            reader, writer = await asyncio.open_connection("127.0.0.1", port)
            writer.write(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
            answer = await reader.read()
            assert status in answer.splitlines()[0]
            assert (page().encode() in answer) == (path == "/")
            writer.close()

    served(visit)


def test_a_page_that_waits_for_a_look_does_not_hold_up_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server, "FRAME_S", 3600.0)

    async def both() -> None:
        told: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        listener: Any = Listener()
        live = LivePage(listener)
        serving = asyncio.create_task(live.run("127.0.0.1", 0, told.set_result))
        port = int((await told).rpartition(":")[2])
        async with connect(f"ws://127.0.0.1:{port}/live") as socket:
            await socket.send("")
            while not any(visitor.left for visitor in live._visitors.values()):
                await asyncio.sleep(0)
            serving.cancel()
            _done, pending = await asyncio.wait([serving], timeout=PATIENCE_S)
            assert not pending

    asyncio.run(both())
