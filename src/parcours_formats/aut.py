"""Reads and writes Aldebaran's .aut: labelled transition systems of CADP, mCRL2, JTorX.

    des (0, 2, 2)            first state, number of transitions, number of states
    (0, "?coin", 1)          an input: the environment sends `coin`
    (1, "!tea", 0)           an output: the environment receives `tea`
    (1, i, 1)                internal, as `tau`

A label with neither sign is an action in which the environment takes part; it is read as an input.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Sequence
from typing import NoReturn

from parcours.errors import BadModel, BadRequest
from parcours.model.conversion import ForeignModel, Writing
from parcours.model.structure import Cefsm, Component, Machine, Receive, Send, Transition
from parcours_formats.losses import Losses, unsaid
from parcours_formats.naming import as_label, part_names
from parcours_formats.symbols import Alphabet, silent, symbols_of, unsaid_of_channels

MAX_TRANSITIONS = 5_000_000
"""Most transitions of one file."""

INTERNAL = ("i", "tau")
"""Labels of transitions that nobody sees: CADP's and mCRL2's."""

_HEADER = re.compile(r"\s*des\s*\(\s*([0-9]{1,18})\s*,\s*([0-9]{1,18})\s*,\s*([0-9]{1,18})\s*\)\s*", re.ASCII)


def read(text: str, origin: str) -> ForeignModel:
    """Return the transition system as a model of one machine; the name of the model is that of the file."""
    system = _System(text, origin)
    component, machine = part_names(origin.replace("\\", "/").rpartition("/")[2].removesuffix(".aut"))
    alphabet = Alphabet()
    meaning: dict[str, tuple[Receive | None, tuple[Send, ...]]] = dict.fromkeys(INTERNAL, (None, ()))
    transitions = []
    for number, (source, label, target, line) in enumerate(system.transitions(), 1):
        if label not in meaning:
            meaning[label] = _meaning(label, component, alphabet)
        event, sends = meaning[label]
        transitions.append(Transition(f"t{number}", source, target, event, sends=sends, line=line))
    machine_read = Machine(machine, system.first, tuple(system.states), tuple(transitions), line=1)
    components = (Component(component, (machine_read,)),)
    model = Cefsm(machine, components, tuple(alphabet.channels), alphabet.messages(), origin)
    # Valid as it was built: to check a million transitions again would take longer than to read them.
    return ForeignModel(model, tuple(system.losses))


def write(cefsm: Cefsm) -> Writing:
    """Return the only machine of a model as a transition system.

    A transition with several labels (an input and outputs) becomes a chain of them through states of its own. If
    the machine gives outputs, inputs are marked `?` and outputs `!`. Raises BadRequest if the model has several
    machines: their composition has a state space, which `write_space` writes.
    """
    machines = [machine for component in cefsm.components for machine in component.machines]
    if len(machines) != 1:
        rule = f".aut holds one machine, but {cefsm.name!r} has {len(machines)}"
        raise BadRequest(cefsm.name, rule, "write the state space of the composition", slug="one-machine")
    machine = machines[0]
    symbols = symbols_of(cefsm, barred='"')
    losses = Losses([*unsaid(cefsm, {"events", "sends"}), *unsaid_of_channels(cefsm, symbols)])
    marked = any(transition.sends for transition in machine.transitions)
    number = {state: at for at, state in enumerate(dict.fromkeys([machine.initial, *machine.states]))}
    sources, targets, labels, count = [], [], [], len(number)
    for transition in machine.transitions:
        for channel in silent(transition, symbols):
            losses.add(f"transition {transition.id!r}", transition.line, f"{channel!r} is not written: it is inside")
        event = [transition.event.channel] if transition.event else []
        chain = [f"?{symbols[name]}" if marked else _unmistakable(symbols[name]) for name in event if name in symbols]
        chain += ["!" + symbols[send.channel] for send in transition.sends if send.channel in symbols]
        #   A --?in / !out1, !out2--> B   becomes   A --?in--> n --!out1--> n+1 --!out2--> B
        stops = [number[transition.source], *range(count, count + len(chain) - 1), number[transition.target]]
        count += max(len(chain) - 1, 0)
        if len(chain) > 1:
            what = f"a transition has one label; this one becomes {len(chain)} in a row"
            losses.add(f"transition {transition.id!r}", transition.line, what)
        sources += stops[:-1]
        targets += stops[1:]
        labels += chain or [INTERNAL[0]]
    return Writing("".join(write_space(sources, targets, labels, count)), tuple(losses))


def write_space(
    sources: Sequence[int], targets: Sequence[int], labels: Iterable[str], states: int, first: int = 0
) -> Iterator[str]:
    """Yield the text of a transition system in pieces, for state spaces that no machine holds.

    Args:
        sources: the state each transition leaves, shape (n,).
        targets: the state each transition enters, shape (n,).
        labels: of each transition; `i` for an internal one. Quotes and line ends in them become `'` and blanks.
        states: the number of states.
        first: where it starts.

    >>> print("".join(write_space([0, 1], [1, 0], ["coin", "i"], 2)), end="")
    des (0, 2, 2)
    (0, "coin", 1)
    (1, i, 0)
    """
    yield f"des ({first}, {len(sources)}, {states})\n"
    quoted: dict[str, str] = {}
    for source, target, label in zip(sources, targets, labels, strict=True):
        if label not in quoted:
            said = as_label(label).replace('"', "'") if not label.isprintable() else label.replace('"', "'")
            quoted[label] = label if label in INTERNAL else f'"{said}"'
        yield f"({source}, {quoted[label]}, {target})\n"


class _System:
    """The lines of one file; `states` and `losses` are complete once `transitions` is exhausted."""

    def __init__(self, text: str, origin: str) -> None:
        self.origin, self.losses = origin, Losses()
        self.lines = enumerate(io.StringIO(text), 1)
        self.line, header = next(((at, line) for at, line in self.lines if line.strip()), (1, ""))
        match = _HEADER.fullmatch(header)
        if match is None:
            if not re.match(r"\s*des\b", header):
                self.refuse(f"must start with des (first state, transitions, states), but starts with {_shown(header)}")
            remedy = _PROBABLE if "/" in header else _ADVICE
            self.refuse(f"des has three numbers of at most 18 digits, but here is {_shown(header)}", remedy)
        self.first, (self.promised, self.size) = str(int(match[1])), (int(match[2]), int(match[3]))
        if int(match[1]) >= self.size:
            self.refuse(f"states are numbered from 0 to {self.size - 1}, but the first is {self.first}", _ADVICE)
        if self.promised > MAX_TRANSITIONS:
            rule = f"a file has at most {MAX_TRANSITIONS} transitions, but the header promises {self.promised}"
            self.refuse(rule, "reduce it first", "file-size")
        self.states: dict[str, None] = {self.first: None}

    def transitions(self) -> Iterator[tuple[str, str, str, int]]:
        """Yield source, label, target and line of each transition."""
        header, found = self.line, 0
        states, labels = self.states, dict[str, str]()
        for at, line in self.lines:
            self.line = at
            start, _, rest = line.partition(",")
            middle, _, end = rest.rpartition(",")
            start, end = start.strip(), end.strip()
            source, target = start[1:].strip(), end[:-1].strip()
            if not (start[:1] == "(" and end[-1:] == ")" and source.isdecimal() and target.isdecimal() and middle):
                if not line.strip():
                    continue
                self.no_transition(line)
            if (label := labels.get(middle)) is None:
                label = labels[middle] = _unquoted(middle)
            source, target = self.state(source), self.state(target)
            states[source] = states[target] = None
            found += 1
            if found > self.promised:
                promise = f"the header (line {header}) promises {self.promised} transitions"
                self.refuse(f"{promise}, but here is one more", _ADVICE)
            yield source, label, target, self.line
        if found != self.promised:
            self.line = header
            self.refuse(f"the header promises {self.promised} transitions, but {found} follow", _ADVICE)
        if len(states) < self.size:
            what = f"{self.size - len(states)} of its {self.size} states have no transition; they are left out"
            self.losses.add("des", header, what)

    def state(self, digits: str) -> str:
        if not (len(digits) <= 18 and digits.isascii() and int(digits) < self.size):
            self.refuse(f"states are numbered from 0 to {self.size - 1}, but here is {digits[:24]}", _ADVICE)
        return digits if digits[0] != "0" else str(int(digits))

    def no_transition(self, line: str) -> NoReturn:
        remedy = "write (from, label, to), one per line"
        if re.match(r"\(\s*[0-9]+\s*,.*,\s*[0-9]+\s+[0-9]+/", line[:1000]):
            remedy = _PROBABLE
        self.refuse(f'must be a transition, as (0, "a", 1), but is {_shown(line)}', remedy)

    def refuse(self, rule: str, remedy: str = "", slug: str = "aut-syntax") -> NoReturn:
        raise BadModel(f"{self.origin}:{self.line}", rule, remedy, slug=slug)


_ADVICE = "correct the header"
_PROBABLE = "probabilities are not read: leave them out"


def _meaning(label: str, component: str, alphabet: Alphabet) -> tuple[Receive | None, tuple[Send, ...]]:
    if label[:1] == "!" and label[1:2].strip():
        return None, alphabet.sent(component, as_label(label[1:]))
    if label[:1] == "?" and label[1:2].strip():
        label = label[1:]
    return alphabet.received(component, as_label(label)), ()


def _unquoted(middle: str) -> str:
    label = middle.strip()
    return label[1:-1].strip() if len(label) > 1 and label[0] == label[-1] == '"' else label


def _shown(line: str) -> str:
    return repr(line.strip() if len(line) <= 60 else line.strip()[:57] + "...")


def _unmistakable(label: str) -> str:
    # A name that begins as a mark does, or is that of the internal action, gets the mark of an input before it.
    return "?" + label if label in INTERNAL or label[:1] in "?!" else label
