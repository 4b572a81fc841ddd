"""The one decorator for compiled inner loops, and the rule for where their machine code is kept.

Numba's disk cache looks only at the file a kernel stands in: it misses an edit in another file whose kernel was
inlined, and a change of compiler flags. So the cache lives in a folder named by a hash of every kernel source and of
the library versions; an edit anywhere starts a fresh folder, and stale machine code can never run. Folders of other
versions are removed then, once nobody has used them for a week.

Without numba, kernels run as plain Python: the same results, slowly. It is loaded when a kernel is first called, since
it takes as long to load as many a command.

Compiled code freezes what is global. A few words of memory are read when it runs instead (`chosen`, `spend`): they
choose among the mutants that one build holds (`parcours.study.mutation`), end loops that do not, and note what is run.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import os
import re
import shutil
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from parcours.errors import BadRequest

F = TypeVar("F", bound=Callable[..., object])

Record = Any
"""A numpy record (or array of records) of a dtype that the kernel's docstring names; numba reads its fields by name."""

_PACKAGE = Path(__file__).parent
_FOLDER = "kernels-"
_UNUSED = 7 * 24 * 3600
"""A folder of machine code that nobody has used for this time [s] is removed."""

_LOADING = threading.Lock()
_loaded: list[Any] = []  # the module that compiles kernels, or None, once that is known
_kept_in = ""  # the folder for the machine code of kernels that are defined now; that of `kernel_cache` if empty


def is_compiled() -> bool:
    """Return whether kernels are compiled on this machine: numba is there."""
    return _compiler() is not None


def _compiler() -> Any:
    """Return the module that compiles kernels, loaded when it is first needed; None without numba."""
    if not _loaded:
        with _LOADING:
            if not _loaded:
                _loaded.append(_load())
    return _loaded[0]


def _load() -> Any:
    try:
        import numba
    except ImportError:
        return None
    from parcours import kernel_compiler

    _use(kernel_cache())
    numba.config.CACHE_DIR = str(kernel_cache())
    _share_words()
    return kernel_compiler


@functools.cache
def kernel_cache() -> Path:
    """Return the folder that holds the machine code of exactly these sources and libraries; nothing without numba.

    It lies under PARCOURS_CACHE_DIR if that is set, else under XDG_CACHE_HOME or ~/.cache.
    """
    digest = hashlib.sha256()
    for library in ("numba", "llvmlite", "numpy"):
        with contextlib.suppress(PackageNotFoundError):
            digest.update(version(library).encode() + b"\0")
    for package in sorted(_PACKAGE.parent.glob(f"{_PACKAGE.name}*/")):  # those that came with this one
        for folder, folders, names in os.walk(package):
            folders.sort()
            for name in sorted(name for name in names if name.endswith(".py")):
                with open(f"{folder}/{name}", "rb", buffering=0) as source:  # noqa: PTH123 - every start waits for it
                    text = source.read()
                if b"kernel" in text or b"dtype" in text:
                    digest.update(text + b"\0")
    home = os.environ.get("PARCOURS_CACHE_DIR")
    base = Path(home) if home else Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "parcours"
    return base / f"{_FOLDER}{digest.hexdigest()[:16]}"


def _use(folder: Path) -> None:
    """Note that a folder is used now; if it is a new one, remove those beside it that nobody uses any more."""
    with contextlib.suppress(OSError):  # a folder that cannot be written to may still be read
        is_new = not folder.exists()
        folder.mkdir(parents=True, exist_ok=True)
        os.utime(folder)
        for other in folder.parent.glob(f"{_FOLDER}{'[0-9a-f]' * 16}") if is_new else ():
            if time.time() - other.stat().st_mtime > _UNUSED:
                # A process that still runs that version compiles again what it misses.
                shutil.rmtree(other, ignore_errors=True)


def kernel(function: F) -> F:
    """Compile `function` on first call: IEEE arithmetic only, no reassociation, cached on disk, no heap.

    The same inputs give the same bits on every machine: fastmath is off, and kernels take sin, cos, exp and the like
    from `elementary`, not from the machine's mathematics library. Arrays are borrowed from the caller: a kernel can
    make none ("NRT required", says the compiler) and return none but its arguments. So nothing counts who holds them,
    which took a tenth of a case's time. No kernel catches an exception.
    """
    return _compiled(function, heap=False)


def heap_kernel(function: F) -> F:
    """Compile a kernel that makes arrays, or returns a view; a `kernel` may call it, but must not be given one made."""
    return _compiled(function, heap=True)


def _compiled(function: F, heap: bool) -> F:
    options: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "nogil": True, "_nrt": heap}
    options["no_cfunc_wrapper"] = True  # nobody takes a kernel's address, and that wrapper is a tenth of compilation
    return cast(F, Kernel(function, options))


class Kernel:
    """A kernel as Python calls it; what compiles it is made when it is needed: of hundreds, a command calls ten.

    Args:
        function: the source.
        options: those of `numba.njit`.
    """

    def __init__(self, function: Callable[..., object], options: dict[str, Any]) -> None:
        functools.update_wrapper(self, function)
        self.py_func, self._options, self._folder = function, {**options, "nopython": True}, _kept_in

    def __call__(self, *arguments: object, **named: object) -> object:
        """Run the machine code."""
        return self._outer(*arguments, **named)

    def __reduce__(self) -> str | tuple[Any, ...]:
        name: str = self.py_func.__qualname__
        return (Kernel, (self.py_func, self._options)) if "<locals>" in name else name

    @functools.cached_property
    def _outer(self) -> Callable[..., object]:
        compiler = _compiler()
        if compiler is None:
            return _plain(self.py_func)
        found: Callable[..., object] = compiler.outer(self.py_func, self._options, self._folder, lambda: self._inner)
        return found

    @functools.cached_property
    def _inner(self) -> Any:
        return _compiler().inner(self.py_func, self._options, self._folder)

    @property
    def _numba_type_(self) -> Any:  # by which the compiler knows what it is, in kernels that call it
        return _compiler().types.Dispatcher(self._inner)


def _plain(function: F) -> F:
    """Return the function with the arithmetic of compiled code: words wrap, and x / 0 is infinite."""

    @functools.wraps(function)
    def run(*arguments: object) -> object:
        # Floats of Python would raise where IEEE 754 has a value.
        given = (np.float64(each) if type(each) is float else each for each in arguments)
        with np.errstate(all="ignore"):
            return _own(function(*given))

    return cast(F, run)


def _own(result: object) -> object:
    """Return Python's own numbers in place of those of numpy, as compiled code does; words of 64 bits stay."""
    if isinstance(result, tuple) and type(result) is tuple:
        return tuple(map(_own, result))
    return result.item() if isinstance(result, np.generic) and not isinstance(result, np.uint64) else result


def require_numba(what: str) -> None:
    """Raise BadRequest unless kernels are compiled: for what plain Python cannot do, or not in time."""
    if not is_compiled():
        raise BadRequest(what, "it needs numba, which is not installed", "pip install numba", slug="no-numba")


def is_warm() -> bool:
    """Return whether an earlier run has compiled these very sources, or there is no numba to compile them."""
    folder = kernel_cache()
    return not is_compiled() or (folder.is_dir() and any(folder.rglob("*.nbc")))


def tell_of_compiling(tell: Callable[[], None]) -> None:
    """Call a function once, when this process first compiles anything: an earlier run may have compiled a part only."""
    if not is_compiled():
        return
    from numba.core import event

    awaited = {os.getpid()}  # a process that is forked off tells nothing

    class Listener(event.Listener):  # type: ignore[misc]
        def on_start(self, _: object) -> None:
            if os.getpid() in awaited:
                awaited.clear()
                tell()

        def on_end(self, _: object) -> None:
            """Only the start is reported."""

    event.register("numba:compile", Listener())


class Spent(Exception):
    """A loop went round more often than it was allowed to."""


PLACES = 4096  # Functions that are told apart
_CHOSEN, _LEFT, _FIRST = 0, 1, 2
_words = np.zeros(_FIRST + PLACES, np.int64)
_words[_LEFT] = 2**62


def chosen(place: int) -> int:
    """Return the number of the mutant that runs, 0 for none, and note that this place is reached; in kernels, too."""
    _words[_FIRST + place] = 1
    return int(_words[_CHOSEN])


def places_run() -> frozenset[int]:
    """Return the places of the functions that were run since a mutant was chosen."""
    return frozenset(np.flatnonzero(_words[_FIRST:]).tolist())


def choose(number: int, rounds: int = 2**62) -> None:
    """Let a mutant run from now on (0: none), whose loops may go round so often in all."""
    _words[_CHOSEN], _words[_LEFT] = number, rounds
    _words[_FIRST:] = 0


@contextlib.contextmanager
def suspended() -> Iterator[None]:
    """Let the original run for a while, as long as it likes."""
    number, left = _words[_CHOSEN], _words[_LEFT]
    _words[_CHOSEN], _words[_LEFT] = 0, 2**62
    try:
        yield
    finally:
        _words[_CHOSEN], _words[_LEFT] = number, left


def rounds_left() -> int:
    """Return how often loops may still go round; negative once one was ended."""
    return int(_words[_LEFT])


def spend() -> bool:
    """Count one round of a loop, in kernels, too. Raises Spent if none was left."""
    _words[_LEFT] -= 1
    if _words[_LEFT] < 0:
        raise Spent("its loops go round and round")
    return True


def keep_kernels_in(folder: Path) -> None:
    """Keep the machine code of kernels that are defined from now on in a folder of their own."""
    global _kept_in
    _kept_in = str(folder)


def refused_lines(error: BaseException) -> list[tuple[str, int]]:
    """Return the places that the compiler complains of, (file, line), innermost first; none if it did not complain."""
    numba = sys.modules.get("numba")
    if numba is None or not isinstance(error, numba.core.errors.NumbaError):
        return []
    found = re.findall(r'File "([^"]+)", line (\d+)', str(error))
    return [(os.path.abspath(file), int(line)) for file, line in found]  # noqa: PTH100 - as written, links unresolved


def _share_words() -> None:
    """Let kernels reach the words by a symbol, which is resolved when machine code is loaded, from disk also."""
    import llvmlite.binding
    import numba.extending
    from llvmlite import ir

    symbol = "parcours_words"
    llvmlite.binding.add_symbol(symbol, _words.ctypes.data)
    int64, word = numba.types.int64, ir.IntType(64)

    def at(builder: Any, k: Any) -> Any:
        words = builder.module.globals.get(symbol)
        if words is None:
            words = ir.GlobalVariable(builder.module, ir.ArrayType(word, len(_words)), symbol)
            words.linkage = "external"
        return builder.gep(words, [ir.Constant(word, 0), k])

    @numba.extending.intrinsic  # type: ignore[untyped-decorator]
    def load(context: Any, where: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = builder.add(arguments[0], ir.Constant(word, _FIRST))
            builder.store(ir.Constant(word, 1), at(builder, place))
            return builder.load(at(builder, ir.Constant(word, _CHOSEN)))

        return int64(int64), code

    @numba.extending.intrinsic  # type: ignore[untyped-decorator]
    def count(context: Any) -> Any:
        def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            place = at(builder, ir.Constant(word, _LEFT))
            left = builder.sub(builder.load(place), ir.Constant(word, 1))
            builder.store(left, place)
            return left

        return int64(), code

    def spending() -> bool:
        if count() < 0:
            raise Spent("its loops go round and round")
        return True

    numba.extending.overload(chosen)(lambda place: lambda place: load(place))
    numba.extending.overload(spend)(lambda: spending)
