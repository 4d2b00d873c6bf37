"""One function over many jobs, on processes of this machine or on a Dask cluster. Results do not depend on which.

A job whose process ends is given to another one. Nothing here knows what a job is.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
import os
from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import Future
from contextlib import ExitStack, contextmanager, suppress
from itertools import chain, islice
from threading import Thread
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar
from urllib.parse import urlsplit

from irsbot_kinematics import BadInput
from irsbot_supervisor.fleet.version import code_version

if TYPE_CHECKING:
    from distributed import Client
    from tornado.ioloop import IOLoop

Job = TypeVar("Job")
Result = TypeVar("Result")

Map = Callable[[Callable[[Any], Any], Iterable[Any]], Iterable[Any]]
"""What `map` does with one function and one iterable."""

ANSWER_S = 10.0
"""s until a scheduler must have answered, and one worker must be there."""

LONELY = 3
"""Waits of ANSWER_S for a result, one after another and all without a worker, after which a run is given up."""

TIMEOUTS = (TimeoutError, asyncio.TimeoutError, concurrent.futures.TimeoutError)
"""Which are one from Python 3.11 on."""

START_S = 60.0
"""s until the processes of this machine must have started."""

CONNECT = "distributed.comm.timeouts.connect"
"""Dask's name of the time in which a process must be reached."""

AHEAD = 4
"""Jobs per worker that are submitted: enough that none waits for the next one."""

SHARES = 2
"""Parts per worker of short jobs: more even out their lengths, fewer travel faster."""


class Cluster(NamedTuple):
    """Where jobs are done. scheduler: address such as tcp://host:8786, None: processes of this machine. workers: how
    many of those, None: one per core."""

    scheduler: str | None = None
    workers: int | None = None

    @property
    def stated(self) -> bool:
        """True if somebody asked for it; else few jobs may as well be done without."""
        return self.scheduler is not None or self.workers is not None

    @property
    def processes(self) -> int:
        """How many processes of this machine are meant."""
        return self.workers or os.cpu_count() or 1

    def at_most(self, jobs: int) -> Cluster:
        """The same with no more processes of this machine than jobs."""
        if self.scheduler is not None:
            return self
        return self._replace(workers=min(self.processes, max(jobs, 1)))


HERE = Cluster()
"""All cores of this machine."""


def check_address(scheduler: str) -> None:
    """Raise BadInput where a scheduler cannot have this address. Whether one answers there is not asked."""
    place = urlsplit(scheduler if "://" in scheduler else f"tcp://{scheduler}")
    try:
        found = bool(place.hostname and place.port)
    except ValueError:  # the port is no number, or is too large
        found = False
    if not found:
        raise BadInput(f"no Dask scheduler can be at '{scheduler}'; must be like tcp://host:8786")


class JobFailed(NamedTuple):
    """In place of the result of a job. text: why there is none."""

    text: str


class Answer(NamedTuple, Generic[Result]):
    """What became of a job. place: its number among the jobs."""

    place: int
    result: Result | JobFailed


class Workers:
    """Processes that do jobs. At most AHEAD jobs for each of them are submitted and not yet answered to the caller, so
    memory is bounded whatever the number of jobs. A job that runs out of processes is answered by JobFailed.

    Functions must be of a module that the workers can import, too; jobs and results are pickled. Every method raises
    BadInput where the scheduler goes away and where a worker has another version of this code; what was answered before
    is complete.
    """

    def __init__(self, client: Client, address: str) -> None:
        self._client, self._address = client, address

    def answers(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Iterator[Answer[Result]]:
        """Call the function for every job; answers come in the order in which they are ready."""
        from distributed import as_completed

        left, places, ready = enumerate(jobs), dict[str, int](), as_completed(loop=self._client.loop)
        while True:
            with self._there():
                for place, job in islice(left, self._room(len(places))):
                    future = self._submit(function, job)
                    places[future.key] = place
                    ready.add(future)
                if not places:
                    return
                self._await_one(ready.futures)
                future = next(ready)
                result = _result(future)
            yield Answer(places.pop(future.key), result)

    def in_order(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> Iterator[Result | JobFailed]:
        """Call the function for every job; results come in the order of the jobs."""
        left, line = iter(jobs), deque[Any]()
        while True:
            with self._there():
                line.extend(self._submit(function, job) for job in islice(left, self._room(len(line))))
                if not line:
                    return
                self._await_one([line[0]])
                result = _result(line.popleft())
            yield result

    def spread(self, function: Callable[[Job], Result], jobs: Iterable[Job]) -> list[Result]:
        """`list(map(function, jobs))` of many short jobs: a few calls travel together.

        Raises BadInput if one of them fails.
        """
        if not (calls := list(jobs)):
            return []
        with self._there():
            length = -(-len(calls) // (SHARES * self._count()))
        shares = [(function, calls[first : first + length]) for first in range(0, len(calls), length)]
        return [result for share in whole(self.in_order(_each, shares)) for result in share]

    def _submit(self, function: Callable[[Any], Any], job: Any) -> Any:
        return self._client.submit(_called, (function, job, code_version()), pure=False)

    def _await_one(self, futures: Collection[Any]) -> None:
        """Wait until one is done. Raises BadInput if no worker is left to do it."""
        from distributed import wait

        lonely = 0
        while lonely < LONELY:
            try:
                with self._client.as_current():  # there may be others
                    wait(list(futures), timeout=ANSWER_S, return_when="FIRST_COMPLETED")  # raises CancelledError
                return
            except TIMEOUTS:
                lonely = 0 if self._threads() else lonely + 1
        raise BadInput(f"the scheduler {self._address} has no workers any more; start some, and run the command again")

    def _count(self) -> int:
        """Number of jobs that are done at the same time; workers come and go."""
        return max(self._threads(), 1)

    def _threads(self) -> int:
        """Number of threads of all workers."""
        from distributed.comm.core import CommClosedError

        if self._client.status != "running":
            raise CommClosedError
        try:
            threads: dict[str, int] = self._client.nthreads()
        except OSError:
            raise CommClosedError from None
        return sum(threads.values())

    def _room(self, submitted: int) -> int:
        """Number of jobs that may be submitted besides those that are."""
        return max(AHEAD * self._count() - submitted, 0)

    @contextmanager
    def _there(self) -> Iterator[None]:
        """Raises BadInput where the scheduler goes away."""
        from distributed import CancelledError
        from distributed.comm.core import CommClosedError

        try:
            yield
        except (CancelledError, CommClosedError):
            raise BadInput(f"the scheduler {self._address} went away; run the command again") from None


def run(function: Callable[[Job], Result], jobs: Iterable[Job], cluster: Cluster = HERE) -> Iterator[Answer[Result]]:
    """`Workers.answers` of a cluster that is used for this alone. Without a job, no cluster is asked.

    Raises BadInput, also where no scheduler or no worker answers.
    """
    left = iter(jobs)
    for first in islice(left, 1):
        with workers_of(cluster) as workers:
            yield from workers.answers(function, chain([first], left))


def whole(results: Iterable[Result | JobFailed]) -> Iterator[Result]:
    """The results, all of which are needed. Raises BadInput for a job that failed."""
    for result in results:
        if isinstance(result, JobFailed):
            raise BadInput(result.text)
        yield result


@contextmanager
def mapping(cluster: Cluster, few: bool) -> Iterator[Map]:
    """A `map` whose calls are done by a cluster: results in order, and all of them.

    few: so little work that it is done in this process unless the cluster was stated. The map raises BadInput for a
    call that fails and where the scheduler goes away.
    """
    if few and not cluster.stated:
        yield map
        return
    with workers_of(cluster) as workers:
        yield lambda function, jobs: whole(workers.in_order(function, jobs))


@contextmanager
def short_mapping(cluster: Cluster, few: bool) -> Iterator[Map]:
    """Likewise, for many calls of a few milliseconds each, again and again."""
    if few and not cluster.stated:
        yield map
        return
    with workers_of(cluster) as workers:
        yield workers.spread


@contextmanager
def workers_of(cluster: Cluster) -> Iterator[Workers]:
    """Workers; processes that were started for them end with them.

    Raises BadInput where no scheduler or no worker answers.
    """
    with _connected(cluster) as client:
        yield Workers(client, cluster.scheduler or "of this machine")


class _OtherVersion(Exception):
    """A worker has other code."""


def _called(stated: tuple[Callable[[Any], Any], Any, str]) -> Any:
    """One job, in a worker."""
    function, job, version = stated
    if code_version() != version:
        raise _OtherVersion(f"has irsbot {code_version()}, must have {version} as here")
    return function(job)


def _each(share: tuple[Callable[[Any], Any], list[Any]]) -> list[Any]:
    """Several calls, in a worker."""
    function, calls = share
    return [function(call) for call in calls]


def _result(future: Any) -> Any:
    """The result of a job that is done, or why there is none. Raises CancelledError."""
    from distributed import KilledWorker

    error = future.exception() if future.status == "error" else None
    if error is None:
        result = future.result()
        future.release()
        return result
    if isinstance(error, KilledWorker):
        return JobFailed("one worker process after another ended while it did this; is there enough memory?")
    if isinstance(error, _OtherVersion):
        raise BadInput(f"a worker {error}") from None
    return JobFailed(f"{type(error).__name__}: {error}")


@contextmanager
def _connected(cluster: Cluster) -> Iterator[Client]:
    """A client of the cluster; processes that were started for it end with it."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise BadInput(f"many jobs need {error.name}: 'pip install distributed'") from None
    for name in [name for name in logging.root.manager.loggerDict if name.partition(".")[0] == "distributed"]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # we say ourselves what matters
    with ExitStack() as started:
        patience_s = START_S if cluster.scheduler is None else ANSWER_S
        with dask.config.set({CONNECT: f"{patience_s}s"}):
            if cluster.scheduler is not None:
                client = started.enter_context(_client_of(cluster.scheduler))
            else:
                local = LocalCluster(
                    n_workers=cluster.processes,
                    threads_per_worker=1,
                    dashboard_address=None,
                    scheduler_kwargs={"dashboard_address": "127.0.0.1:0"},  # its server of figures finds a free port
                    silence_logs=logging.CRITICAL,
                    preload=["irsbot_supervisor.fleet.worker_process"],
                    loop=started.enter_context(_event_loop()),
                )
                client = started.enter_context(Client(started.enter_context(local), timeout=START_S))
        with dask.config.set({CONNECT: f"{ANSWER_S}s"}):
            yield client


@contextmanager
def _event_loop() -> Iterator[IOLoop]:
    """An event loop in a thread of its own. The one that distributed starts itself must run within 10 s, which it does
    not always do on a busy machine. Raises BadInput where it does not run within START_S either.
    """
    from tornado.ioloop import IOLoop

    running = Future[tuple[IOLoop, asyncio.Event]]()

    async def serve() -> None:
        end = asyncio.Event()
        running.set_result((IOLoop.current(), end))  # raises after START_S: the loop ends at once
        await end.wait()

    def run() -> None:
        try:
            asyncio.run(serve())
        except Exception as error:
            if not running.done():
                running.set_exception(error)

    thread = Thread(target=run, daemon=True, name="cluster")
    thread.start()
    try:
        loop, end = running.result(START_S)
    except TIMEOUTS:
        running.cancel()
        raise BadInput(f"this machine is too busy: a thread did not start within {START_S:g} s") from None
    try:
        yield loop
    finally:
        loop.add_callback(end.set)
        thread.join(START_S)


@contextmanager
def _client_of(address: str) -> Iterator[Client]:
    """A client of a scheduler that runs. Raises BadInput."""
    from distributed import Client

    check_address(address)
    try:
        client = Client(address, timeout=ANSWER_S)
    except AssertionError:
        raise BadInput("this machine is too busy: a thread of Dask did not start within 10 s") from None
    except (OSError, ValueError):  # a timeout is an OSError; a protocol that Dask does not know, a ValueError
        raise BadInput(f"no Dask scheduler answers at {address}; 'dask scheduler' starts one") from None
    try:
        with suppress(*TIMEOUTS):
            client.wait_for_workers(1, timeout=ANSWER_S)
        if not client.scheduler_info()["workers"]:
            raise BadInput(f"the scheduler {address} has no workers; 'dask worker {address}' starts one")
        yield client
    finally:
        client.close(timeout=1)
