"""Shows how far the work is: a bar on the terminal, and elsewhere a plain line now and then, both on standard error."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

PERIOD = 10.0
"""Least time between two lines about the same work [s]."""

Report = Callable[[str, int, int], None]
"""Reports (what, how many are done, how many in all); a second line of `what` says what came of it so far."""


@contextmanager
def progress(clock: Callable[[], float] = time.monotonic) -> Iterator[Report]:
    """Yield a function (what, done, in all) that shows how far each `what` is.

    Args:
        clock: tells the time [s]; it decides only when a line is printed, and what it says of time.
    """
    console = None
    if sys.stderr.isatty() or os.environ.get("FORCE_COLOR"):
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.table import Column

        console = Console(stderr=True)
    if console is None or not console.is_terminal:
        lines = _Lines(clock)
        try:
            yield lines.report
        finally:
            lines.end()
        return
    bars: dict[str, Callable[[int, str], None]] = {}
    rest = Column(ratio=1, no_wrap=True, overflow="ellipsis")
    columns = (
        TextColumn("{task.description}", markup=False), BarColumn(20), MofNCompleteColumn(), TimeElapsedColumn(),
        TextColumn("{task.fields[said]}", markup=False, table_column=rest),
    )  # fmt: skip
    with Progress(*columns, console=console, expand=True) as display:

        def bar(what: str, done: int, total: int) -> Callable[[int, str], None]:
            began, task = clock(), display.add_task(what, total=total, said="")

            def update(now: int, so_far: str) -> None:
                pace = ", ".join(_pace(now, total, clock() - began, done))
                display.update(task, completed=now, said="; ".join(filter(None, (pace, so_far))))

            return update

        def report(what: str, done: int, total: int) -> None:
            what, _, so_far = what.partition("\n")
            if what not in bars:
                bars[what] = bar(what, done, total)
            bars[what](done, so_far)

        yield report


@dataclass(slots=True)
class _Work:
    """One kind of work: when it began and with how much done, how far it is, and when a line was printed."""

    what: str
    began: float
    done_before: int
    done: int
    total: int
    printed: float
    so_far: str = ""
    is_printed: bool = False

    def show(self, now: float) -> None:
        import click

        line = progress_line(self.what, self.done, self.total, now - self.began, self.done_before)
        click.echo("; ".join(filter(None, (line, self.so_far))), err=True)
        self.printed, self.is_printed = now, True


class _Lines:
    """Prints a line when a work begins, at most every PERIOD while it goes on, and when it is over."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock = clock
        self._works: dict[str, _Work] = {}

    def report(self, what: str, done: int, total: int) -> None:
        what, _, so_far = what.partition("\n")
        now = self._clock()
        is_first = what not in self._works
        work = self._works.setdefault(what, _Work(what, now, done, done, total, now))
        work.is_printed = work.is_printed and (done, total) == (work.done, work.total)
        work.done, work.total, work.so_far = done, total, so_far
        if is_first or (not work.is_printed and (now - work.printed >= PERIOD or done == total)):
            work.show(now)

    def end(self) -> None:
        now = self._clock()
        for work in self._works.values():
            if not work.is_printed:
                work.show(now)


def progress_line(what: str, done: int, total: int, seconds: float, before: int = 0) -> str:
    """Return how far a work is, how long it took, and about how long it will take on.

    >>> progress_line("lift, simulated", 3200, 10_000, 41.0)
    'lift, simulated: 3200 of 10000, 32 %, 41 s, 78 a second, about 87 s left'
    >>> progress_line("states", 300, 200, 4000.0), progress_line("checks", 0, 9, 0.0)
    ('states: 300 of 200, 67 min', 'checks: 0 of 9')
    """
    said = [f"{what}: {done} of {total}"]
    if 0 < done <= total:
        said.append(f"{100 * done // total} %")
    if seconds >= 0.5:
        said.append(_spoken(seconds))
    return ", ".join(said + _pace(done, total, seconds, before))


def _pace(done: int, total: int, seconds: float, before: int) -> list[str]:
    """Return in words how fast a work goes on and about how long it will take; nothing before half a second."""
    if not (before < done <= total and seconds >= 0.5):
        return []
    rate = (done - before) / seconds
    left = [f"about {_spoken((total - done) / rate)} left"] if done < total else []
    return [f"{rate:.0f} a second" if rate >= 10.0 else f"{rate:.2g} a second", *left]


def _spoken(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 600.0 else f"{seconds / 60.0:.0f} min"


def say_if_cold() -> None:
    """Say that kernels are compiled: at once if none is on disk, else when this process compiles its first."""
    import click

    from parcours.kernels import is_warm, tell_of_compiling

    if not is_warm():
        click.echo("compiling kernels for this machine, once: up to half a minute", err=True)
    else:
        tell_of_compiling(lambda: click.echo("compiling further kernels for this machine, once", err=True))
