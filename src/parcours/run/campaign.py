"""Computes the shards that are missing of a campaign, in any number of workers, into a folder.

The results are the same bytes for any number of workers, any order, and however often it was interrupted. A worker that
dies costs the task it was on and nothing else.
"""

from __future__ import annotations

import contextlib
import signal
import threading
from collections import Counter
from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Protocol, runtime_checkable

from parcours.errors import BadRequest, BadResults, ParcoursError
from parcours.run.atomic import sweep
from parcours.run.claiming import claimed
from parcours.run.exception_text import described
from parcours.run.folder_backup import Keeping
from parcours.run.heartbeat import RunsStrangers
from parcours.run.limiting import limited
from parcours.run.locations import is_bucket
from parcours.run.stops import STOP, Stop, read_stop
from parcours.run.store import Campaign, Rows, Store, create
from parcours.run.strangers import Simulate, computed, lost_before, resolve
from parcours.run.workers import Crew, Done, Lost, failure_of

Task = Callable[[int], None]
"""Does what has a number."""

_ATTEMPTS = 2

Progress = Callable[[int, int], None]
"""Called with (cases finished, cases in all) at the start and after every shard."""

Enough = Callable[[Rows], str]
"""Gets the rows of every shard, in the order of shards; returns why these are enough, "" if they are not.

If it has `fields`, the rows have these alone.
"""


@runtime_checkable
class Prepares(Protocol):
    """A study's function that can load or compile its code before its first case: once, not once in every worker."""

    def prepare(self) -> bool:
        """Load or compile what every case needs; return whether all of it is ours, so that a fork may share it."""


class Interrupted(Exception):
    """The user stopped the runs; what was finished is in the folder."""


@dataclass(frozen=True, slots=True)
class CampaignOutcome:
    """How far a campaign came."""

    store: Store
    finished: int
    """Cases whose results are in the folder."""
    interrupted: bool
    stopped: str = ""
    """Why no more were computed: a rule is met, or time is over."""
    repaired: tuple[int, ...] = ()
    """Shards that were found damaged, and removed."""

    def __str__(self) -> str:
        """Say it in a sentence or two."""
        if self.repaired:
            names = ", ".join(self.store.path(shard).name for shard in self.repaired[:5])
            found = f"{len(self.repaired)} damaged shards were removed, to be computed again: {names}"
            return f"{replace(self, repaired=())}\n{found}{', ...' if len(self.repaired) > 5 else ''}"
        total = self.store.campaign.n_cases
        if self.stopped and self.interrupted:
            return f"nothing to judge in {self.store.folder}: {self.stopped}"
        if self.stopped:
            return f"stopped after {self.finished} cases, kept in {self.store.folder}: {self.stopped}"
        if not self.interrupted:
            return f"all {total} cases are finished in {self.store.folder}"
        return (
            f"interrupted: {self.finished} of {total} cases are finished and kept in {self.store.folder};"
            " run the same command again to compute the rest"
        )


def run_campaign(
    simulate: Simulate | str, campaign: Campaign, folder: Path, *, workers: int = 1, progress: Progress | None = None,
    enough: Enough | None = None, rules: Sequence[str] = (), max_time: float | None = None, address: str = "",
) -> CampaignOutcome:  # fmt: skip
    """Compute what is missing of a campaign, and return how far it came. Ctrl-C, SIGTERM or SIGHUP ends it early.

    Shards that are damaged count as missing.

    A function that runs strangers' code (`parcours.run.heartbeat.RunsStrangers`) always runs in processes of its own,
    and a case in which it hangs or takes its process down costs that case only.

    Args:
        simulate: the study's function, or its name "module:function". With several workers it is pickled and
            runs in processes of its own; with one worker it runs here.
        campaign: what to compute.
        folder: where the results go; resumed if this very campaign was started there. A bucket's, see
            `parcours.run.locations.location`, is not locked; of memory:// each process has its own,
            so with one worker only.
        workers: number of processes, at least 1.
        progress: called in this process.
        enough: called in this process; ends the campaign after the first shard in whose order it says why, for
            any number of workers. What they had computed beyond it is removed.
        rules: in words what `enough` goes by; where a folder was begun by others, it may end beyond its shards only.
        max_time: ends the campaign after so much time [s of wall clock], with the first shards that are finished; None:
            never.
        address: of a Dask scheduler, whose workers then compute the shards in place of processes here, and write them
            into the folder, which they must share; see `parcours.run.engine`.

    Raises:
        BadRequest: a count is out of range, `simulate` cannot be found or sent, or the folder cannot be
            written to; or no scheduler answers, or a worker of it is not fit.
        BadResults: the folder holds something else, or another run is writing there.
        HostFailure: `simulate` raised or gave results of the wrong form, a worker died twice on a shard, or the
            scheduler ended.

    >>> import numpy as np, tempfile
    >>> def squares(first: int, count: int) -> Rows:
    ...     return np.array([(n, n * n) for n in range(first, first + count)], campaign.dtype)
    >>> campaign = Campaign("squares", "plain", 0, 5, np.dtype([("n", "i8"), ("n2", "i8")]), shard_size=2)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     run_campaign(squares, campaign, Path(folder)).store.load()["n2"].tolist()
    [0, 1, 4, 9, 16]
    """
    if workers < 1:
        raise BadRequest("workers", f"at least one is needed, but {workers} were asked for", slug="count-range")
    function = resolve(simulate) if isinstance(simulate, str) else simulate
    task = simulate if isinstance(simulate, str) else function
    store = create(folder, campaign)
    with claimed(folder):
        damaged = store.damaged()
        store.discard(damaged)
        outcome = _run(function, task, store, workers, progress, enough, tuple(rules), max_time, address)
    return replace(outcome, repaired=damaged)


def _run(
    function: Simulate, sent: Simulate | str, store: Store, workers: int, progress: Progress | None,
    enough: Enough | None, rules: tuple[str, ...], max_time: float | None, address: str,
) -> CampaignOutcome:  # fmt: skip
    folder, campaign = store.folder, store.campaign
    stop, missing = _may_stop(store, rules), store.missing()
    # Without rules `enough` only watches the run: a finished campaign need not be read for it.
    order = _InOrder(store, enough if rules or missing else None, stop)
    finished = campaign.n_cases - sum(len(campaign.cases(shard)) for shard in missing)
    missing = () if order.is_enough() else missing
    report = progress or (lambda done, total: None)
    report(finished, campaign.n_cases)
    if address and missing:
        from parcours.run.engine import launched

        shards = launched(sent, store, missing, address)
    else:
        shards = _done(function, _ComputeShard(sent, store), missing, workers, store.name)
    try:
        with (
            terminable(), limited(max_time if missing else None, _TimeIsOver), contextlib.closing(shards) as done,
        ):  # fmt: skip
            for shard in done:
                finished += len(campaign.cases(shard))
                is_enough = order.is_enough()
                report(finished, campaign.n_cases)
                if is_enough:
                    break
    except KeyboardInterrupt as error:
        left = store.missing()
        there = campaign.n_cases - sum(len(campaign.cases(k)) for k in left)
        if isinstance(error, _TimeIsOver) and left:
            if not left[0]:
                first = f"{max_time:g} s are over before the first {len(campaign.cases(0))} cases were finished"
                return CampaignOutcome(
                    store, there, interrupted=True, stopped=f"{first}; give more time, or fewer cases"
                )
            stop = replace(order.stop, cases=campaign.cases(left[0] - 1).stop)
            stop.write(folder, campaign)
            why = f"{max_time:g} s are over, the same command goes on with what is missing of {campaign.n_cases}"
            return CampaignOutcome(store, store.planned, interrupted=False, stopped=why)
        return CampaignOutcome(store, there, interrupted=True)
    finally:
        sweep(folder)  # of what a stopped worker left half-written
    if order.is_enough():
        replace(order.stop, cases=campaign.cases(order.next - 1).stop).write(folder, campaign)
        store.discard(campaign.shards[order.next :])
        return CampaignOutcome(store, store.planned, interrupted=False, stopped=order.why)
    return CampaignOutcome(store, finished, interrupted=False)


def _may_stop(store: Store, rules: tuple[str, ...]) -> Stop:
    """Note that these rules, and no others, may end the campaign; return from which shard on."""
    noted = read_stop(store.folder, store.campaign)
    there = max((one for one in store.finished() if one in store.campaign.shards), default=-1) + 1
    stop = Stop(rules, noted.first if noted is not None and noted.rules == rules else there)
    if rules:
        stop.write(store.folder, store.campaign)
    else:
        (store.folder / STOP).unlink(missing_ok=True)
    return stop


class _InOrder:
    """Shows finished shards, in their order, to who says whether they are enough.

    ┌───┬───┬───┬───┐
    │ 0 │ 1 │   │ 3 │   two workers: shard 3 is there before shard 2, and is looked at after it
    └───┴───┴───┴───┘
          ^ next - 1
    """

    def __init__(self, store: Store, enough: Enough | None, stop: Stop) -> None:
        self._store, self._enough, self.stop = store, enough, stop
        self.next, self.why = 0, ""

    def is_enough(self) -> bool:
        """Look at the shards that are new, and return whether those before `next` are enough."""
        shards = self._store.campaign.shards
        while self._enough and not self.why and self.next < len(shards) and self._store.has(self.next):
            try:
                rows = self._store.read(self.next, getattr(self._enough, "fields", ()))
            except BadResults:  # strangers' code has changed it: it is put back in the end
                break
            self.next += 1
            said = self._enough(rows)
            self.why = said if self.next >= self.stop.first else ""
        return bool(self.why)


class _TimeIsOver(KeyboardInterrupt):
    """A campaign has taken the time that it was given."""


@dataclass(frozen=True, slots=True)
class _ComputeShard:
    """Computes and writes one shard, in any process."""

    simulate: Simulate | str
    store: Store

    def __call__(self, shard: int) -> None:
        function = resolve(self.simulate) if isinstance(self.simulate, str) else self.simulate
        cases = self.store.campaign.cases(shard)
        self.store.write(shard, function(cases.start, len(cases)))


def _done(
    function: Simulate, task: _ComputeShard, missing: tuple[int, ...], workers: int, name: Callable[[int], str]
) -> Generator[int, None, None]:
    """Yield each shard once it is computed: here if one process is enough, else in workers."""
    runs: object = function
    if not missing:
        return
    if isinstance(runs, RunsStrangers) and runs.heartbeat_words:
        store = task.store
        forks = isinstance(runs, Prepares) and runs.prepare()
        spans = [store.campaign.cases(shard) for shard in missing]
        n = min(workers, len(missing))
        keeping = Keeping(store)
        try:
            for k, rows in computed(task.simulate, spans, n, lambda k: name(missing[k]), forks=forks):
                keeping.write(missing[k], rows)
                yield missing[k]
        finally:
            keeping.put_back()
        return
    if workers == 1 or len(missing) == 1:
        for shard in missing:
            try:
                task(shard)
            except Exception as error:
                raise failure_of(name(shard), described(error)) from error
            yield shard
        return
    forks = isinstance(runs, Prepares) and runs.prepare() and not is_bucket(task.store.folder)  # nor are its clients
    if forks:
        import pyarrow.parquet  # noqa: F401 - else each worker loads it, for its first shard
    yield from run_tasks(task, missing, min(workers, len(missing)), name, forks=forks)


def run_tasks(
    task: Task, numbers: Sequence[int], workers: int, name: Callable[[int], str], *, forks: bool = False
) -> Generator[int, None, None]:
    """Yield each number once `task(number)` has returned in some worker, in order of completion.

    A task whose worker dies is given to a fresh worker once. After a failure no further task is started, those
    in progress are finished, and then the failure is raised. Leaving the iterator early stops the workers.

    Args:
        task: picklable, unless workers are forked.
        numbers: what to run, in the order in which to start.
        workers: how many processes, at least 1.
        name: what to call a task in a message.
        forks: whether workers are forked of this process; see `Crew`.

    Raises:
        HostFailure: a task raised, or its worker died twice.
        ParcoursError: an error of ours that a task raised.
        BadRequest: the task cannot be sent to another process.
    """
    tries = Counter[int]()
    failure: ParcoursError | None = None
    with contextlib.closing(Crew(task, workers, forks=forks)) as crew:
        crew.pending.extend((number, (number,)) for number in numbers)
        for number, answer in crew.answers():
            if isinstance(answer, Done):
                yield number
            elif not isinstance(answer, Lost):
                failure = failure or failure_of(name(number), answer)
            else:
                tries[number] += 1
                if tries[number] < _ATTEMPTS:
                    crew.pending.appendleft((number, (number,)))
                else:
                    failure = failure or lost_before(name(number), f"{answer.ending}, {_ATTEMPTS} times")
            if failure is not None:
                crew.pending.clear()
    if failure is not None:
        raise failure


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does; SIGHUP also, unless it is ignored, as under `nohup`."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    heard = [one for one in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(one) != signal.SIG_IGN]
    before = {one: signal.signal(one, stop) for one in heard}
    try:
        yield
    finally:
        for one, handler in before.items():
            signal.signal(one, handler)
