"""Notices in a worker what strangers' code has changed that others rely on: their functions, descriptors, limits.

The code runs in the same interpreter as ours, so it can replace `numpy.zeros` or close the line to the parent. What was
changed and can be put back is put back after each case: the current folder, signal handlers, limits. Some functions are
looked at after each case, all of Python's library, NumPy and ours after a piece of them. A worker in which anything was
changed ends itself with the status TAMPERED and says what it was; the case is lost, the others are computed in another
worker. What is done to a function of ours in place, and another program in the place of this one, is noticed before it
happens. What replaces a function on purpose so that it cannot be noticed is beyond this.
"""

from __future__ import annotations

import builtins
import contextlib
import ctypes
import gc
import importlib
import os
import signal
import sys
import threading
from builtins import BaseException, KeyError, OSError, all, map, next, type, zip  # noqa: UP029 -- they may be removed
from collections.abc import Callable, Iterator, Mapping, Sequence
from operator import is_, itemgetter
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from parcours.run.heartbeat import write_place

resource: Any = importlib.import_module("resource") if os.name == "posix" else None

TAMPERED = 113
"""Status with which a worker ends itself."""

CHANGED = "changed its process: "
"""How the words begin in which it says why."""

_FAILS = "what others rely on fails there"
_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGALRM)
_LIMITS = ("RLIMIT_NOFILE", "RLIMIT_CPU", "RLIMIT_AS", "RLIMIT_FSIZE", "RLIMIT_STACK")
_EVERY_CASE = (
    (vars(np), ("zeros", "array", "asarray", "ascontiguousarray", "hypot", "isfinite", "sqrt", "arange")),
    (vars(builtins), ("len", "isinstance", "getattr", "float", "int", "range", "zip", "type", "open", "__import__")),
    (vars(os), ("_exit", "write", "getpid", "fstat")),
    (vars(signal), ("signal", "setitimer")),
)

_TINY, _SMALL = sys.float_info.min, 1e-17

_CONSTANTS = (bool, int, float, str, tuple, np.ndarray, np.generic, np.dtype)

Hook = Callable[[str, tuple[Any, ...]], None]
Held = tuple[str, Mapping[str, Any], Callable[[Any], tuple[Any, ...]], tuple[str, ...], tuple[Any, ...], int]
"""Where names lie, in words; the mapping; what gets them; the names; what they were; how many there are, 0 for any."""


class Canaries:
    """What a process looks like before strangers' code runs in it, and after that was loaded."""

    # References instead of names, so that what is replaced is not used to find that it was replaced.
    def __init__(self, descriptors: Sequence[int]) -> None:
        self._often = [_held(mapping["__name__"], mapping, names) for mapping, names in _EVERY_CASE]
        self._all = [*self._often, *_functions(ours=True)]
        self._modules, self._numpy = sys.modules, np
        self._descriptors = [(number, _identity(number)) for number in descriptors]
        self._collect = gc.collect
        self._stray = False
        gc.freeze()  # what came from the parent is never looked through, nor counted: a collection takes no time then
        self._settle()

    def accept(self) -> str:
        """Return what of ours the code has changed while it was loaded, in words; else take the rest as it is."""
        changed = self._look(self._all)
        if not changed:
            self._settle()
            self._all = [*self._often, *_functions(ours=True), *_functions(ours=False)]
        return changed

    def _settle(self) -> None:
        self._path = str(Path.cwd())
        self._mask = os.umask(0o22)
        os.umask(self._mask)
        self._handlers = [(number, signal.getsignal(number)) for number in _SIGNALS]
        self._blocked = signal.pthread_sigmask(signal.SIG_BLOCK, ())
        self._limits = [(name, resource.getrlimit(getattr(resource, name))) for name in _LIMITS]
        self._recursion, self._errors = sys.getrecursionlimit(), np.geterr()
        self._collects = gc.isenabled()
        self._threads = threading.active_count()
        if not _rounds():
            _reset_rounding()
        gc.collect()

    def after_case(self, *, failed: bool) -> str:
        """Put back what can be, and return what else was changed, in words; "" if nothing was.

        A case that has failed while threads of earlier ones were left may have failed for them.
        """
        changed = self._found(self._often)
        if failed and self._stray:
            return changed or "threads of an earlier case went on"
        self._stray = threading.active_count() > self._threads
        return changed

    def changed(self) -> str:
        """Return what was changed, by a longer look, in words; "" if nothing was."""
        return self._found(self._all)

    def _found(self, held: Sequence[Held]) -> str:
        # Garbage of this case is collected now: its `__del__` is the case's, too.
        try:
            self._collect(0)
            return self._look(held) or self._put_back()
        except BaseException as error:
            return f"{_FAILS}: {type(error).__name__}"

    def _put_back(self) -> str:
        try:
            moved = str(Path.cwd()) != self._path
        except OSError:  # it is gone
            moved = True
        if moved:
            with contextlib.suppress(OSError):
                os.chdir(self._path)
        if os.umask(self._mask) != self._mask:
            os.umask(self._mask)
        for number, handler in self._handlers:
            if signal.getsignal(number) is not handler:
                signal.signal(number, handler)
        if signal.pthread_sigmask(signal.SIG_BLOCK, ()) != self._blocked:
            signal.pthread_sigmask(signal.SIG_SETMASK, self._blocked)
        if sys.getrecursionlimit() != self._recursion:
            sys.setrecursionlimit(self._recursion)
        if sys.gettrace() is not None or sys.getprofile() is not None:
            sys.settrace(None)
            sys.setprofile(None)
        if gc.isenabled() is not self._collects:
            (gc.enable if self._collects else gc.disable)()
        if np.geterr() != self._errors:
            np.seterr(**self._errors)
        for name, (soft, hard) in self._limits:
            number = getattr(resource, name)
            if resource.getrlimit(number) != (soft, hard):
                try:
                    resource.setrlimit(number, (soft, hard))
                except (OSError, ValueError):
                    return f"{name} was lowered for good"
        return ""

    def _look(self, held: Sequence[Held], all: Any = all, next: Callable[..., str] = next, same: Any = is_) -> str:
        for where, mapping, get, names, before, size in held:
            try:
                now = get(mapping)
            except KeyError as error:
                return f"{where}.{error.args[0]} was removed"
            if not all(map(same, now, before)):
                return next(f"{where}.{name} was replaced" for name, a, b in zip(names, now, before) if a is not b)  # noqa: B905
            if size and mapping.__len__() != size:
                return f"{where} was added to"
        if sys.modules is not self._modules or self._modules.get("numpy") is not self._numpy:
            return "sys.modules was emptied"
        for number, identity in self._descriptors:
            if _identity(number) != identity:
                return "descriptors that it did not open were closed, replaced or changed"
        if not _rounds():
            return "how the processor rounds was changed"
        return ""


def _held(where: str, mapping: Mapping[str, Any], names: Sequence[str], size: int = 0) -> Held:
    present = tuple(name for name in names if name in mapping)
    present = present * 2 if len(present) == 1 else present  # of one name alone it would not get a tuple
    get = itemgetter(*present)
    return where, mapping, get, present, get(mapping), size


def _functions(*, ours: bool) -> Iterator[Held]:
    """Yield what is looked at in the end: all of ours, or the functions of Python's library and NumPy."""
    for name, module in list(sys.modules.items()):
        package = name.partition(".")[0]
        if type(module) is not ModuleType or package.startswith("parcours_planner_"):
            continue
        if not (package.startswith("parcours") if ours else package == "numpy" or package in sys.stdlib_module_names):
            continue
        here = vars(module)
        names = [
            one for one, value in here.items() if callable(value) or isinstance(value, _CONSTANTS if ours else float)
        ]
        names = [one for one in names if one != "_"]  # what was printed last
        yield from [_held(name, here, names)] if names else []
        for one in names:
            kind = here[one]
            if isinstance(kind, type) and kind.__module__ == name:
                if ours:
                    kind.__annotations__  # noqa: B018 -- is there from now on
                inner = [key for key, value in vars(kind).items() if ours or callable(value)]
                yield from [_held(f"{name}.{one}", vars(kind), inner, len(vars(kind)) if ours else 0)] if inner else []


def _identity(descriptor: int) -> tuple[int, int, bool] | None:
    try:
        found = os.fstat(descriptor)
        return found.st_dev, found.st_ino, os.get_blocking(descriptor)
    except OSError:
        return None


def _rounds() -> bool:
    """Return whether the processor rounds to nearest, and knows numbers near zero."""
    return _TINY * 0.5 > 0.0 and 1.0 + _SMALL == 1.0 and 1.0 - _SMALL == 1.0


def _reset_rounding() -> None:
    """Let the processor round as it does in a new process: libraries that were compiled for speed change it."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).fesetenv(ctypes.c_void_p(-1))


def end_if(
    cause: str, say: Callable[[str], None] = write_place, exit: Callable[[int], None] = os._exit, how: str = CHANGED
) -> None:
    """End this process as one that was changed, for a cause in words; go on if that is empty."""
    if cause:
        try:
            say(how + cause)
        finally:
            exit(TAMPERED)


_placed: Canaries | None = globals().get("_placed")  # strangers' code may load this module a second time


def place(descriptors: Sequence[int]) -> None:
    """Remember how this process looks, which is a worker of strangers' code that has not run yet."""
    global _placed
    _placed = Canaries(descriptors)
    sys.addaudithook(_hook(os.getpid()))


def _hook(pid: int, end_if: Callable[[str], None] = end_if) -> Hook:
    """Return what is called before a function of ours is changed in place, or this process becomes another program.

    Python's library changes its own functions in place while it is imported (`types.coroutine`).
    """

    def hook(event: str, given: tuple[Any, ...], process_id: Callable[[], int] = os.getpid) -> None:
        if event == "object.__setattr__" and type(given[0]) in (FunctionType, ModuleType):
            one = given[0]
            where = str((one.__globals__ if type(one) is FunctionType else vars(one)).get("__name__"))
            if where.startswith("parcours") and not where.startswith("parcours_planner_"):
                what = f"{where}.{one.__qualname__}" if type(one) is FunctionType else where
                end_if(f"{given[1]} of {what} was replaced")
        elif event == "os.exec" and process_id() == pid:
            end_if("it replaced itself by another program")

    return hook


def accept() -> None:
    """End this process if the strangers' code has changed it while it was loaded; else let its settings stand."""
    if _placed is not None:
        end_if(_placed.accept())


def after_case(*, failed: bool = False, by: str = "") -> None:
    """Put back what a case has changed, or what was done in it `by` someone; end this process if that cannot be."""
    if _placed is not None and (cause := _placed.after_case(failed=failed)):
        end_if(f"{by}: {cause}" if by else cause)


def require_unchanged(end_if: Callable[[str], None] = end_if) -> None:
    """End this process if anything was changed in it, by the longer look, or where an error of ours passes by."""
    if _placed is not None:
        failing = sys.exc_info()[0]
        end_if(_placed.changed() or (f"{_FAILS}: {failing.__name__}" if failing is not None else ""))
