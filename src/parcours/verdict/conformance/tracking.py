"""Tracks the set of states that one component may be in: each observation filters and advances the set.

    observed:      take p22              send reply(3)
    {a, b, c}  ----------------> {d, e} ---------------> {e}       no state left: the observation is a deviation

This is the subset construction of automata theory, done lazily: a set that a trace reaches becomes a node, an
observation an edge between nodes, and both are kept. An observation seen before from the same set is one look-up.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from typing import Literal, NamedTuple

from parcours.model.configuration import Message
from parcours.model.structure import Cefsm
from parcours.verdict.conformance.behaviour import Allowance, Behaviour, State
from parcours.verdict.conformance.findings import Expectation

Observes = Literal["transitions", "messages"]

UNREAD: dict[Observes, int] = {"transitions": 64, "messages": 8}
"""Unread messages of one channel that are counted: few, where each may or may not have been taken up unseen."""

_KEPT = 50_000  # edges of a node, nodes of a tracker: a long run must not fill the memory
_OPEN: tuple[Message, ...] = ((),)


class Successor(NamedTuple):
    """Where an observation leads."""

    node: StateSet | None  # None: the model does not allow the observation
    contents: tuple[Message, ...]  # of a message sent: what it may hold
    doubt: str  # why there may be more states than those of the node; empty if there are not


class StateSet:
    """A set of states, and what has been found out about it so far."""

    __slots__ = ("doubt", "edges", "expected", "owed", "states")

    def __init__(self, states: frozenset[State], doubt: str) -> None:
        self.states = states
        self.doubt = doubt  # why unseen steps may lead to more states than these; empty if they cannot
        self.edges: dict[object, Successor] = {}  # by observation
        self.owed: dict[str, bool] = {}  # by channel
        self.expected: tuple[Expectation, ...] | None = None

    def keep(self, key: object, edge: Successor) -> Successor:
        """Remember where an observation leads, and return it."""
        if len(self.edges) >= _KEPT:
            self.edges.clear()
        self.edges[key] = edge
        return edge


class Tracker:
    """The automaton of one component, as far as traces have led into it.

    Args:
        behaviour: the steps of the component.
        observes: whether transitions are observed, or only messages; then every step that sends and receives nothing
            is taken silently, and a set is closed under such steps.
        hidden: most states that closing a set may add. Beyond it the set is incomplete, and a deviation is in doubt.
        apart: whether one machine of the component may run alone.
    """

    def __init__(self, behaviour: Behaviour, observes: Observes, hidden: int, *, apart: bool = False) -> None:
        self.behaviour, self.observes, self._hidden = behaviour, observes, hidden
        self._nodes: dict[frozenset[State], StateSet] = {}
        self._debts: dict[tuple[State, str], bool] = {}
        begin = self._node(behaviour.initial(apart=apart))
        assert begin is not None
        self.begin: StateSet = begin

    def take(self, node: StateSet, id: str) -> Successor:
        """Return what follows when the transition was taken."""
        edge = node.edges.get(id)
        if edge is None:
            after = self._node(after for state in node.states for after in self.behaviour.take(state, id))
            doubts = (self.behaviour.doubt(state, id) for state in node.states)
            edge = node.keep(id, _edge(after, _OPEN, next((why for why in doubts if why), "")))
        return edge

    def send(self, node: StateSet, channel: str, observed: Message = ()) -> Successor:
        """Return what follows when a message was sent, with the fields observed, or none."""
        key = ("!", channel, observed)
        edge = node.edges.get(key)
        if edge is None:
            after: list[State] = []
            contents: dict[Message, None] = {}
            for state in node.states:
                sent = self.behaviour.send(state, channel)
                if sent is not None and _agree(state.due[0][1], observed):
                    after.append(sent)
                    contents[observed or state.due[0][1]] = None
                free = self.behaviour.send_unmodelled(state, channel)
                if free is not None:
                    after.append(free)
                    contents[observed] = None
            edge = node.keep(key, _edge(self._node(after), tuple(contents) or _OPEN))
        return edge

    def receive(self, node: StateSet, channel: str, contents: tuple[Message, ...] = _OPEN) -> Successor:
        """Return what follows when a message was received; nothing may while a transition has yet to send."""
        key = ("?", channel, contents)
        edge = node.edges.get(key)
        if edge is None:
            # A transition sends all it must before its component takes up anything else.
            ready = [state for state in node.states if self.observes == "messages" or not state.due]
            after = self._node(self.behaviour.receive(state, channel, each) for state in ready for each in contents)
            edge = node.keep(key, _edge(after, _OPEN))
        return edge

    def expected(self, node: StateSet) -> tuple[Expectation, ...]:
        """Return what the model lets come next, sorted."""
        if node.expected is None:
            node.expected = tuple(sorted(set(self._expectations(node)), key=str))
        return node.expected

    def owes(self, node: StateSet, channel: str) -> bool:
        """Return whether a message must come on the channel, whatever the component does, if nothing else reaches it.

        The component is assumed to be fair: it leaves a loop that it can leave.
        """
        if channel not in node.owed:
            node.owed[channel] = all(self._owes(state, channel) for state in node.states)
        return node.owed[channel]

    def running(self, node: StateSet, id: str) -> StateSet:
        """Return the set without the states in which the machine of a transition does not run."""
        return self._node(state for state in node.states if self.behaviour.runs(state, id)) or node

    def _owes(self, state: State, channel: str) -> bool:
        key = state, channel
        if key not in self._debts:
            if len(self._debts) >= _KEPT:
                self._debts.clear()
            self._debts[key] = self._is_owed(state, channel)
        return self._debts[key]

    def is_settled(self, node: StateSet) -> bool:
        """Return whether the transition under way has sent all it must, in some state of the set."""
        return any(not state.due for state in node.states)

    def why_not_taken(self, node: StateSet, transition: str) -> str:
        """Return why a transition cannot have been taken from any state of the set."""
        behaviour = self.behaviour
        known = behaviour.transitions.get(transition)
        if known is None:
            return f"{transition} is no transition of {behaviour.name}"
        if not self.is_settled(node):
            return f"{transition} came before what the last transition must send"
        if known.event is not None:
            channel = known.event.channel
            offered = [behaviour.receive(state._replace(foreign=frozenset()), channel, ()) for state in node.states]
            if any(True for state in offered for _ in behaviour.take(state, transition)):
                return f"{transition} needs a message of {channel}, but none was there to take up"
        return f"{transition} cannot be taken here"

    def why_not_sent(self, node: StateSet, channel: str, observed: Message) -> str:
        """Return why a message cannot have been sent from any state of the set."""
        behaviour = self.behaviour
        if channel not in behaviour.sends:
            return f"{channel} is no channel that {behaviour.name} sends on"
        if observed and self.send(node, channel).node is not None:
            values = ", ".join(f"{name} = {value!r}" for name, value in observed)
            return f"{channel} was sent with {values}, which is not what the model says"
        if self.observes == "messages":
            return f"{channel} was sent, but nothing that it may do now sends it"
        if not self.is_settled(node):
            return f"{channel} was sent, where the transition taken sends another message"
        return f"{channel} was sent, but no transition taken sends it"

    def _expectations(self, node: StateSet) -> Iterator[Expectation]:
        for state in node.states:
            if state.due:
                yield Expectation("send", *state.due[0])
                continue
            if self.observes == "transitions":
                for id, _ in self.behaviour.taken(state):
                    yield Expectation("take", id)
            for channel in self.behaviour.awaits(state):
                yield Expectation("receive", channel)
            for channel in self.behaviour.allowance.unmodelled & self.behaviour.sends:
                yield Expectation("send", channel)

    def _node(self, states: Iterable[State]) -> StateSet | None:
        found = dict.fromkeys(states)
        doubt = self._close(found) if self.observes == "messages" else ""
        if not found:
            return None
        key = frozenset(found)
        node = self._nodes.get(key)
        if node is None:
            if len(self._nodes) >= _KEPT:
                for old in self._nodes.values():
                    old.edges.clear()
                self._nodes.clear()
            node = self._nodes[key] = StateSet(key, doubt)
        return node

    def _close(self, found: dict[State, None]) -> str:
        # Adds the states that unseen steps lead to, depth first; returns why there may be more.
        waiting, doubt = list(found), ""
        while waiting:
            state = waiting.pop()
            for id, after in self.behaviour.taken(state):
                doubt = doubt or self.behaviour.doubt(state, id)
                if after not in found:
                    if len(found) >= self._hidden:
                        return f"steps that nobody sees lead to more than {self._hidden} states"
                    found[after] = None
                    waiting.append(after)
        return doubt

    def _is_owed(self, begin: State, channel: str) -> bool:
        # Forwards: all states that can be reached without sending on the channel, and from where. Backwards from the
        # states that send: if every state reached can still come to one of them, a fair component must send.
        #
        #     begin --> s1 --> s2 --> sending            owed
        #                \--> s3 <--> s4                 not owed: s3 and s4 need never send
        before: dict[State, list[State]] = {begin: []}
        sending: list[State] = []
        waiting = [begin]
        while waiting:
            state = waiting.pop()
            if state.due and state.due[0][0] == channel:
                sending.append(state)
                continue
            sent = self.behaviour.send(state, state.due[0][0]) if state.due else None
            follow = [sent] if sent is not None else [after for _, after in self.behaviour.taken(state)]
            for after in follow:
                if after not in before:
                    if len(before) >= self._hidden:
                        return False
                    before[after] = []
                    waiting.append(after)
                before[after].append(state)
        reached = set(sending)
        while sending:
            for state in before[sending.pop()]:
                if state not in reached:
                    reached.add(state)
                    sending.append(state)
        return len(reached) == len(before)


class Trackers:
    """The trackers of a model's components, made on demand."""

    def __init__(self, cefsm: Cefsm, observes: Observes, allowance: Allowance, hidden: int) -> None:
        self.key = observes, allowance, hidden
        self.cefsm = cefsm
        self._behaviours = {
            each.name: Behaviour(cefsm, each.name, allowance, UNREAD[observes]) for each in cefsm.components
        }
        self._made: dict[tuple[str, bool], Tracker] = {}

    def of(self, component: str, *, apart: bool = False) -> Tracker:
        """Return the tracker of a component, or `apart`, of one that may run one of its machines only."""
        key = component, apart
        if key not in self._made:
            observes, _, hidden = self.key
            self._made[key] = Tracker(self._behaviours[component], observes, hidden, apart=apart)
        return self._made[key]


_recent: list[Trackers] = []
_RECENT = 16


def trackers(cefsm: Cefsm, observes: Observes, allowance: Allowance, hidden: int) -> Trackers:
    """Return the trackers of a model; those of models in use are kept, found by identity."""
    for each in _recent:
        if each.cefsm is cefsm and each.key == (observes, allowance, hidden):
            return each
    _recent.insert(0, Trackers(cefsm, observes, allowance, hidden))
    del _recent[_RECENT:]
    return _recent[0]


def _edge(node: StateSet | None, contents: tuple[Message, ...], doubt: str = "") -> Successor:
    return Successor(node, contents, doubt or (node.doubt if node is not None else ""))


def _agree(said: Message, observed: Message) -> bool:
    # Reals agree to nine digits: a payload may have travelled as text or as a 32-bit float.
    if not said or not observed:
        return True
    seen = dict(observed)
    for name, value in said:
        if name in seen and seen[name] != value:
            other = seen[name]
            if not (isinstance(value, float) and isinstance(other, int | float) and math.isclose(value, other)):
                return False
    return True
