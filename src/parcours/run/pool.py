"""Runs numbered tasks in workers; a worker that dies costs the task it was on and nothing else.

Where a task says on which case it is, a worker that hangs is ended, and the task is done again without that case.
"""

from __future__ import annotations

import contextlib
import signal
from collections import Counter
from collections.abc import Callable, Generator, Sequence
from typing import Protocol

from parcours.errors import HostFailure, ParcoursError
from parcours.run.heartbeat import LostCase
from parcours.run.workers import Crew, Done, Lost, failure_of

_ATTEMPTS = 2
_FROM_OUTSIDE = (-signal.SIGKILL, -signal.SIGTERM)
"""Status of a process that something else has ended: for want of memory, say."""


class Task(Protocol):
    """What workers do; it must be picklable."""

    def __call__(self, number: int, lost: tuple[LostCase, ...], /) -> None:
        """Do the task of this number, without the cases that were lost on earlier attempts at it."""


def run_tasks(
    task: Task,
    numbers: Sequence[int],
    workers: int,
    name: Callable[[int], str],
    *,
    heartbeat_words: int = 0,
    forks: bool = False,
) -> Generator[int, None, None]:
    """Yield each number once `task(number, lost)` has returned in some worker, in order of completion.

    A task whose worker dies is given to a fresh worker once. After a failure no further task is started, those
    in progress are finished, and then the failure is raised. Leaving the iterator early stops the workers.
    With `heartbeat_words`, a task whose worker hung or died in a case is started again as often as it takes, without
    the cases that were lost; what ended a worker from outside is believed to be the case's doing the second time only.

    Args:
        task: picklable, unless workers are forked.
        numbers: what to run, in the order in which to start.
        workers: how many processes, at least 1.
        name: what to call a task in a message.
        heartbeat_words: size of the array that a worker shares (`parcours.run.heartbeat`), or 0 for none.
        forks: whether workers are forked of this process; see `Crew`.

    Raises:
        HostFailure: a task raised, or its worker died twice.
        ParcoursError: an error of ours that a task raised.
        BadRequest: the task cannot be sent to another process.
    """
    tries, deaths = Counter[int](), Counter[int]()
    lost: dict[int, tuple[LostCase, ...]] = {}
    failure: ParcoursError | None = None
    with contextlib.closing(Crew(task, workers, forks=forks, n_words=heartbeat_words)) as crew:
        crew.pending.extend((number, (number, ())) for number in numbers)
        for number, answer in crew.answers():
            if isinstance(answer, Done):
                yield number
            elif not isinstance(answer, Lost):
                failure = failure or failure_of(name(number), answer)
            elif answer.case is not None:
                case = answer.case
                deaths[case.number] += 1
                if answer.how == "hung" or answer.status not in _FROM_OUTSIDE or deaths[case.number] == _ATTEMPTS:
                    lost[number] = (*lost.get(number, ()), case)
                crew.pending.appendleft((number, (number, lost.get(number, ()))))
            else:
                tries[number] += 1
                if tries[number] < _ATTEMPTS:
                    crew.pending.appendleft((number, (number, lost.get(number, ()))))
                else:
                    failure = failure or _died(name(number), answer)
            if failure is not None:
                crew.pending.clear()
    if failure is not None:
        raise failure


def _died(name: str, lost: Lost) -> HostFailure:
    rule = f"was started {_ATTEMPTS} times, but its worker {lost.ending} each time"
    remedy = "run these cases with one worker to see why; all other shards are kept"
    return HostFailure(name, rule, remedy, slug="worker-died")
