"""A model -> the space that a walk moves through: where it stands, and what it may do there.

Two spaces share one form: `ModelSpace` asks the step relation of `parcours.model`, guards and messages
included; `GraphSpace` walks the bare graphs of the machines side by side and reads neither.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace

from parcours.errors import BadModel, BadRequest, one_of
from parcours.model.configuration import Configuration, Move
from parcours.model.steps import Steps
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel, Machine, Transition

REMEMBERED = 20_000
"""Most places that are kept for the next visit, or as many as a machine has states; then all are forgotten."""

Taken = tuple[tuple[int, Transition], ...]
"""The transitions of one move, the initiator first, each with the place of its machine in `Space.machines`."""


class Option:
    """One transition, or the two of a rendezvous, that can be taken; and the choices under which it can.

    Attributes:
        moves: the same transitions with one choice of inputs each, at least one.
        taken: the transitions, the initiator first.
        weight: of the initiator.
    """

    __slots__ = ("_after", "moves", "taken", "weight")

    def __init__(self, moves: tuple[Move, ...], taken: Taken) -> None:
        self.moves, self.taken = moves, taken
        self.weight = taken[0][1].weight
        self._after: list[Place | None] = [None] * len(moves)

    def after(self, space: Space, here: Place, choice: int = 0) -> Place:
        """Return the place that the move with that choice leads to.

        Raises:
            BadModel: the move breaks the model's own rules: a value leaves its domain, or cannot be computed.
        """
        found = self._after[choice]
        if found is None:
            found = self._after[choice] = space.place(space.step(here.configuration, self.moves[choice]))
        return found


class Place:
    """A configuration, and what can be done there once that was asked for."""

    __slots__ = ("configuration", "found")

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.found: tuple[Option, ...] | None = None


class Space(ABC):
    """What a walk needs to know of a model.

    Attributes:
        machines: the machines that walk, by Component.machine, in the order of `Configuration.states`.
    """

    def __init__(self, cefsm: Cefsm) -> None:
        self.machines = machines_of(cefsm)
        self._places: dict[Configuration, Place] = {}
        self._most = max([REMEMBERED, *(len(machine.states) for _, machine in self.machines)])

    @property
    @abstractmethod
    def initial(self) -> Configuration:
        """Where every walk begins."""

    @abstractmethod
    def step(self, here: Configuration, move: Move) -> Configuration:
        """Return the configuration after a move. Raises BadModel as `parcours.model.step`."""

    @abstractmethod
    def _options(self, here: Configuration) -> tuple[Option, ...]: ...

    def place(self, configuration: Configuration) -> Place:
        """Return the place of a configuration, the same one as long as it is remembered."""
        found = self._places.get(configuration)
        if found is None:
            if len(self._places) >= self._most:
                self._places.clear()
            found = self._places[configuration] = Place(configuration)
        return found

    def options(self, here: Place) -> tuple[Option, ...]:
        """Return what can be done, in the order of the model."""
        if here.found is None:
            here.found = self._options(here.configuration)
        return here.found


class ModelSpace(Space):
    """The configurations of a model and the moves of its step relation.

    >>> from parcours.model import parse_model
    >>> lamp = parse_model("{parcours: model/1, name: m, components: {A: {variables: {n: {type: int, initial: 0}}, "
    ...     "machines: {f: {initial: s, transitions: {on: {from: s, to: s, guard: n < 1, action: n := n + 1}}}}}}}")
    >>> space = ModelSpace(lamp)
    >>> here = space.place(space.initial)
    >>> [option] = space.options(here)
    >>> space.options(option.after(space, here))
    ()
    """

    def __init__(self, cefsm: Cefsm) -> None:
        super().__init__(cefsm)
        self._steps = Steps(cefsm)

    @property
    def initial(self) -> Configuration:
        """Every machine in its initial state, every queue empty."""
        return self._steps.layout.initial()

    def step(self, here: Configuration, move: Move) -> Configuration:
        """Return the configuration after a move. Raises BadModel as `parcours.model.step`, also if that refuses it."""
        try:
            return self._steps.step(here, move)
        except BadRequest as error:
            raise BadModel(error.where, error.rule, error.remedy, slug="impossible-move") from None

    def _options(self, here: Configuration) -> tuple[Option, ...]:
        groups: dict[tuple[str, str], list[Move]] = {}
        for move in self._steps.enabled(here, {}):
            groups.setdefault((move.transition, move.partner), []).append(move)
        sites = self._steps.layout.sites
        return tuple(
            Option(tuple(moves), tuple((sites[id].slot, sites[id].transition) for id in ids if id))
            for ids, moves in groups.items()
        )


class GraphSpace(Space):
    """The machines of a model as bare graphs: any transition that leaves a state can be taken."""

    def __init__(self, cefsm: Cefsm) -> None:
        super().__init__(cefsm)
        self._sites: dict[str, tuple[int, Transition]] = {}
        self._leaving: list[dict[str, list[str]]] = [{} for _ in self.machines]
        for slot, (_, machine) in enumerate(self.machines):
            for transition in machine.transitions:
                self._sites[transition.id] = slot, transition
                self._leaving[slot].setdefault(transition.source, []).append(transition.id)

    @property
    def initial(self) -> Configuration:
        """Every machine in its initial state."""
        return Configuration(tuple(machine.initial for _, machine in self.machines), (), ())

    def step(self, here: Configuration, move: Move) -> Configuration:
        """Return the configuration after a move."""
        slot, transition = self._sites[move.transition]
        return Configuration((*here.states[:slot], transition.target, *here.states[slot + 1 :]), (), ())

    def _options(self, here: Configuration) -> tuple[Option, ...]:
        pairs = zip(here.states, self._leaving, strict=True)
        ids = [id for state, leaving in pairs for id in leaving.get(state, ())]
        return tuple(Option((Move(id),), (self._sites[id],)) for id in ids)


def machines_of(cefsm: Cefsm) -> tuple[tuple[str, Machine], ...]:
    """Return every machine by Component.machine, in file order."""
    return tuple((f"{part.name}.{machine.name}", machine) for part in cefsm.components for machine in part.machines)


def part_of(cefsm: Cefsm, component: str, machine: str = "") -> Cefsm:
    """Return one component, or one machine of it, alone with the environment.

    The environment stands in at the far end of every channel. Variables that only other machines of the
    component assign keep their initial values.

    Args:
        cefsm: the model.
        component: the component that stays.
        machine: the one machine of it that stays; all, if empty.

    Raises:
        BadRequest: there is no such component or machine.
    """
    known = [each.name for each in cefsm.components]
    if component not in known:
        rule = f"must be a component of '{cefsm.name}', but is {component!r}"
        raise BadRequest("component", rule, one_of(component, known), slug="unknown-part")
    kept = cefsm.component(component)
    names = [each.name for each in kept.machines]
    if machine and machine not in names:
        rule = f"must be a machine of '{component}', but is {machine!r}"
        raise BadRequest("machine", rule, one_of(machine, names), slug="unknown-part")
    if machine:
        kept = replace(kept, machines=(kept.machines[names.index(machine)],))
    channels = [each for each in cefsm.channels if component in (each.sender, each.receiver)]
    return replace(
        cefsm,
        components=(kept,),
        channels=tuple(_alone(each, component, not machine) for each in channels),
        interactions=(),
        interaction_lines=(),
    )


def _alone(channel: Channel, component: str, is_whole: bool) -> Channel:
    if channel.sender != component:
        return replace(channel, sender=ENVIRONMENT)
    if channel.receiver != component:
        return replace(channel, receiver=ENVIRONMENT)
    # At the far end of a channel from the component to itself is a machine that may have been left out.
    return channel if is_whole else replace(channel, sender=ENVIRONMENT)
