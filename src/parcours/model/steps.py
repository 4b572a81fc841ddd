"""Computes the moves of a configuration and the configuration after each, from the tables of one model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Set

from parcours.errors import BadModel, BadRequest, one_of
from parcours.model.candidates import may_hold
from parcours.model.choice import Choices
from parcours.model.configuration import Configuration, Content, Inputs, Layout, Message, Move, TransitionSite, stored
from parcours.model.expression import evaluate
from parcours.model.scope import is_local
from parcours.model.solutions import with_terms
from parcours.model.structure import Cefsm


class StepRelation:
    """The step relation of one model with its tables, for callers that take many steps.

    Attributes:
        layout: what stands where in a configuration.
        choices: what the tester may choose.
    """

    def __init__(self, cefsm: Cefsm, opened: Set[str] = frozenset()) -> None:
        self.layout = Layout(cefsm, opened)
        self.choices = Choices(self.layout)
        self._open_names = _open_names(cefsm)

    def enabled(self, configuration: Configuration, inputs: Mapping[str, object]) -> tuple[Move, ...]:
        """Return the moves that can be taken, as the function `enabled`."""
        given: dict[str, dict[str, object]] = {}
        for name, value in inputs.items():
            owner, _, term = name.partition(".")
            if f"{owner}.{term.partition('.')[0]}" not in self._open_names:
                rule = f"an input is Component.variable of what is open, but {name!r} is not"
                raise BadRequest("inputs", rule, one_of(name, self._open_names), slug="unknown-input")
            given.setdefault(owner, {})[term] = value
        return tuple(
            move
            for site in self._at(configuration)
            if self._has_room(configuration, site)
            for move in self._moves(configuration, site, given)
        )

    def step(self, configuration: Configuration, move: Move) -> Configuration:
        """Return the configuration after a move, as the function `step`."""
        site = self._site(configuration, move.transition, move)
        event = site.transition.event
        if event is not None and event.channel in self.layout.meetings:
            raise _impossible(move, f"{move.transition!r} waits for a rendezvous")
        if not self._has_room(configuration, site):
            raise _impossible(move, f"a channel that {move.transition!r} sends on is full")
        arrived = self._arrived(configuration, site)
        if arrived is None:
            raise _impossible(move, f"{move.transition!r} has nothing to receive")
        after, met = self._fire(configuration, site, arrived, move)
        if (met is None) != (not move.partner):
            raise _impossible(move, "a rendezvous has two transitions, and only a rendezvous has")
        if met is None:
            return after
        partner = self._site(after, move.partner, move)
        if partner.transition.event is None or partner.transition.event.channel != met[0]:
            raise _impossible(move, f"{move.partner!r} does not receive {met[0]!r}")
        if partner.slot == site.slot:
            raise _impossible(move, f"{move.transition!r} and {move.partner!r} are of one machine")
        return self._fire(after, partner, met[1], move)[0]

    def _at(self, configuration: Configuration) -> Iterator[TransitionSite]:
        for state, leaving in zip(configuration.states, self.layout.leaving, strict=True):
            yield from leaving.get(state, ())

    def _site(self, configuration: Configuration, id: str, move: Move) -> TransitionSite:
        site = self.layout.sites.get(id)
        if site is None:
            raise BadRequest(f"move {move}", f"a transition must exist, but {id!r} does not", slug="unknown-transition")
        if configuration.states[site.slot] != site.transition.source:
            state = configuration.states[site.slot]
            raise _impossible(move, f"{id!r} starts in {site.transition.source!r}, but the machine is in {state!r}")
        return site

    def _arrived(self, configuration: Configuration, site: TransitionSite) -> Message | None:
        # The message a transition would take: an open one has no fields said; None if there is none.
        event = site.transition.event
        if event is None or event.channel in self.layout.supplied:
            return ()
        at = self.layout.queue.get(event.channel)
        queue = configuration.queues[at] if at is not None else ()
        return queue[0] if queue else None

    def _has_room(self, configuration: Configuration, site: TransitionSite) -> bool:
        event = site.transition.event
        for name, count in Counter(send.channel for send in site.transition.sends).items():
            at = self.layout.queue.get(name)
            if at is not None:
                taken = event is not None and event.channel == name
                if len(configuration.queues[at]) - taken + count > self.layout.capacity[name]:
                    return False
        return True

    def _moves(
        self, configuration: Configuration, site: TransitionSite, given: Mapping[str, Mapping[str, object]]
    ) -> Iterator[Move]:
        transition, meetings = site.transition, self.layout.meetings
        arrived = self._arrived(configuration, site)
        if arrived is None or (transition.event is not None and transition.event.channel in meetings):
            return
        chosen_before = given.get(site.component, {})
        if not any(send.channel in meetings for send in transition.sends):
            for chosen in self.choices.of(configuration, site, arrived, chosen_before):
                yield Move(transition.id, "", _qualified(site, chosen))
            return
        for partner in self._at(configuration):
            if partner.slot == site.slot or not self._may_meet(site, partner):
                continue
            shared: tuple[dict[str, object], ...] = ({},)
            if partner.component == site.component:
                shared = self.choices.shared(configuration, site, partner, arrived, chosen_before)
            for each in shared:
                yield from self._meetings(configuration, site, partner, arrived, _with(given, site.component, each))

    def _may_meet(self, site: TransitionSite, partner: TransitionSite) -> bool:
        event = partner.transition.event
        sent = {send.channel for send in site.transition.sends} & self.layout.meetings
        return event is not None and event.channel in sent

    def _meetings(
        self, configuration: Configuration, site: TransitionSite, partner: TransitionSite, arrived: Message,
        given: Mapping[str, Mapping[str, object]],
    ) -> Iterator[Move]:  # fmt: skip
        # Sender and receiver act in one step, but the receiver reads what the sender has just assigned:
        #
        #     sender    guard ── actions ── send ─┐
        #     receiver                            └─ guard ── actions
        for chosen in self.choices.of(configuration, site, arrived, given.get(site.component, {})):
            move = Move(site.transition.id, "", _qualified(site, chosen))
            after, met = self._fire(configuration, site, arrived, move)
            if met is None or not self._has_room(after, partner):
                continue
            for reply in self.choices.of(after, partner, met[1], given.get(partner.component, {})):
                inputs = tuple(sorted({*move.inputs, *_qualified(partner, reply)}, key=lambda pair: pair[0]))
                if site.component == partner.component and not self._is_one_choice(
                    configuration, after, site, partner, arrived, met[1], inputs
                ):
                    continue
                yield Move(site.transition.id, partner.transition.id, inputs)

    def _is_one_choice(
        self, before: Configuration, after: Configuration, site: TransitionSite, partner: TransitionSite,
        arrived: Message, met: Message, inputs: Inputs,
    ) -> bool:  # fmt: skip
        # Whether what two machines of one component chose apart is the same, and lets both guards hold.
        if len(dict(inputs)) < len(inputs):
            return False
        prefix = site.component + "."
        chosen = {name[len(prefix) :]: value for name, value in inputs}
        return all(
            each.transition.guard is None
            or may_hold(each.transition.guard, with_terms(self.choices.known(where, each, message), chosen))
            for each, where, message in ((site, before, arrived), (partner, after, met))
        )

    def _fire(
        self, configuration: Configuration, site: TransitionSite, arrived: Message, move: Move
    ) -> tuple[Configuration, tuple[str, Message] | None]:
        transition, layout, where = site.transition, self.layout, f"action of {site.transition.id!r}"
        prefix = site.component + "."
        chosen = {name[len(prefix) :]: value for name, value in move.inputs if name.startswith(prefix)}
        known = with_terms(self.choices.known(configuration, site, arrived), chosen)
        if transition.guard is not None and not may_hold(transition.guard, known):
            raise _impossible(move, f"the guard of {transition.id!r} does not hold")
        values = list(configuration.values)
        for at, expression in site.assigned:
            owner, variable = layout.variables[at]
            values[at] = known[variable.name] = stored(variable, evaluate(expression, known, where), owner)
        queues = list(configuration.queues)
        if transition.event is not None and (at_read := layout.queue.get(transition.event.channel)) is not None:
            queues[at_read] = queues[at_read][1:]
        met = None
        for send, content in zip(transition.sends, site.contents, strict=True):
            message = _message(content, known, f"message of {transition.id!r}")
            if (at_sent := layout.queue.get(send.channel)) is not None:
                queues[at_sent] = (*queues[at_sent], message)
            elif send.channel in layout.meetings:
                met = (send.channel, message)
        states = list(configuration.states)
        states[site.slot] = transition.target
        return Configuration(tuple(states), tuple(values), tuple(queues)), met


def _open_names(cefsm: Cefsm) -> list[str]:
    names = []
    for component in cefsm.components:
        names += [f"{component.name}.{each.name}" for each in component.variables if not is_local(each)]
        names += [f"{component.name}.{each.event.name}" for each in component.transitions() if each.event]
    return sorted(set(names))


def _with(
    given: Mapping[str, Mapping[str, object]], component: str, chosen: Mapping[str, object]
) -> Mapping[str, Mapping[str, object]]:
    return {**given, component: {**given.get(component, {}), **chosen}} if chosen else given


def _qualified(site: TransitionSite, chosen: tuple[tuple[str, object], ...]) -> Inputs:
    return tuple((f"{site.component}.{term}", value) for term, value in chosen)


def _message(content: Content, known: Mapping[str, object], where: str) -> Message:
    said = []
    for name, expression in content.fields:
        try:
            said.append((name, evaluate(expression, known, where)))
        except BadModel as error:
            # A field of a message that is not computed stays open; any other fault is the model's.
            if error.slug != "no-value":
                raise
    return tuple(said)


def _impossible(move: Move, rule: str) -> BadRequest:
    remedy = "take one of the moves that enabled() returns"
    return BadRequest(f"move {move}", f"it must be possible here, but {rule}", remedy, slug="impossible-move")
