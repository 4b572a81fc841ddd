"""The state space of a model, found step by step as a walk or a search comes along.

`ModelSpace` asks the step relation of `parcours.model`, guards and messages included; `GraphSpace` walks the bare
graphs of the machines side by side and reads neither.
"""

from __future__ import annotations

from dataclasses import replace

from parcours.errors import BadModel, BadRequest, one_of
from parcours.model.configuration import Configuration, Move
from parcours.model.steps import StepRelation
from parcours.model.structure import ENVIRONMENT, Cefsm, Channel, Machine, Transition

REMEMBERED = 20_000
"""Most places that are kept for the next visit, or as many as a machine has states; then all are dropped."""

Taken = tuple[tuple[int, Transition], ...]
"""The transitions of one move, the initiator first, each with the place of its machine in `ModelSpace.machines`."""


class Option:
    """One transition, or the two of a rendezvous, that can be taken; and the choices under which it can.

    Attributes:
        moves: the same transitions with one choice of inputs each, at least one.
        taken: the transitions, the initiator first.
    """

    __slots__ = ("_after", "moves", "taken")

    def __init__(self, moves: tuple[Move, ...], taken: Taken) -> None:
        self.moves, self.taken = moves, taken
        self._after: list[SpaceNode | None] = [None] * len(moves)

    @property
    def weight(self) -> float:
        """The weight of the initiator."""
        return self.taken[0][1].weight

    def after(self, space: ModelSpace, here: SpaceNode, choice: int = 0) -> SpaceNode:
        """Return the place that the move with that choice leads to.

        Raises BadModel: the move breaks the model's own rules: a value leaves its domain, or cannot be computed.
        """
        found = self._after[choice]
        if found is None:
            found = self._after[choice] = space.place(space.step(here.configuration, self.moves[choice]))
        return found


class SpaceNode:
    """A configuration, and what can be done there once that was asked for."""

    __slots__ = ("configuration", "found")

    def __init__(self, configuration: Configuration) -> None:
        self.configuration = configuration
        self.found: tuple[Option, ...] | None = None


class ModelSpace:
    """The configurations of a model and the moves of its step relation.

    Args:
        cefsm: a model without errors.
        remembered: most places that are kept; by default `REMEMBERED`.

    Attributes:
        machines: the machines that move, by Component.machine, in the order of `Configuration.states`.
        initial: every machine in its initial state, every queue empty.
    """

    def __init__(self, cefsm: Cefsm, remembered: int = 0) -> None:
        self.machines = _machines(cefsm)
        self.steps = StepRelation(cefsm)
        self.initial = self.steps.layout.initial()
        self._places: dict[Configuration, SpaceNode] = {}
        self._most = max([remembered or REMEMBERED, *(len(machine.states) for _, machine in self.machines)])

    def step(self, here: Configuration, move: Move) -> Configuration:
        """Return the configuration after a move. Raises BadModel as `parcours.model.step`, also if that refuses it."""
        try:
            return self.steps.step(here, move)
        except BadRequest as error:
            raise BadModel(error.where, error.rule, error.remedy, slug="impossible-move") from None

    def place(self, configuration: Configuration) -> SpaceNode:
        """Return the place of a configuration, the same one as long as it is remembered."""
        found = self._places.get(configuration)
        if found is None:
            if len(self._places) >= self._most:
                self._places.clear()
            found = self._places[configuration] = SpaceNode(configuration)
        return found

    def options(self, here: SpaceNode) -> tuple[Option, ...]:
        """Return what can be done, in the order of the model. Raises BadModel if a guard cannot be computed."""
        if here.found is None:
            groups: dict[tuple[str, str], list[Move]] = {}
            for move in self.steps.enabled(here.configuration, {}):
                groups.setdefault((move.transition, move.partner), []).append(move)
            sites = self.steps.layout.sites
            here.found = tuple(
                Option(tuple(moves), tuple((sites[id].slot, sites[id].transition) for id in ids if id))
                for ids, moves in groups.items()
            )
        return here.found


class GraphSpace(ModelSpace):
    """The machines of a model as bare graphs: any transition that leaves a state can be taken."""

    def __init__(self, cefsm: Cefsm) -> None:
        parts = (replace(each, machines=tuple(map(_bare, each.machines)), variables=()) for each in cefsm.components)
        super().__init__(replace(cefsm, components=tuple(parts)))
        self.machines = _machines(cefsm)


def _machines(cefsm: Cefsm) -> tuple[tuple[str, Machine], ...]:
    return tuple((f"{part.name}.{machine.name}", machine) for part in cefsm.components for machine in part.machines)


def _bare(machine: Machine) -> Machine:
    # Nothing but states and arrows: no guard, message, variable or clock is left to ask.
    arrows = (Transition(each.id, each.source, each.target, weight=each.weight) for each in machine.transitions)
    return replace(machine, transitions=tuple(arrows), invariants=())


def part_of(cefsm: Cefsm, component: str, machine: str = "") -> Cefsm:
    """Return one component, or one machine of it, alone with the environment.

    The environment stands in at the far end of every channel. Variables that only other machines of the
    component assign keep their initial values.

    Args:
        component: the component that stays.
        machine: the one machine of it that stays; all, if empty.

    Raises BadRequest: there is no such component or machine.
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
    channels = (each for each in cefsm.channels if component in (each.sender, each.receiver))
    return replace(
        cefsm, components=(kept,), channels=tuple(_alone(each, component, not machine) for each in channels),
        interactions=(), interaction_lines=(),
    )  # fmt: skip


def _alone(channel: Channel, component: str, is_whole: bool) -> Channel:
    if channel.sender != component:
        return replace(channel, sender=ENVIRONMENT)
    if channel.receiver != component:
        return replace(channel, receiver=ENVIRONMENT)
    # At the far end of a channel from the component to itself is a machine that may have been left out.
    return channel if is_whole else replace(channel, sender=ENVIRONMENT)
