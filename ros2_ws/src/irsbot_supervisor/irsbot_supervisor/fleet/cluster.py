"""One function over many jobs, on processes of this machine or on a Dask cluster. Results do not depend on which.

A job whose process ends is given to another one. Nothing here knows what a job is.
"""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Any, Generic, NamedTuple, TypeVar

from irsbot_kinematics import BadInput
from irsbot_supervisor.fleet.version import code_version

if TYPE_CHECKING:
    from distributed import Client

Job = TypeVar("Job")
Result = TypeVar("Result")

ANSWER_S = 10.0
"""s until a scheduler must have answered, and one worker must be there."""

START_S = 60.0
"""s until the processes of this machine must have started."""


class Cluster(NamedTuple):
    """Where jobs are done. scheduler: address such as tcp://host:8786, None: processes of this machine. workers: how
    many of those, None: one per core."""

    scheduler: str | None = None
    workers: int | None = None


HERE = Cluster()
"""All cores of this machine."""


class JobFailed(NamedTuple):
    """In place of the result of a job. text: why there is none."""

    text: str


class Answer(NamedTuple, Generic[Result]):
    """What became of a job. place: its number among the jobs."""

    place: int
    result: Result | JobFailed


def run(function: Callable[[Job], Result], jobs: Sequence[Job], cluster: Cluster = HERE) -> Iterator[Answer[Result]]:
    """Call the function for every job, elsewhere; answers come in the order in which they are ready.

    function: of a module that the workers can import, too. Jobs and results are pickled.

    Raises BadInput where no scheduler or no worker answers, where the scheduler goes away, and where a worker has
    another version of this code; answers that came before are complete.
    """
    if not jobs:
        return
    with _connected(cluster) as client:
        from distributed import CancelledError, as_completed
        from distributed.comm.core import CommClosedError

        futures = client.map(_called, [(function, job, code_version()) for job in jobs], pure=False)
        places = {future.key: place for place, future in enumerate(futures)}
        try:
            for future in as_completed(futures):
                if future.cancelled():
                    raise CancelledError(future.key)
                yield Answer(places[future.key], _result(future))
                future.release()
        except (CancelledError, CommClosedError):
            raise BadInput(f"the scheduler {_address(cluster)} went away; run the command again to go on") from None


class _OtherVersion(Exception):
    """A worker has other code."""


def _called(stated: tuple[Callable[[Any], Any], Any, str]) -> Any:
    """One job, in a worker."""
    function, job, version = stated
    if code_version() != version:
        raise _OtherVersion(f"has irsbot {code_version()}, must have {version} as here")
    return function(job)


def _result(future: Any) -> Any:
    """The result of a job that is done, or why there is none."""
    from distributed import KilledWorker

    error = future.exception() if future.status == "error" else None
    if error is None:
        return future.result()
    if isinstance(error, KilledWorker):
        return JobFailed("one worker process after another ended while it did this; is there enough memory?")
    if isinstance(error, _OtherVersion):
        raise BadInput(f"a worker {error}") from None
    return JobFailed(f"{type(error).__name__}: {error}")


def _address(cluster: Cluster) -> str:
    return cluster.scheduler or "of this machine"


@contextmanager
def _connected(cluster: Cluster) -> Iterator[Client]:
    """A client of the cluster; processes that were started for it end with it."""
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise BadInput(f"several bags need {error.name}: 'pip install distributed'") from None
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # we say ourselves what matters
    with dask.config.set({"distributed.comm.timeouts.connect": f"{ANSWER_S}s"}):
        if cluster.scheduler is not None:
            with _client_of(cluster.scheduler) as client:
                yield client
            return
        with (
            LocalCluster(
                n_workers=cluster.workers or os.cpu_count() or 1,
                threads_per_worker=1,
                dashboard_address=None,
                silence_logs=logging.CRITICAL,
            ) as local,
            Client(local, timeout=START_S) as client,
        ):
            yield client


@contextmanager
def _client_of(address: str) -> Iterator[Client]:
    """A client of a scheduler that runs. Raises BadInput."""
    from distributed import Client

    try:
        client = Client(address, timeout=ANSWER_S)
    except (OSError, ValueError) as error:  # a timeout is an OSError
        reason = "must be like tcp://host:8786" if isinstance(error, ValueError) else "'dask scheduler' starts one"
        raise BadInput(f"no Dask scheduler answers at {address}; {reason}") from None
    try:
        with suppress(TimeoutError):
            client.wait_for_workers(1, timeout=ANSWER_S)
        if not client.scheduler_info()["workers"]:
            raise BadInput(f"the scheduler {address} has no workers; 'dask worker {address}' starts one")
        yield client
    finally:
        client.close(timeout=1)
