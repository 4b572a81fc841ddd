"""Finds planners by name: those that ship with Parcours or are added by packages, and any by module or file."""

from __future__ import annotations

import contextlib
import functools
import importlib
import importlib.util
import inspect
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Protocol, cast

from parcours.errors import BadRequest, one_of
from parcours.kernels import is_compiled
from parcours.run.exception_text import is_ctrl_c, said
from parcours.run.heartbeat import write_place
from parcours.study.loading import SourceFile, read_source
from parcours_navigation.guests.batch import BATCH_SIZE, LARGEST, Alone, BatchPlugin
from parcours_navigation.protocol import SENSES, Answer, Observation, Task
from parcours_navigation.requirements.requirement import NO_REQUIREMENTS, Requirements

if TYPE_CHECKING:
    from parcours_navigation.cases.running import CaseStudy, Family
    from parcours_navigation.guests.scenario import Scenario

SHIPPED = {
    "orca": "parcours_navigation.planners.orca:Orca",
    "dwa": "parcours_navigation.planners.dwa:Dwa",
    "mppi": "parcours_navigation.planners.mppi:Mppi",
    "mpc": "parcours_navigation.planners.mpc:Mpc",
    "teb": "parcours_navigation.planners.teb:Teb",
    "a-star": "parcours_navigation.planners.a_star:AStar",
    "stand-still": "parcours_navigation.planners.baselines:StandStill",
    "straight-ahead": "parcours_navigation.planners.baselines:StraightAhead",
}
"""Planners that ship with Parcours and are run as anybody's are."""

STACKS = "parcours_navigation.foreign.stack"
"""What makes planners of the bindings of navigation stacks."""

GROUP = "parcours.planners"
"""Entry points by which packages add planners: a planner's class, or an `OwnLoop`."""

_process_id = os.getpid  # that of this file, whatever a planner makes of the function

_REMEDY = "name a planner that ships with Parcours, package.module:Name, path/to/file.py:Name, or a binding's file"

Observe = Callable[[Observation], Answer]
PlannerLike = str | type | Observe | object
"""A name, a class that is constructed without arguments, a plain function, or an object with `observe`."""


class OwnLoop(Protocol):
    """A planner that is simulated by a loop of its own instead of being asked once a period."""

    def study_of(self, cases: Family, scenario: Scenario, requirements: Requirements = NO_REQUIREMENTS) -> CaseStudy:
        """Return the study that runs it. Raises BadRequest if the scenario is not one that its loop can run."""


@functools.cache
def names() -> tuple[str, ...]:
    """Return the names of planners: those that ship with this package first, then those that packages add."""
    added = sorted(entry.name for entry in entry_points(group=GROUP) if entry.name not in SHIPPED)
    return (*SHIPPED, *added)


def own_loop(planner: object) -> OwnLoop | None:
    """Return the loop that simulates a planner, None if it has none and is asked once a period."""
    if not isinstance(planner, str) or planner in SHIPPED or planner not in names():
        return None
    (entry,) = entry_points(group=GROUP, name=planner)
    if not entry.value.startswith("parcours_"):
        from parcours_navigation.guests.planner_process import has_own_loop

        if not has_own_loop(planner):
            return None
    found = loaded(planner)
    return cast(OwnLoop, found) if hasattr(found, "study_of") else None


def loaded(planner: str) -> object:
    """Return what the entry point of a planner names, imported into this process."""
    (entry,) = entry_points(group=GROUP, name=planner)
    return entry.load()


@dataclass(frozen=True, slots=True)
class Plugin:
    """A planner that is ready to be asked."""

    name: str  # as it was given
    observe: Observe  # called with every observation
    reset: Callable[[Task], object] | None  # called before each case; None if the planner has none
    file: str  # the file it is defined in, "" if unknown; faults are placed there
    needs: tuple[str, ...] = ()  # what it must be given, some of `protocol.SENSES`
    batch: BatchPlugin | None = None  # what it has for batches of cases


def source_of(planner: str) -> SourceFile | None:
    """Return the source in which a planner is defined; None if it ships with Parcours or is no Python file.

    Imports what its module lies in. Raises BadRequest if the name is no planner's, or its module or file is missing.
    """
    if planner in names():
        return None
    if is_stack(planner):
        return cast(SourceFile, importlib.import_module(STACKS).source_of_stack(planner))
    where, _ = _parts(planner)
    if _is_file(where):
        return _read(planner, Path(where))
    file = _file_of(planner, where)
    return _read(planner, file) if file is not None and file.suffix == ".py" else None


def _read(planner: str, path: Path) -> SourceFile:
    try:
        return read_source(f"planner {planner!r}", path)
    except BadRequest as error:
        raise BadRequest(error.where, error.rule, _REMEDY, slug="planner-missing") from error


def located(planner: PlannerLike) -> PlannerLike:
    """Return a planner with the whole path of its file, if it is named by one; else the same planner.

    >>> located("orca"), located("/somewhere/mine.py:Mine")
    ('orca', '/somewhere/mine.py:Mine')
    """
    if not isinstance(planner, str) or planner in names():
        return planner
    if is_stack(planner):
        return str(Path(planner).absolute())
    where, attribute = _parts(planner)
    return f"{Path(where).absolute()}:{attribute}" if _is_file(where) else planner


def load_planner(planner: PlannerLike, source: SourceFile | None = None) -> Plugin:
    """Return a planner that is ready to be asked. The current folder is importable.

    Args:
        planner: a known name (but none with a loop of its own), "package.module:Name", "path/to/file.py:Name", the
            binding of a navigation stack, or the class, function or object itself. What it prints while it is loaded
            goes to standard error.
        source: what its file held when it was first read; by default it is read now.

    Raises:
        BadRequest: the name leads nowhere, the constructor raised, or there is neither `observe` nor a function.

    >>> load_planner("stand-still").name
    'stand-still'
    >>> load_planner(lambda observation: (0.0, 0.0)).reset is None
    True
    """
    is_compiled()  # what worlds need is loaded before code that could stand in its way
    if isinstance(planner, str) and is_stack(planner):
        write_place("its binding")
        return _ready(planner, importlib.import_module(STACKS).StackPlanner(planner))
    if isinstance(planner, str):
        where, attribute = _parts(planner)
        write_place("the import of its module")
        with contextlib.redirect_stdout(sys.stderr):
            return _ready(planner, _attribute(planner, _module(planner, where, source), attribute))
    name = getattr(planner, "__qualname__", type(planner).__qualname__)
    return _ready(name, planner)


def _parts(planner: str) -> tuple[str, str]:
    """Return the module or file of a name, and what to look for in it."""
    place = SHIPPED.get(planner, planner)
    if planner in names() and planner not in SHIPPED:
        (entry,) = entry_points(group=GROUP, name=planner)
        place = entry.value
    where, colon, attribute = place.rpartition(":")
    if own_loop(planner) is not None:
        rule = "it runs in a loop of its own, and has no observe"
        raise BadRequest(f"planner {planner!r}", rule, "parcours run and compare know how", slug="planner-own-loop")
    if not colon or not where or not attribute:
        rule = "must be a known name, or say what to take from where after a colon"
        raise BadRequest(f"planner {planner!r}", rule, f"{_REMEDY}; {one_of(planner, names())}", slug="planner-unknown")
    return where, attribute


def is_stack(planner: str) -> bool:
    """Return whether a planner's name is that of the binding of a navigation stack.

    >>> is_stack("robot.yaml"), is_stack("orca")
    (True, False)
    """
    return planner.endswith((".yaml", ".yml"))


def _is_file(where: str) -> bool:
    return where.endswith(".py") or os.sep in where


def _unknown(planner: str, rule: str) -> BadRequest:
    return BadRequest(f"planner {planner!r}", rule, _REMEDY, slug="planner-missing")


def _file_of(planner: str, module: str) -> Path | None:
    """Return the file of a module, without importing the module itself."""
    here = str(Path.cwd())
    if here not in sys.path and "" not in sys.path:  # the current folder is importable, as it is for `python -m`
        sys.path.insert(0, here)
    try:
        spec = importlib.util.find_spec(module)
    except (ImportError, ValueError, AttributeError) as error:
        raise _unknown(planner, f"its module must be importable, but: {error}") from error
    if spec is None:
        raise _unknown(planner, f"its module must be importable, but there is no {module!r}")
    return Path(spec.origin) if spec.has_location and spec.origin else None


def module_name(source: SourceFile) -> str:
    """Return the name of the module that a planner's file becomes."""
    return f"parcours_planner_{source.digest}"


def _module(planner: str, where: str, source: SourceFile | None) -> ModuleType:
    """Import the module or file."""
    if not _is_file(where):
        if source is None or where in sys.modules:
            _file_of(planner, where)
            return cast(ModuleType, _guarded(planner, "its module", lambda: importlib.import_module(where)))
        known = source
        return cast(ModuleType, _guarded(planner, "its module", lambda: _import_from(known, where)))
    read = source or _read(planner, Path(where))
    folder = str(read.path.resolve().parent)
    sys.path.insert(0, folder)  # its neighbours are importable, as they are for `python file.py`
    try:
        return cast(ModuleType, _guarded(planner, "its file", lambda: read.module(module_name(read))))
    finally:
        with contextlib.suppress(ValueError):
            sys.path.remove(folder)


def _import_from(source: SourceFile, where: str) -> ModuleType:
    """Import a module from its source as it was, also if its file has changed since; its packages as they are."""
    package, _, name = where.rpartition(".")
    inside = importlib.import_module(package) if package else None
    module = source.module(where)
    if inside is not None:
        setattr(inside, name, module)
    return module


def _attribute(planner: str, module: ModuleType, dotted: str) -> object:
    found: object = module
    for part in dotted.split("."):
        try:
            found = getattr(found, part)
        except AttributeError as error:
            public = [name for name in vars(module) if not name.startswith("_")]
            rule = f"{dotted!r} must be defined there, but is not"
            raise BadRequest(f"planner {planner!r}", rule, one_of(dotted, public), slug="planner-missing") from error
    return found


def _ready(name: str, found: object) -> Plugin:
    """Return the planner that a class, function or object makes."""
    file = ""
    with contextlib.suppress(TypeError, OSError):
        file = inspect.getfile(found if inspect.isclass(found) or inspect.isfunction(found) else type(found))
    if inspect.isclass(found):
        write_place("its constructor")
        made = found
        found = _guarded(name, "its constructor, which is given nothing,", lambda: made())
    batch = batch_of(name, found)
    asked = asked_alone(found, batch)
    reset = getattr(asked, "reset", None)
    observe = getattr(asked, "observe", None)
    if observe is None and callable(found):
        observe = found
    _require_one_argument(name, found, observe, "observe(observation)")
    if reset is not None:
        _require_one_argument(name, found, reset, "reset(task)")
    needs = getattr(found, "needs", ())
    if not isinstance(needs, tuple | list | set | frozenset) or any(one not in SENSES for one in needs):
        rule = f"its `needs` are some of {', '.join(SENSES)}, but are {needs!r:.100}"
        raise BadRequest(f"planner {name!r}", rule, "see docs/planners.md", slug="planner-form")
    told = tuple(one for one in SENSES if one in needs)
    if told and isinstance(asked, Alone):
        rule, remedy = (
            f"a batch has no scan, map or path, but it needs {', '.join(told)}",
            "give it observe(observation)",
        )
        raise BadRequest(f"planner {name!r}", rule, remedy, slug="planner-form")
    return Plugin(name, cast(Observe, observe), cast("Callable[[Task], object] | None", reset), file, told, batch)


def asked_alone(found: object, batch: BatchPlugin | None) -> object:
    """Return what is asked for one case at a time: the planner, or its batches of one case or of their fixed size."""
    return found if batch is None or (hasattr(found, "observe") and not batch.fixed) else Alone(batch)


def batch_of(name: str, found: object) -> BatchPlugin | None:
    """Return what a planner has for batches, None if it takes none. Raises BadRequest if that is not in form."""
    observe, reset = getattr(found, "observe_batch", None), getattr(found, "reset_batch", None)
    if observe is None:
        return None
    _require_one_argument(name, found, observe, "observe_batch(observations)")
    if reset is not None:
        _require_one_argument(name, found, reset, "reset_batch(tasks)")
    size = getattr(found, "batch_size", BATCH_SIZE)
    if type(size) is not int or not 1 <= size <= LARGEST:
        rule = f"its `batch_size` is a whole number from 1 to {LARGEST}, but is {size!r:.100}"
        raise BadRequest(f"planner {name!r}", rule, "see docs/planners.md", slug="planner-form")
    return BatchPlugin(observe, reset, size, bool(getattr(found, "batch_is_fixed", False)))


def _require_one_argument(name: str, found: object, method: object, what: str) -> None:
    """Raise BadRequest unless the method can be called with one argument."""
    rule = f"must be a function of an observation, or have {what}, but is a {type(found).__name__} without"
    if callable(method):
        try:
            inspect.signature(method).bind(None)
            return
        except ValueError:
            return  # compiled code without a signature: the first call will tell
        except TypeError as error:
            rule = f"{what} must take exactly one argument, but: {error}"
    raise BadRequest(f"planner {name!r}", rule, "see docs/planners.md", slug="planner-form")


def end_if_forked(pid: int) -> None:
    """End this process silently if it is not the one of that id, but a child that a planner forked."""
    if _process_id() != pid:
        os._exit(0)


def _guarded(planner: str, what: str, act: Callable[[], object]) -> object:
    """Do something of the planner's own; what it raises becomes one line."""
    pid = _process_id()
    try:
        return act()
    except BaseException as error:
        end_if_forked(pid)
        if is_ctrl_c(error):
            raise
        rule = f"{what} must not raise, but raised {said(error)}"
        raise BadRequest(f"planner {planner!r}", rule, "run it alone to see where", slug="planner-raised") from error
    finally:
        end_if_forked(pid)
