"""Components that are threads or coroutines: Python classes with `run(self, port)`.

The object's thread and the tester hand a baton to and fro: the thread runs only between a permit of the tester and its
next call of the port, so what it does in simulated time does not depend on the machine.

    tester   --next()-->            ...--next()-->
    thread   (receive)  runs  took("d1")  (blocked)  runs  receive()
                                |-> Took                     |-> idle

An asyncio loop is idle when all its tasks wait. `asyncio.sleep` and `asyncio.timeout` keep the tester's time.
"""

from __future__ import annotations

import asyncio
import contextlib
import inspect
import selectors
import sys
import threading
import traceback
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue

from parcours.errors import HostFailure
from parcours.model.structure import Component as Modelled
from parcours.run.port import Send, Step
from parcours.study.components.simple import Took, require_allowed, took

# What `receive` returns: (channel, message); (None, transition) if asked for a transition that no message starts; or
# (None, None) if asked for whatever can be done
Arrival = tuple[str | None, object]

_GRACE = 1.0  # how long a thread may take to end after the tester has let go of it [s]
# A thread that catches its end this often and goes on is put to sleep for good: it would use up a processor
_MOST_REFUSED = 100
_OURS = str(Path(__file__).parent)


@dataclass(frozen=True, slots=True)
class _Idle:
    """The thread waits for an arrival, or for a time [ns]."""

    wake: int | None = None


@dataclass(frozen=True, slots=True)
class _Over:
    """The thread has ended, as it should or by an exception."""

    error: BaseException | None = None


class _Closed(BaseException):
    """Unwinds a thread that the tester has let go of; no `except Exception` stops it."""


class _Desk:
    """What the tester and the thread share: the baton, the time, and what has arrived."""

    def __init__(self, name: str, transitions: frozenset[str]) -> None:
        self.name, self._transitions = name, transitions
        self.now = 0
        self.arrived: deque[Arrival] = deque()
        self.closed = False
        self.go: SimpleQueue[None] = SimpleQueue()
        self.reports: SimpleQueue[Took | _Idle | _Over] = SimpleQueue()
        self.nudge: Callable[[], object] = lambda: None  # Wakes a loop that waits for something outside
        self._refused = 0

    def hand_over(self, report: Took | _Idle) -> None:
        """In the thread: let the tester go on, and wait until it permits the next step."""
        self.require_open()
        self.reports.put(report)
        self.go.get()
        self.require_open()

    def require_open(self) -> None:
        """In the thread: unwind it if the tester has let go."""
        if self.closed:
            self._refused += 1
            if self._refused > _MOST_REFUSED:
                threading.Event().wait()
            raise _Closed

    def take(self, transition: str, sends: tuple[Send, ...], messages: Mapping[str, object]) -> None:
        """In the thread: take a transition. Raises ValueError if the model does not allow it."""
        step = took(transition, *sends, **messages)
        require_allowed(step, self.name, self._transitions)
        self.hand_over(step)


class _Port:
    """What both kinds of port share: the tester's time."""

    def __init__(self, desk: _Desk) -> None:
        self._desk = desk

    @property
    def time(self) -> float:
        """The tester's time [s]."""
        return self._desk.now * 1e-9


class Port(_Port):
    """What `run(self, port)` is given: the thread's only way to see messages and the time, and to take transitions."""

    def receive(self) -> Arrival:
        """Return what arrives next: (channel, message), or (None, transition) if the tester wants that transition."""
        while not self._desk.arrived:
            self._desk.hand_over(_Idle())
        return self._desk.arrived.popleft()

    def took(self, transition: str, *sends: Send, **messages: object) -> None:
        """Take a transition with its messages, as `parcours.study.took`; return when the tester permits the next.

        Raises ValueError: the component has no such transition, or sends more than 10 000 messages.
        """
        self._desk.take(transition, sends, messages)

    def sleep(self, seconds: float) -> None:
        """Return when this much of the tester's time has passed [s]. What arrives meanwhile waits; requests do not."""
        until = self._desk.now + round(seconds * 1e9)
        while self._desk.now < until:
            self._desk.hand_over(_Idle(until))


class AsyncPort(_Port):
    """What `async def run(self, port)` is given. Other tasks of its loop may use it, too."""

    def __init__(self, desk: _Desk) -> None:
        super().__init__(desk)
        self._waiting: deque[asyncio.Future[Arrival]] = deque()

    async def receive(self) -> Arrival:
        """Return what arrives next: (channel, message), or (None, transition) if the tester wants that transition."""
        future: asyncio.Future[Arrival] = asyncio.get_running_loop().create_future()
        self._waiting.append(future)
        return await future

    async def took(self, transition: str, *sends: Send, **messages: object) -> None:
        """Take a transition with its messages, as `parcours.study.took`; return when the tester permits the next.

        Raises ValueError: the component has no such transition, or sends more than 10 000 messages.
        """
        self._desk.take(transition, sends, messages)

    async def sleep(self, seconds: float) -> None:
        """Return when this much of the tester's time has passed [s]."""
        await asyncio.sleep(seconds)

    def _is_awaited(self) -> bool:
        self._waiting = deque(future for future in self._waiting if not future.done())
        return bool(self._waiting)

    def _deliver(self) -> bool:
        """Hand out what has arrived to those that wait. Return whether anything was."""
        before = len(self._desk.arrived)
        while self._desk.arrived and self._is_awaited():
            self._waiting.popleft().set_result(self._desk.arrived.popleft())
        return len(self._desk.arrived) < before


class _Loop(asyncio.SelectorEventLoop):
    """An event loop in the tester's time, which hands the baton over whenever nothing in it can go on."""

    def __init__(self, desk: _Desk, port: AsyncPort) -> None:
        self._desk = desk
        super().__init__(_Selector(desk, port))

    def time(self) -> float:
        """The tester's time [s]."""
        return self._desk.now * 1e-9


class _Selector(selectors.DefaultSelector):
    """Where the loop waits: with a timeout of 0 if callbacks are ready, else until its next timer (None: no timer)."""

    def __init__(self, desk: _Desk, port: AsyncPort) -> None:
        super().__init__()
        self._desk, self._port = desk, port

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        """Return what is ready on files; before, let the tester go on if the loop waits for the tester or its time."""
        if timeout is not None and timeout <= 0:
            return super().select(0)
        self._desk.require_open()
        if self._port._deliver():
            return super().select(0)
        if timeout is None and not self._port._is_awaited():
            return super().select(None)  # it waits for something outside: a thread, a socket
        self._desk.hand_over(_Idle(None if timeout is None else self._desk.now + round(timeout * 1e9)))
        self._port._deliver()
        return super().select(0)


class Threaded:
    """An object with `run(port)` as a component. `run` is started when the first transition is asked for."""

    def __init__(self, modelled: Modelled, make: Callable[[], object], patience: float) -> None:
        self.name = modelled.name
        self._transitions = frozenset(transition.id for transition in modelled.transitions())
        self._make, self._patience = make, patience
        self._thread: threading.Thread | None = None
        self.reset()

    def reset(self) -> None:
        """End the thread, and make the object again."""
        self.close()
        self._desk = _Desk(self.name, self._transitions)
        self._wake: int | None = None
        self._over = False
        self._failure: HostFailure | None = None
        self._object = self._make()

    def handle(self, channel: str | None, message: object, now: int) -> Iterator[Step]:
        """Let the object receive a message; with channel None, a request for whatever it can do."""
        return self._work((channel, message if channel is not None else None), now)

    def prompt(self, transition: str, now: int) -> Iterator[Step]:
        """Let the object receive (None, transition), if it waits to receive."""
        return self._work((None, transition), now)

    def next_wake(self) -> int | None:
        """Return the time until which the object sleeps [ns]; None if it does not."""
        return self._wake

    def wake(self, now: int) -> Iterator[Step]:
        """Let the object go on if it has slept until `now` [ns]."""
        return self._work(None, now)

    def set_inputs(self, values: Mapping[str, object]) -> None:
        """Set the model's input variables: attributes of the object of the same names."""
        for name, value in values.items():
            setattr(self._object, name, value)

    def close(self) -> None:
        """End the thread: its next or present call of the port raises. One that does not call it is left behind."""
        thread, self._thread = self._thread, None
        self._over = True
        if thread is not None:
            self._desk.closed = True
            self._desk.go.put(None)
            with contextlib.suppress(RuntimeError):  # the loop has just ended
                self._desk.nudge()
            if self._failure is None:
                thread.join(_GRACE)

    def _work(self, arrival: Arrival | None, now: int) -> Iterator[Step]:
        self._desk.now = max(self._desk.now, now)
        if arrival is not None:
            self._desk.arrived.append(arrival)
        while (step := self._step()) is not None:
            yield step
        # Messages wait until they are received; a request that nobody waits for is void.
        for request in [one for one in self._desk.arrived if one[0] is None]:
            self._desk.arrived.remove(request)

    def _step(self) -> Took | None:
        """Let the thread run up to its next call of the port."""
        if self._failure is not None:
            raise self._failure
        if self._over:
            return None
        try:
            if self._thread is None:
                self._thread = threading.Thread(target=self._run, args=(self._desk,), name=self.name, daemon=True)
                self._thread.start()
            else:
                self._desk.go.put(None)
            report = self._desk.reports.get(timeout=self._patience)
        except Empty:
            rule = f"its thread must come back to its port within {self._patience:g} s, but is at {self._where()}"
            raise self._failed(rule, "thread-silent", "wait by port.sleep and port.receive only") from None
        except BaseException as error:
            rule = f"its thread must come back to its port, but is at {self._where()} when {type(error).__name__} comes"
            failure = self._failed(f"{rule}: {error}", "thread-silent")
            if isinstance(error, Exception):  # an alarm, which does not know who is late
                raise failure from error
            raise
        self._wake = report.wake if isinstance(report, _Idle) else None
        self._over = isinstance(report, _Over)
        if isinstance(report, _Over) and report.error is not None:
            raised = report.error
            place = _place(traceback.extract_tb(raised.__traceback__))
            rule = f"its run(port) must not raise, but raised {type(raised).__name__} at {place}: {raised}"
            raise self._failed(rule, "thread-raised") from raised
        return report if isinstance(report, Took) else None

    def _failed(self, rule: str, slug: str, remedy: str = "") -> HostFailure:
        """Keep a failure, which every later step raises again."""
        self._failure = HostFailure(f"component {self.name}", rule, remedy, slug=slug)
        return self._failure

    def _run(self, desk: _Desk) -> None:
        run = self._object.run  # type: ignore[attr-defined]
        error: BaseException | None = None
        try:
            _run_loop(run, desk) if inspect.iscoroutinefunction(run) else run(Port(desk))
        except _Closed:
            pass
        except BaseException as raised:
            error = raised
        desk.reports.put(_Over(error))

    def _where(self) -> str:
        """Return the line of the component's own code where the thread is."""
        number = self._thread.ident if self._thread is not None else None
        frame = sys._current_frames().get(number) if number is not None else None
        return _place(traceback.extract_stack(frame)) if frame is not None else "no place that is known"


def _run_loop(run: Callable[[AsyncPort], object], desk: _Desk) -> None:
    port = AsyncPort(desk)
    loop = _Loop(desk, port)
    loop.set_exception_handler(lambda loop, context: None if desk.closed else loop.default_exception_handler(context))
    desk.nudge = lambda: loop.call_soon_threadsafe(lambda: None)
    try:
        loop.run_until_complete(run(port))  # type: ignore[arg-type]
    finally:
        # Cancel what the coroutine has left behind; what does not end by that is dropped.
        tasks = asyncio.all_tasks(loop)
        for task in tasks:
            task.cancel()
        with contextlib.closing(loop), contextlib.suppress(_Closed):
            if tasks:
                loop.run_until_complete(asyncio.gather(*tasks, return_exceptions=True))


def _place(frames: traceback.StackSummary) -> str:
    """Return the innermost place of code that is neither ours nor the standard library's."""
    library = str(Path(threading.__file__).parent)
    own = [
        frame
        for frame in frames
        if not frame.filename.startswith((_OURS, "<"))
        and (not frame.filename.startswith(library) or "site-packages" in frame.filename)
    ]
    return f"{Path(own[-1].filename).name}:{own[-1].lineno}, in {own[-1].name}" if own else "an await"
