"""Launches a campaign on a Dask cluster whose machines share the campaign's folder, which alone says what is finished.

    driver (parcours run)             scheduler              workers (dask worker), on any machine
      | portions: some shards each ---->|-------------------->|  write each shard into the folder
      |<------ a portion is computed ---|<--------------------|  skip those that are there already

Dask keeps nothing that is needed: workers, scheduler and driver may be killed, and the same command goes on. What a
worker is sent is pickled, as all that Dask sends: who reaches a scheduler runs code on its workers.
"""

from __future__ import annotations

import asyncio
import logging
import math
import pickle
import time
from collections import Counter, deque
from collections.abc import Generator, Sequence
from typing import Any

from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.run.cluster_worker import Portions, compute, fitness, require_fit, versions
from parcours.run.exception_text import described, said
from parcours.run.store import Store
from parcours.run.strangers import Simulate

PORTION = 5.0
"""How long a portion is to take at least [s of wall clock]: Dask starts some hundred a second."""

_PORTIONS_A_SECOND = 100
_AHEAD = 2
"""Portions for each worker that the scheduler knows of; 1 once one died, since all that wait there are blamed."""
_FIRST = 2  # shards in a portion before it is known how long one takes: what two take tells it
_ATTEMPTS = 2
_RECOUNTED = 2.0  # how often workers are counted [s]
_LOOKED = 0.02  # how often answers are looked for where there are none [s]
_TO_CONNECT = 10.0  # [s]
_TO_COME = 60.0  # for the first worker [s]


def launched(simulate: Simulate | str, store: Store, shards: Sequence[int], address: str) -> Generator[int, None, None]:
    """Yield each shard once some worker has written it.

    Args:
        simulate: the study's function or its name; picklable.
        store: of the campaign, in a folder that all machines share.
        shards: those that are missing.
        address: of the scheduler, as tcp://host:8786.

    Raises:
        BadRequest: Dask is not installed, no scheduler or worker answers, a worker is not fit, or the function cannot
            be sent.
        BadResults: a worker does not see the folder.
        HostFailure: the function raised, workers died on a shard, or the scheduler ended.
    """
    dask, sent = _imported(), _sendable(Portions(simulate, store))
    client = _connected(dask, address)
    try:
        yield from _Launch(dask, client, store, sent, shards).run()
    finally:
        client.close(timeout=2)  # forgets what has not begun


class _Launch:
    """The portions of a campaign that are under way, and what is still to be sent."""

    def __init__(self, dask: Any, client: Any, store: Store, sent: bytes, shards: Sequence[int]) -> None:
        self._dask, self._client, self._store, self._sent = dask, client, store, sent
        self._waiting = deque(shards)
        self._under_way: dict[Any, tuple[tuple[int, ...], bool]] = {}  # portions, and whether none waits behind another
        self._pace, self._deaths, self._ahead = Pace(), Counter[int](), _AHEAD
        self._workers, self._counted = len(self._require_workers()), time.monotonic()
        self._answers = dask.as_completed(loop=client.loop)

    def _require_workers(self) -> dict[str, Any]:
        """Return the workers there are. Raises BadRequest: there are none, or one that is not fit."""
        try:
            self._client.wait_for_workers(1, timeout=_TO_COME)
        except TimeoutError as error:
            rule = f"the scheduler must have a worker, but none has come within {_TO_COME:g} s"
            remedy = "start some: dask worker ADDRESS --nthreads 1"
            raise BadRequest("--engine dask", rule, remedy, slug="engine-workers") from error
        found = self._client.run(fitness, on_error="return")
        for address, one in sorted(found.items()):
            if isinstance(one, Exception):
                rule = f"it must have Parcours as it is installed here, but: {described(one)}"
                remedy = f"install {versions()['parcours']} there"
                raise BadRequest(f"worker {address}", rule, remedy, slug="engine-version")
            require_fit(f"worker {address}", one, versions())
        return dict(found)

    def run(self) -> Generator[int, None, None]:
        """Yield each shard once it is written. Raises as `launched`."""
        try:
            while self._send():
                if self._answers.has_ready():
                    future = next(self._answers)
                    yield from self._finished(future, *self._under_way.pop(future))
                else:  # a worker may come meanwhile, and is sent its portion
                    time.sleep(_LOOKED)
        except ParcoursError:
            raise
        except (Exception, asyncio.CancelledError) as error:  # whatever of Dask's the lost line was noticed in
            raise _lost(said(error)) from error

    def _send(self) -> bool:
        """Keep all workers busy; return whether any portion is under way."""
        if time.monotonic() - self._counted > _RECOUNTED:
            self._workers, self._counted = max(len(self._client.nthreads()), 1), time.monotonic()
        while self._waiting and len(self._under_way) < self._ahead * self._workers:
            size = self._pace.shards(len(self._waiting), self._workers)
            part = tuple(self._waiting.popleft() for _ in range(size))
            future = self._client.submit(compute, self._sent, part, versions(), pure=False)
            self._under_way[future] = part, self._ahead == 1
            self._answers.add(future)
        return bool(self._under_way)

    def _finished(self, future: Any, shards: tuple[int, ...], is_alone: bool) -> Sequence[int]:
        """Return which shards of a portion are written; raise in our words what a worker has raised.

        `is_alone`: no portion was sent to wait at a worker behind another one.
        """
        if future.status == "finished":
            self._pace.learn(future.result())
            return shards
        if future.status in ("lost", "pending"):  # its worker died before it was asked: another one gets it
            self._under_way[future] = shards, is_alone
            self._answers.add(future)
            return ()
        if future.status != "error":
            raise _lost(future.status)
        error = future.exception()
        if isinstance(error, ParcoursError):
            raise error
        left = [shard for shard in shards if not self._store.has(shard)]
        if not isinstance(error, self._dask.KilledWorker):
            rule = f"must be computed without an error, but raised {described(error)}"
            raise HostFailure(self._store.name(shards[0]), rule, slug="shard-raised")
        self._ahead = 1
        if left:  # the first of them is what its workers were at, if it was alone there
            self._deaths[left[0]] += is_alone
            if self._deaths[left[0]] >= _ATTEMPTS:
                n = _ATTEMPTS * (error.allowed_failures + 1)
                rule = f"its worker must live, but {n} died on it, {error.last_worker.address} last"
                remedy = "look into that worker's log: it may want memory"
                raise HostFailure(self._store.name(left[0]), rule, remedy, slug="worker-died")
            self._waiting.extendleft(reversed(left))
        return [shard for shard in shards if shard not in left]


class Pace:
    """How many shards make a portion, by how long those took that were computed.

    >>> pace = Pace()
    >>> pace.shards(left=4000, workers=4)
    2
    >>> pace.learn([1.0, 1.25])  # a quarter of a second a shard; the first one waited for a compiler
    >>> pace.shards(left=4000, workers=4), pace.shards(left=40, workers=4), pace.shards(left=10**6, workers=2000)
    (30, 10, 80)
    """

    def __init__(self) -> None:
        self._seconds, self._to_start = math.inf, 0.0

    def learn(self, finished: Sequence[float]) -> None:
        """Take in when each shard of a portion was finished [s after its start]; the latest portions count most."""
        if len(finished) < 2:
            return
        seconds = max(finished[-1] - finished[0], 1e-6) / (len(finished) - 1)
        to_start = max(finished[0] - seconds, 0.0)
        if math.isfinite(self._seconds):
            seconds, to_start = 0.5 * (self._seconds + seconds), 0.5 * (self._to_start + to_start)
        self._seconds, self._to_start = seconds, to_start

    def shards(self, left: int, workers: int) -> int:
        """Return how many make a portion that takes PORTION, longer where there are many workers or starting takes
        long; never more than what each worker has left."""
        seconds = max(PORTION, workers / _PORTIONS_A_SECOND, 10.0 * self._to_start)
        enough = math.ceil(seconds / self._seconds) if math.isfinite(self._seconds) else _FIRST
        return min(enough, math.ceil(left / workers))


def _lost(why: str) -> HostFailure:
    rule = f"the scheduler must stay until all is computed, but it ended or gave up ({why})"
    remedy = "start it again, and give the same command: what is finished is kept"
    return HostFailure("--engine dask", rule, remedy, slug="engine-lost")


def _imported() -> Any:
    try:
        import distributed
    except ImportError as error:
        rule = "it needs the package distributed, which is not installed"
        raise BadRequest("--engine dask", rule, "pip install 'parcours[dask]'", slug="no-engine-extra") from error
    for name in list(logging.root.manager.loggerDict):  # our own messages tell what matters
        if name.partition(".")[0] == "distributed":
            logging.getLogger(name).setLevel(logging.CRITICAL)
    return distributed


def _sendable(task: Portions) -> bytes:
    """Return a task in bytes. Raises BadRequest: it cannot be sent to another machine."""
    try:
        sent = pickle.dumps(task)
        if b"parcours_loaded_" not in sent:  # a module that is a file, and known here only
            return sent
        said = "it is an object of a file that is loaded here"
    except (AttributeError, TypeError, pickle.PicklingError) as error:
        said = str(error)
    rule, remedy = f"what runs on a cluster must be sent there, but: {said}", "name it in the study: 'file.py:function'"
    raise BadRequest("--engine dask", rule, remedy, slug="not-picklable")


def _connected(dask: Any, address: str) -> Any:
    try:
        return dask.Client(address, timeout=_TO_CONNECT, set_as_default=False, name="parcours")
    except (OSError, ValueError, TypeError) as error:
        rule = f"a Dask scheduler must answer there, but: {error}"
        raise BadRequest(f"--address {address}", rule, "start one: dask scheduler", slug="engine-address") from error
