"""Launches tasks on a Dask cluster whose machines share a folder. What is finished, the folder alone says.

    driver (parcours run)             scheduler              workers (dask worker), on any machine
      | tasks: some shards each ------->|-------------------->|  computes a shard, writes it into the folder
      |<------ a task is finished ------|<--------------------|  skips one that is there already

Dask keeps nothing that is needed: workers, scheduler and driver may be killed, and the same command goes on. What a
worker is sent is pickled, as all that Dask sends: who reaches a scheduler runs code on its workers.
"""

from __future__ import annotations

import os
import pickle
import socket
from collections.abc import Callable, Generator, Sequence
from typing import TYPE_CHECKING, Any

from parcours import __version__
from parcours.errors import BadRequest, HostFailure, ParcoursError
from parcours.kernels import kernel_cache
from parcours.run.raised import described

if TYPE_CHECKING:
    import distributed

_MOST_TASKS = 16_000  # Dask starts some hundred tasks a second, so a task of a large campaign is many shards


def launch(
    task: Callable[[int], None], numbers: Sequence[int], address: str, name: Callable[[int], str]
) -> Generator[int, None, None]:
    """Yield each number once `task(number)` has returned on some worker, in order of completion.

    Args:
        task: picklable; does nothing for a number that is done already.
        numbers: what to run.
        address: of the scheduler, as tcp://host:8786.
        name: what to call a number in a message.

    Raises:
        BadRequest: no scheduler answers, Dask is not installed, or a worker is not fit for the task.
        HostFailure: a task raised, its workers died several times, or the scheduler ended.
    """
    dask = _imported()
    try:
        client = dask.Client(address, timeout=10, set_as_default=False, name="parcours")
    except (OSError, ValueError, TypeError) as error:
        rule = f"a Dask scheduler must answer there, but: {error}"
        raise BadRequest(f"--address {address}", rule, "start one: dask scheduler", slug="engine-address") from error
    together = -(-len(numbers) // _MOST_TASKS)
    parts = [tuple(numbers[k : k + together]) for k in range(0, len(numbers), together)]
    sent = pickle.dumps(task)
    try:
        futures = {client.submit(_on_worker, sent, part, _version(), pure=False): part for part in parts}
        for future in dask.as_completed(list(futures), loop=client.loop):
            part = futures.pop(future)
            _require_done(dask, future, name(part[0]))
            yield from part
    finally:
        client.close(timeout=2)  # forgets what has not begun


def _imported() -> Any:
    try:
        import distributed
    except ImportError as error:
        rule = "it needs the package distributed, which is not installed"
        raise BadRequest("--engine dask", rule, "pip install 'parcours[dask]'", slug="no-engine-extra") from error
    return distributed


def _require_done(dask: Any, future: distributed.Future, where: str) -> None:
    """Raise what a task has raised, in our words."""
    if future.status == "finished":
        return
    if future.status != "error":
        rule = f"the scheduler must stay until all is computed, but it ended or gave up ({future.status})"
        remedy = "start it again, and give the same command: what is finished is kept"
        raise HostFailure(where, rule, remedy, slug="engine-lost")
    error = future.exception()
    if isinstance(error, ParcoursError):
        raise error
    if isinstance(error, dask.KilledWorker):
        rule = f"its worker must live, but {error.allowed_failures + 1} died on it, last {error.last_worker.address}"
        raise HostFailure(where, rule, "look into that worker's log; it may want memory", slug="worker-died")
    if isinstance(error, ImportError):
        rule = f"a worker must have Parcours installed, but: {error}"
        raise BadRequest("--engine dask", rule, f"install {_version()} there", slug="engine-version")
    rule = f"must be computed without an error, but raised {described(error) if error else 'nothing'}"
    raise HostFailure(where, rule, slug="shard-raised")


def _version() -> str:
    """Return what the bits of results depend on beside the study: our version, kernels, and the libraries they use."""
    return f"Parcours {__version__} ({kernel_cache().name[:12]})"


def _on_worker(sent: bytes, numbers: Sequence[int], version: str) -> None:
    """Do a task for some numbers. Raises BadRequest: this worker is not fit for it."""
    import multiprocessing

    where = f"worker {os.getpid()} on {socket.gethostname()}"
    if _version() != version:
        rule = f"it must have the driver's {version}, but has {_version()}"
        raise BadRequest(where, rule, "install the same versions there, and start it again", slug="engine-version")
    try:
        task = pickle.loads(sent)
    except (ImportError, AttributeError, OSError, ParcoursError) as error:
        rule = f"it must find the study's files, but: {error}"
        remedy = "start workers in the folder in which `parcours run` is given, on a file system that all share"
        raise BadRequest(where, rule, remedy, slug="engine-study") from error
    multiprocessing.current_process().daemon = False  # Dask's nanny makes it one; a task may have workers of its own
    for number in numbers:
        try:
            task(number)
        except ParcoursError:
            raise
        except Exception as error:
            raise HostFailure(where, f"must compute it without an error, but raised {described(error)}",
                              slug="shard-raised") from error  # fmt: skip
