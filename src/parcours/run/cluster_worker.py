"""Computes portions of a campaign in a process of a Dask cluster, into the folder that all its machines share.

portion: shards 8 9 10 11       9 is there already: skipped
           write write write    each as soon as it is computed: a kill loses one shard at most
"""

from __future__ import annotations

import functools
import hashlib
import logging
import pickle
import platform
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, cast

import parcours
from parcours.errors import BadRequest, BadResults, ParcoursError
from parcours.run.atomic import sweep
from parcours.run.exception_text import described
from parcours.run.heartbeat import RunsStrangers
from parcours.run.store import Rows, Store, open_results
from parcours.run.strangers import Simulate, computed, crew_for, resolve
from parcours.run.workers import Crew, failure_of

_LIBRARIES = ("numpy", "numba", "llvmlite", "scipy", "pyarrow")
_LOG = logging.getLogger("distributed.parcours")  # shown in the log of a worker


@functools.cache
def versions() -> dict[str, str]:
    """Return what the bytes of results may depend on beside the study: the same on every machine of a cluster."""
    found = {"Python": ".".join(platform.python_version_tuple()[:2]), "parcours": parcours.__version__}
    for name in _LIBRARIES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            found[name] = "absent"
    digest = hashlib.sha256()
    site = Path(parcours.__file__).parent.parent
    for package in sorted(site.glob("parcours*/")):
        for path in sorted(package.rglob("*.py")):
            digest.update(str(path.relative_to(site)).encode() + b"\0" + path.read_bytes() + b"\0")
    return found | {"source code": digest.hexdigest()[:12]}


def fitness(dask_worker: Any) -> dict[str, str]:
    """Return what must be the same in all workers: `versions`, and that they do one thing at a time."""
    return versions() | {"threads": str(dask_worker.state.nthreads)}


def require_fit(worker: str, found: dict[str, str], wanted: dict[str, str]) -> None:
    """Raise BadRequest, which names the worker, if it is not as the driver wants it."""
    if found.get("threads", "1") != "1":
        rule = f"it must have one thread, as a process runs one case at a time, but has {found['threads']}"
        remedy = f"start it again: dask worker ... --nthreads 1 --nworkers {found['threads']}"
        raise BadRequest(worker, rule, remedy, slug="engine-threads")
    differing = [f"{name} {found.get(name)} (here {here})" for name, here in wanted.items() if found.get(name) != here]
    if differing:
        rule = (
            f"it must have what is installed here, on which the bytes of results depend, but has {', '.join(differing)}"
        )
        raise BadRequest(worker, rule, "install the same there, and start it again", slug="engine-version")


@dataclass(frozen=True, slots=True)
class Portions:
    """Computes shards that are not there yet."""

    simulate: Simulate | str
    store: Store

    def __call__(self, shards: Sequence[int]) -> tuple[float, ...]:
        """Compute and write what is missing of these shards; return when each was finished [s after the start].

        Raises:
            BadResults: the folder is not the campaign's on this machine.
            BadRequest: it cannot be written to.
            HostFailure: the study's function raised.
        """
        store = self.store
        self._require_folder()
        start, finished = time.perf_counter(), list[float]()
        wanted = store.shards  # which are fewer once a rule has ended the campaign
        missing = [shard for shard in shards if shard in wanted and not store.has(shard)]
        for shard, rows in self._rows(missing):
            store.write(shard, rows)
            _LOG.info("computed %s of %s", store.name(shard), store.folder)
            finished.append(time.perf_counter() - start)
        return tuple(finished)

    def _require_folder(self) -> None:
        folder = self.store.folder
        try:
            theirs = open_results(folder).campaign.digest
        except BadResults as error:
            theirs = error.rule
        if theirs != self.store.campaign.digest:
            rule = f"the folder must be the same on all machines, but here {theirs}"
            raise BadResults(str(folder), rule, "name a folder on a file system that all share", slug="engine-folder")
        _swept(folder)

    def _rows(self, shards: list[int]) -> Iterator[tuple[int, Rows]]:
        store = self.store
        function: object = resolve(self.simulate) if isinstance(self.simulate, str) else self.simulate
        spans = [store.campaign.cases(shard) for shard in shards]
        if isinstance(function, RunsStrangers) and function.heartbeat_words:
            yield from self._strangers_rows(shards, spans)
            return
        for shard, span in zip(shards, spans, strict=True):
            if store.has(shard):  # by now: of a driver that was killed, another worker may still be at a portion
                continue
            try:
                rows = cast(Simulate, function)(span.start, len(span))
            except Exception as error:
                raise failure_of(store.name(shard), described(error)) from error
            yield shard, rows

    def _strangers_rows(self, shards: list[int], spans: list[range]) -> Iterator[tuple[int, Rows]]:
        """Yield the rows of shards, from a process that is kept for the next portion: starting one takes seconds."""
        store, key = self.store, pickle.dumps(self.simulate)
        for other in [one for one in _crews if one != key]:
            _crews.pop(other).close()
        # Not forked: this process has threads of Dask's.
        crew = _crews.pop(key, None) or crew_for(self.simulate, 1, forks=False)
        try:
            for k, rows in computed(self.simulate, spans, 1, lambda k: store.name(shards[k]), forks=False, crew=crew):
                yield shards[k], rows
        except BaseException:
            crew.close()
            raise
        crew.apart.clear()
        _crews[key] = crew


_crews: dict[bytes, Crew[Rows]] = {}  # by the function that they compute, pickled; one at most


@functools.cache
def _swept(folder: Path) -> None:
    """Remove what workers that were killed on this machine have left half-written; once in a process."""
    sweep(folder)


@functools.lru_cache(maxsize=2)
def _task(sent: bytes) -> Portions:
    found: Portions = pickle.loads(sent)
    return found


def compute(sent: bytes, shards: Sequence[int], wanted: dict[str, str]) -> tuple[float, ...]:
    """Compute a portion; return when each of the shards that were missing was finished [s after the start].

    Args:
        sent: a pickled `Portions`.
        shards: some of its campaign.
        wanted: what the driver's `versions` are.

    Raises:
        BadRequest: this worker is not fit, or lacks files of the study.
        ParcoursError: as `Portions` says; with the name of this worker.
    """
    import multiprocessing

    import distributed

    dask_worker = distributed.get_worker()
    worker = f"worker {dask_worker.address}"
    require_fit(worker, fitness(dask_worker), wanted)
    try:
        task = _task(sent)
    except Exception as error:
        rule = f"it must find what the study is made of, but: {described(error)}"
        remedy = "install it there, or start the worker in the study's folder with PYTHONPATH=."
        raise BadRequest(worker, rule, remedy, slug="engine-study") from error
    multiprocessing.current_process().daemon = False  # Dask's nanny makes it one; strangers' code runs in its children
    try:
        return task(shards)
    except ParcoursError as error:
        raise type(error)(f"{worker}, {error.where}", error.rule, error.remedy, slug=error.slug) from error
