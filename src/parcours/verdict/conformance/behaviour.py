"""The step relation of one component on its own: its states, transitions, and messages to and from the others.

The rest of the system is replaced by one stub that may send anything at any time and keeps all it is sent:

    +-----------+   reads: inbox    +--------------+
    | component | <---------------- |  the others  |     what the component does depends on
    |           | ----------------> |    (stub)    |     its own state and its inbox alone
    +-----------+   sends: due      +--------------+
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

from parcours.errors import BadModel, BadRequest, one_of
from parcours.model.configuration import Configuration, Message
from parcours.model.steps import StepRelation
from parcours.model.structure import BASE_TYPES, Cefsm, Component, Machine, Receive, Transition

_OTHERS = "the others"
_ROOM = 1 << 20  # capacity of the stub's channels: it never makes the component wait
_REMEMBERED = 200_000  # results of steps that are kept
_MORE: Message = (("more", ...),)
"""The last item of a full inbox: any number of further messages, of unknown content."""

Inbox = tuple[tuple[Message, ...], ...]
After = tuple[tuple[str, ...], tuple[object, ...], tuple[tuple[str, Message], ...]]
"""What a transition leads to: states, values, and what it has to send."""


@dataclass(frozen=True, slots=True)
class Allowance:
    """What a component may do beyond its model; by default nothing.

    Args:
        unmodelled: channels on which it may send without taking a transition.
        conversations: whether an answer belongs to the latest request only. On a service (two channels of one topic in
            opposite directions) a new request then discards answers that were not taken up, and the answer to an
            unmodelled request triggers no transition. Otherwise every message waits until a transition takes it up.
    """

    unmodelled: frozenset[str] = frozenset()
    conversations: bool = False


class State(NamedTuple):
    """A state that one component may be in."""

    states: tuple[str, ...]  # of each machine; '' of one that does not run
    values: tuple[object, ...]  # of its variables
    inbox: Inbox  # for each channel it reads: received, not yet taken up
    due: tuple[tuple[str, Message], ...] = ()  # what the transition under way has yet to send, in order
    foreign: frozenset[str] = frozenset()  # channels whose next answer belongs to an unmodelled request


class Behaviour:
    """The step relation of one component while the others may do anything.

    Args:
        cefsm: a model without errors.
        component: its name.
        allowance: what it may do beyond the model.
        unread: how many unread messages of a channel are told apart; with more, `_MORE` stands for the rest.

    Raises:
        BadRequest: an unmodelled channel is not in the model.
    """

    def __init__(self, cefsm: Cefsm, component: str, allowance: Allowance, unread: int) -> None:
        self.name, self.allowance, self._unread = component, allowance, unread
        own = cefsm.component(component)
        names = [channel.name for channel in cefsm.channels]
        for name in sorted(allowance.unmodelled - set(names)):
            rule = f"only a channel can be let pass, but {name!r} is not one"
            raise BadRequest("unmodelled", rule, one_of(name, names), slug="unknown-channel")
        self._steps = StepRelation(_alone(cefsm, own))
        self.reads = tuple(dict.fromkeys(each.event.channel for each in own.transitions() if each.event))
        self.sends = frozenset(channel.name for channel in cefsm.channels if channel.sender == component)
        self.transitions = {each.id: each for each in own.transitions()}
        self._at = {name: at for at, name in enumerate(self.reads)}
        self._slots = {id: self._steps.layout.sites[id].slot for id in self.transitions}
        layout = self._steps.layout
        self._queues = {name: at for name, at in layout.queue.items() if name in self._at or name in self.sends}
        self._answers = _answers(cefsm, component) if allowance.conversations else {}
        self._local: dict[object, tuple[After, ...]] = {}
        self._doubts: dict[object, str] = {}
        self._fields = {
            channel.name: frozenset(
                field.name for field in message.fields if field.type in BASE_TYPES and not field.shape
            )
            for channel in cefsm.channels
            for message in cefsm.messages
            if message.name == channel.message
        }

    def initial(self, *, apart: bool = False) -> tuple[State, ...]:
        """Return the initial states: all machines running, and if they may run `apart`, each of them running alone."""
        begin = self._steps.layout.initial()
        *own, stub = begin.states
        alone = [[name if at == slot else "" for at, name in enumerate(own)] for slot in range(len(own))]
        empty: Inbox = ((),) * len(self.reads)
        each = [list(own), *alone] if apart and len(own) > 1 else [own]
        return tuple(State((*states, stub), begin.values, empty) for states in each)

    def content(self, channel: str, fields: dict[str, object]) -> Message:
        """Return the observed fields of a message that guards can read, as the model's steps want them."""
        known = self._fields.get(channel, frozenset())
        seen = (each for each in fields.items() if each[0] in known and isinstance(each[1], bool | int | float | str))
        return tuple(sorted(seen))

    def take(self, state: State, id: str) -> Iterator[State]:
        """Yield the states after the transition `id`; none if it cannot be taken."""
        transition = self.transitions.get(id)
        if transition is None or state.due or state.states[self._slots[id]] != transition.source:
            return
        if transition.event is None:
            heads: list[tuple[Message | None, tuple[Message, ...]]] = [(None, ())]
        else:
            heads = list(_heads(state.inbox[self._at[transition.event.channel]]))
        for message, rest in heads:
            inbox = state.inbox
            if transition.event is not None:
                inbox = _with(inbox, self._at[transition.event.channel], rest)
            for states, values, due in self._after(state, transition, message):
                after = State(states, values, inbox, due, state.foreign)
                for channel, _ in due:
                    after = self._asked(after, channel, is_foreign=False)
                yield after

    def runs(self, state: State, id: str) -> bool:
        """Return whether the machine of the transition `id` runs."""
        return state.states[self._slots[id]] != ""

    def taken(self, state: State) -> Iterator[tuple[str, State]]:
        """Yield the transitions that can be taken, each with a state after it."""
        for id in self.transitions:
            for after in self.take(state, id):
                yield id, after

    def doubt(self, state: State, id: str) -> str:
        """Return why `take` may have left out states after the transition: open values that were not all tried."""
        transition = self.transitions.get(id)
        if transition is None or not self._doubts:
            return ""
        messages: list[Message] = [()]
        if transition.event is not None:
            messages = [message for message, _ in _heads(state.inbox[self._at[transition.event.channel]])]
        found = (self._doubts.get((id, self._read(state.values, id), message)) for message in messages)
        return next((why for why in found if why), "")

    def _read(self, values: tuple[object, ...], id: str) -> tuple[object, ...]:
        return tuple(values[at] for _, at in self._steps.layout.sites[id].reads)

    def awaits(self, state: State) -> Iterator[str]:
        """Yield the channels from which a message would let it go on, where none is there yet."""
        for id, transition in self.transitions.items():
            if transition.event is not None and state.states[self._slots[id]] == transition.source:
                channel = transition.event.channel
                if not state.inbox[self._at[channel]]:
                    yield channel

    def receive(self, state: State, channel: str, content: Message) -> State:
        """Return the state after a message was received; one that no transition reads changes nothing."""
        at = self._at.get(channel)
        if channel in state.foreign:
            return state._replace(foreign=state.foreign - {channel})
        if at is None:
            return state
        waiting = state.inbox[at]
        if len(waiting) >= self._unread:
            return state._replace(inbox=_with(state.inbox, at, (*((),) * self._unread, _MORE)))
        return state._replace(inbox=_with(state.inbox, at, (*waiting, content)))

    def send(self, state: State, channel: str) -> State | None:
        """Return the state after a due message was sent; None if it is not the next one due."""
        if not state.due or state.due[0][0] != channel:
            return None
        return state._replace(due=state.due[1:])

    def send_unmodelled(self, state: State, channel: str) -> State | None:
        """Return the state after a message outside the model was sent; None if that is not allowed."""
        if state.due or channel not in self.allowance.unmodelled or channel not in self.sends:
            return None
        return self._asked(state, channel, is_foreign=True)

    def _asked(self, state: State, channel: str, *, is_foreign: bool) -> State:
        answer = self._answers.get(channel)
        if answer is None:
            return state
        foreign = state.foreign | {answer} if is_foreign else state.foreign - {answer}
        return state._replace(inbox=_with(state.inbox, self._at[answer], ()), foreign=foreign)

    def _after(self, state: State, transition: Transition, message: Message | None) -> tuple[After, ...]:
        key = state.states, state.values, transition.id, message
        if key not in self._local:
            if len(self._local) >= _REMEMBERED:
                self._local.clear()
                self._doubts.clear()
            self._local[key] = tuple(dict.fromkeys(self._computed(state, transition, message)))
        return self._local[key]

    def _computed(self, state: State, transition: Transition, message: Message | None) -> Iterator[After]:
        queues: list[tuple[Message, ...]] = [()] * len(self._steps.layout.channels)
        if transition.event is not None and message is not None:
            queues[self._queues[transition.event.channel]] = (message,)
        here = Configuration(state.states, state.values, tuple(queues))
        # What is in doubt depends on what a choice reads, never on what was asked before.
        doubts = self._steps.choices.doubts
        doubts.clear()
        moves = self._steps.enabled(here, {})
        for id, why in doubts.items():
            event = self.transitions[id].event
            arrived = queues[self._queues[event.channel]] if event is not None else ()
            self._doubts[id, self._read(state.values, id), arrived[0] if arrived else ()] = why
        for move in moves:
            if move.transition != transition.id:
                continue
            try:
                after = self._steps.step(here, move)
            except BadModel as error:
                if error.slug != "out-of-range":  # a step that would leave a domain cannot be taken
                    raise
                continue
            # The stub's queues were empty, so what is in them now is what the transition sent, in its order.
            left = [list(queue) for queue in after.queues]
            due = tuple((send.channel, left[self._queues[send.channel]].pop(0)) for send in transition.sends)
            yield after.states, after.values, due


def _with(inbox: Inbox, at: int, waiting: tuple[Message, ...]) -> Inbox:
    return (*inbox[:at], waiting, *inbox[at + 1 :])


def _heads(waiting: tuple[Message, ...]) -> Iterator[tuple[Message, tuple[Message, ...]]]:
    # Yields the message that is read next and the rest of the queue. After _MORE the queue may be as long as before
    # or one shorter: both are states that the component may be in.
    if not waiting:
        return
    if waiting[-1] == _MORE:
        yield waiting[0], waiting
        yield waiting[0], waiting[:-1]
    else:
        yield waiting[0], waiting[1:]


def _answers(cefsm: Cefsm, component: str) -> dict[str, str]:
    # Request channel of a service -> the channel of its answers.
    read = {each.event.channel for each in cefsm.component(component).transitions() if each.event}
    return {
        asked.name: answer.name
        for asked in cefsm.channels
        for answer in cefsm.channels
        if asked.topic
        and asked.topic == answer.topic
        and asked.sender == component
        and (answer.sender, answer.receiver) == (asked.receiver, component)
        and answer.name in read
    }


def _alone(cefsm: Cefsm, component: Component) -> Cefsm:
    """Return the model of one component: every other end of its channels is a stub that keeps all it is sent."""
    own = {each.event.channel for each in component.transitions() if each.event}
    sent = {send.channel for each in component.transitions() for send in each.sends}
    channels = tuple(
        replace(
            channel,
            sender=component.name if channel.sender == component.name else _OTHERS,
            receiver=component.name if channel.receiver == component.name else _OTHERS,
            capacity=_ROOM,
        )
        for channel in cefsm.channels
        if channel.name in own | sent
    )
    readers = tuple(
        Transition(f"{_OTHERS} read {channel.name}", "never", "never", Receive(channel.name))
        for channel in channels
        if channel.receiver == _OTHERS
    )
    stub = Machine(_OTHERS, "idle", ("idle", "never"), readers)
    return replace(cefsm, components=(component, Component(_OTHERS, (stub,))), channels=channels, interactions=())
