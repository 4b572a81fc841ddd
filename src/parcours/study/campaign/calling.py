"""Calls a simulation, a Python function or a program, for the facts of a case; or says why there are none."""

from __future__ import annotations

import inspect
import multiprocessing
import random
import signal
import sys
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Self

import msgspec
import numpy as np

from parcours.errors import BadRequest, HostFailure, one_of
from parcours.kernels import is_compiled
from parcours.run import heartbeat as heartbeat
from parcours.run.exception_text import Overdue, without_addresses
from parcours.streams import starts
from parcours.study.campaign.results import Trace
from parcours.study.campaign.rules import Fact, Fault
from parcours.study.components.process import ComponentProcess, begun, command_of, keep, quoted, take_kept
from parcours.study.components.systems import ProgramPart
from parcours.study.loading import SourceFile, file_of, load
from parcours.study.parameters import Scalar, Settings
from parcours.suite import Case

if TYPE_CHECKING:
    from parcours.study.campaign.study import CampaignStudy

Function = Callable[..., object]
Target = str | Function  # `file.py:name`, `package.module:name`, or the function itself
LOADING = 60.0  # so long a file may take to load [s], or six times the patience if that is longer
_PURPOSE = 0x73696D756C617465  # of the random stream from which simulations get their seeds (ASCII for `simulate`)
HUNG = "hung: no facts within {:g} s"
_MOST_ROWS = 100_000


class Alarm:
    """Says to the parent which case this process is at, and raises Overdue in one that takes too long.

    Where no signal reaches the code, the parent ends the process (`parcours.run.heartbeat`). Looks are counted, not
    seconds, so that a process that is stopped (Ctrl-Z) does not count as hung.
    """

    _LOOKS = 4

    def __init__(self) -> None:
        self._works = threading.current_thread() is threading.main_thread() and hasattr(signal, "setitimer")
        self._left, self._before = 0, None if not self._works else signal.getsignal(signal.SIGALRM)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.off()
        if self._works:
            signal.signal(signal.SIGALRM, self._before)

    def set(self, number: float, limit: float, *, rings: bool = True) -> None:
        """Expect the end of a case within `limit` [s]; unless it `rings`, the parent alone does."""
        self._left = self._LOOKS
        heartbeat.enter(number, limit)
        if self._works and rings:
            signal.signal(signal.SIGALRM, self._look)  # whatever the last case has made of it
            signal.setitimer(signal.ITIMER_REAL, limit / self._LOOKS, limit / self._LOOKS)

    def off(self) -> None:
        """Expect nothing."""
        self._left = 0
        heartbeat.leave()
        if self._works:
            signal.setitimer(signal.ITIMER_REAL, 0.0)

    def _look(self, number: int, frame: object) -> None:
        if self._left:
            self._left -= 1
            if not self._left:
                self._left = 1  # code that catches this is interrupted again
                raise Overdue


class Faulty(Exception):
    """A case has no facts: which fault, and its reason."""

    def __init__(self, fault: Fault, why: str) -> None:
        super().__init__(why)
        self.fault = fault


class PythonCaller:
    """A Python function that is given what its parameters ask for."""

    def __init__(
        self, study: CampaignStudy, target: Target, what: str, settings: Settings, seed: int, alarm: Alarm,
        source: SourceFile | None = None,
    ) -> None:  # fmt: skip
        self._study, self._settings, self._seed = study, settings, seed
        is_compiled()  # what draws cases is loaded before code that could stand in its way
        if isinstance(target, str):
            alarm.set(heartbeat.NO_CASE, max(LOADING, 6.0 * study.patience))
            found = load(target, study.folder, source)
            alarm.off()
            path = file_of(target, study.folder)
            if path is not None and multiprocessing.parent_process() is not None:
                sys.path.append(str(path.resolve().parent))  # for what its functions import when they are called
        else:
            found = target
        if not callable(found):
            raise BadRequest(str(target), f"must be a function, but is {type(found).__name__}", slug="simulate-form")
        self._function = found
        self.file = getattr(getattr(found, "__code__", None), "co_filename", "")
        known = ("case", "seed", "rng", *study.inputs.names, *(one.name for one in study.own))
        self._wanted, unknown = wanted(found, known)
        if unknown:
            rule = f"{what} is given {', '.join(known)}, by name, but asks for {', '.join(unknown)}"
            raise BadRequest(str(target), rule, one_of(unknown[0], known), slug="simulate-arguments")

    def __call__(self, case: Case) -> object:
        """Return what the function gives for a case. Draws from `random` and `numpy.random` depend on the case only."""
        seed = seed_of(self._seed, case.number)
        random.seed(seed)
        np.random.seed(seed % 2**32)  # noqa: NPY002
        known: dict[str, object] = {"case": case, "seed": seed, **self._study.known(case.values, self._settings)}
        if "rng" in self._wanted:
            known["rng"] = np.random.default_rng([self._seed, case.number])
        return self._function(**{name: known[name] for name in self._wanted})


class ProgramCaller:
    """A program that answers `{"case": {...}}` with `{"facts": {...}}`, one line each, as long as it lives."""

    file = ""

    def __init__(self, study: CampaignStudy, part: ProgramPart, settings: Settings) -> None:
        self._study, self._part, self._settings = study, part, settings
        self._key = ("simulate", part.command, part.folder, tuple(sorted(part.environment.items())), part.socket)
        self._command = command_of(part, study.name)

    def __call__(self, case: Case) -> object:
        """Return the facts that the program answers; it is started again if it has ended in good order."""
        content = {
            "id": case.id, "number": case.number, "seed": seed_of(case.seed, case.number),
            "values": self._study.natural(case.values),
            "parameters": {one.name: self._settings.get(one.name, one.default) for one in self._study.own},
        }  # fmt: skip

        def started() -> ComponentProcess:
            return ComponentProcess(self._command, self._part, self._study.name, self._study.patience)

        try:
            return begun(take_kept(self._key), started, lambda process, is_new: self._answer(process, content))
        except HostFailure as error:
            if error.slug == "program-missing":
                raise
            faults = {"program-silent": (Fault.HUNG, "hung"), "program-ended": (Fault.DIED, "died")}
            fault, what = faults.get(error.slug, (Fault.BAD_FACTS, "bad facts"))
            raise Faulty(fault, f"{what}: {error.rule}") from error

    def _answer(self, process: ComponentProcess, content: Mapping[str, object]) -> object:
        process.forget_words()
        with process.exchange("case", content):
            line = process.line()
            process.require_silence()
            try:
                given = msgspec.json.decode(line)
            except (msgspec.DecodeError, UnicodeDecodeError, RecursionError):
                given = None
            if not isinstance(given, dict) or set(given) != {"facts"}:
                why = f'bad facts: must answer with {{"facts": {{...}}}} in one line, but printed {quoted(line)}'
                raise Faulty(Fault.BAD_FACTS, why)
        keep(self._key, process)
        return given["facts"]


def wanted(function: Function, known: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return which known names a function takes, and which others it cannot do without.

    >>> wanted(lambda case, delay, steps=3, *more, **others: None, ("case", "seed", "delay"))
    (('case', 'delay'), ())
    """
    try:
        parameters = inspect.signature(function).parameters.values()
    except (TypeError, ValueError):
        return ("case",), ()
    variadic = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    plain = [one for one in parameters if one.kind not in variadic]
    taken = [one for one in plain if one.name in known and one.kind is not inspect.Parameter.POSITIONAL_ONLY]
    lacking = [one.name for one in plain if one not in taken and one.default is inspect.Parameter.empty]
    return tuple(one.name for one in taken), tuple(lacking)


def seed_of(campaign_seed: int, number: int) -> int:
    """Return the seed of a case: a number below 2**53, which every language reads from JSON as it is.

    >>> seed_of(1, 0) != seed_of(1, 1) != seed_of(2, 0)
    True
    """
    return int(starts(campaign_seed, np.array([number]), _PURPOSE)[0]) >> 11


def facts_in(facts: Sequence[Fact], answer: object) -> tuple[Scalar, ...]:
    """Return the facts that an answer gives, in their order. Raises Faulty if one is missing, or not of its type."""
    if not isinstance(answer, Mapping):
        raise Faulty(Fault.BAD_FACTS, f"bad facts: must be a mapping from names to values, but are {_kind(answer)}")
    found: list[Scalar] = []
    for fact in facts:
        if fact.name not in answer:
            raise Faulty(Fault.BAD_FACTS, f"bad facts: {fact.name} is missing")
        given = answer[fact.name]
        value = given.item() if isinstance(given, np.generic | np.ndarray) and given.ndim == 0 else given
        number = isinstance(value, int | float) and not isinstance(value, bool)
        if fact.kind == "bool" and isinstance(value, bool):
            found.append(value)
        elif fact.kind == "int" and number and value == value // 1 and abs(value) < 2**63:
            found.append(int(value))
        elif fact.kind == "real" and number and abs(value) <= sys.float_info.max:
            found.append(float(value))
        else:
            due = {"bool": "true or false", "int": "a whole number of 64 bits", "real": "a finite number"}[fact.kind]
            shown = f"{value!r:.40}" if isinstance(value, int | float | str | None) else _kind(value)
            raise Faulty(Fault.BAD_FACTS, f"bad facts: {fact.name} must be {due}, but is {shown}")
    return tuple(found)


def _kind(value: object) -> str:
    return "None" if value is None else f"of type {type(value).__name__}"


def lost_reason(case: heartbeat.LostCase, patience: float) -> tuple[Fault, str]:
    """Return why a case was lost whose process hung or died."""
    if case.how == "hung":
        return Fault.HUNG, HUNG.format(patience)
    return Fault.DIED, case.detail if case.how == "tampered" else f"died: its process {case.detail}"


def shown(value: object) -> str:
    """Return a value as a reader of a reason or a table sees it."""
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def rows_of(given: object) -> Trace:
    """Return a trace as names and rows of plain values. Raises TypeError, ValueError or KeyError if it is not one."""
    if isinstance(given, tuple) and len(given) == 2 and all(isinstance(name, str) for name in given[0]):
        names, rows = tuple(given[0]), list(given[1])
    else:
        listed = list(given)  # type: ignore[call-overload]
        names = tuple(listed[0]) if listed else ()
        rows = [[row[name] for name in names] for row in listed]
    plain = [tuple(_plain(value) for value in row) for row in rows[:_MOST_ROWS]]
    if any(len(row) != len(names) for row in plain):
        raise ValueError("every row of a trace must have a value for each name")
    return names, tuple(plain)


def _plain(value: object) -> Scalar:
    value = value.item() if isinstance(value, np.generic) else value
    return value if isinstance(value, bool | int | float) else without_addresses(str(value))[:80]
