"""Makes the components of a system under test: from Python classes, functions, threads or programs."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Protocol

from parcours.errors import HostFailure
from parcours.model.structure import Component as Modelled
from parcours.run.port import Component
from parcours.study.components.simple import Functions, component_of, is_full
from parcours.study.loading import load
from parcours.study.parameters import Settings
from parcours.suite import Case

# So long a program, thread or coroutine may take for one transition [s of wall clock] before it counts as hung
PATIENCE = 5.0


class System(Protocol):
    """The system under test of a component study: what makes its components."""

    def component(self, modelled: Modelled, case: Case, settings: Settings) -> Component:
        """Return a fresh component for a case. Raises HostFailure: it cannot be had."""


@dataclass(frozen=True, slots=True)
class PythonPart:
    """A class, or a function that makes objects: `file.py:Name`, `module:Name`, or itself.

    A maker is given those of its parameters that are called `case`, or as a parameter of the study or a test input.
    """

    target: str | Callable[..., object]
    folder: Path = field(default_factory=Path.cwd)

    def made(self) -> Callable[..., object]:
        """Return the class or function. Raises BadRequest if there is none."""
        found = load(self.target, self.folder) if isinstance(self.target, str) else self.target
        if not callable(found):
            raise HostFailure(str(self.target), f"must be a class or a function, but is {type(found).__name__}",
                              slug="component-form")  # fmt: skip
        return found

    def component(self, modelled: Modelled, case: Case, settings: Settings, patience: float) -> Component:
        """Return a component of the class: as it is, by its methods, or, if it has `run(port)`, in a thread."""
        make, given = self.made(), arguments(self.made(), case, settings)
        run = getattr(make, "run", None)
        if run is not None and not is_full(make):
            from parcours.study.components.threads import Threaded

            return Threaded(modelled, lambda: make(**given), patience)
        return component_of(modelled, lambda: make(**given))


@dataclass(frozen=True, slots=True)
class FunctionsPart:
    """Functions of (state, message), by the event that each handles: a channel, or a transition no message starts."""

    targets: Mapping[str, str | Callable[..., object]]
    folder: Path = field(default_factory=Path.cwd)

    def component(self, modelled: Modelled, case: Case, settings: Settings, patience: float) -> Component:
        """Return a component whose methods are the functions; its state is empty at first."""
        functions = {
            event: load(target, self.folder) if isinstance(target, str) else target
            for event, target in self.targets.items()
        }
        return component_of(modelled, lambda: Functions(functions))  # type: ignore[arg-type]


@dataclass(frozen=True, slots=True)
class ProgramPart:
    """A program, in any language, that speaks our protocol (docs/programs.md) on standard streams or a socket."""

    command: tuple[str, ...]
    folder: Path = field(default_factory=Path.cwd)
    environment: Mapping[str, str] = field(default_factory=dict)
    socket: bool = False

    def component(self, modelled: Modelled, case: Case, settings: Settings, patience: float) -> Component:
        """Return the component that the program is; the process is started, or one that is idle is used again."""
        from parcours.study.components.program import ProgramComponent

        return ProgramComponent(modelled, self, settings, case.id, case.seed, patience)


Part = PythonPart | FunctionsPart | ProgramPart


@dataclass(frozen=True, slots=True)
class Parts:
    """A system under test made of a part for each component."""

    parts: Mapping[str, Part]
    patience: float = PATIENCE

    def component(self, modelled: Modelled, case: Case, settings: Settings) -> Component:
        """Return a fresh component for a case. Raises HostFailure: no part stands for it, or its maker raised."""
        part = self.parts.get(modelled.name)
        if part is None:
            raise HostFailure(f"component {modelled.name}", "nothing stands for it", "name it under `system`",
                              slug="component-unknown")  # fmt: skip
        return part.component(modelled, case, settings, self.patience)


def python_system(*, patience: float = PATIENCE, **makers: str | Callable[..., object]) -> Parts:
    """Return a system of Python components: a class, or `file.py:Name`, for each component of the model.

    Args:
        patience: longest turn of a component [s of wall clock].
        makers: by the component's name.

    >>> sorted(python_system(Button=object, Lamp="lamp.py:Lamp").parts)
    ['Button', 'Lamp']
    """
    return Parts({name: PythonPart(maker) for name, maker in makers.items()}, patience)


def arguments(make: Callable[..., object], case: Case, settings: Mapping[str, object]) -> dict[str, object]:
    """Return what a maker is given: those of its parameters that have the name of something known."""
    try:
        wanted = inspect.signature(make).parameters.values()
    except (TypeError, ValueError):
        return {}
    known: dict[str, object] = {**settings, "case": case}
    return {
        one.name: known[one.name]
        for one in wanted
        if one.name in known and one.kind in (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    }
