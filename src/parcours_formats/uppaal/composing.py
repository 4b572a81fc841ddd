"""Composes processes to a Cefsm: those that share variables become one component, those that meet get a channel.

Two processes that both use a variable which one of them changes stand side by side as machines of one component;
others are components of their own. A channel with several senders or receivers becomes one for each pair of
components, and the steps on it are there once for each partner.
"""

from __future__ import annotations

from collections import ChainMap, Counter
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import cast

from parcours.errors import BadModel
from parcours.model.expression import Assignment, Expression, Name, names
from parcours.model.schema import MAX_RANGE
from parcours.model.structure import (
    CLOCK,
    ENVIRONMENT,
    Channel,
    Component,
    Machine,
    Receive,
    Send,
    Transition,
    Variable,
)
from parcours_formats.grouping import grouped
from parcours_formats.guard_languages.values import TRUE, literal, replaced
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames
from parcours_formats.symbols import SIGNAL
from parcours_formats.uppaal.processes import ProcessInstance
from parcours_formats.uppaal.steps import MAX_STEPS, ProcessStep
from parcours_formats.uppaal.symbols import Cells, UppaalChannel, UppaalVariable


@dataclass
class ProcessPart:
    """A process, its steps and invariants by location, and the index of the component it belongs to."""

    process: ProcessInstance
    steps: list[ProcessStep]
    invariants: list[tuple[str, Expression]]
    group: int = 0


class Composing:
    """Makes components and channels of the parts of one system; `losses` grows."""

    def __init__(
        self, parts: list[ProcessPart], cells: Cells, losses: Losses, tester: Set[tuple[str, str]], origin: str
    ) -> None:
        self.parts, self.cells, self.losses = parts, cells, losses
        self._group()
        self._name()
        self.links = Linking(parts, self.component_names, losses, tester, origin)

    def components(self) -> tuple[Component, ...]:
        """Return the components, in the order of their first processes."""
        found = []
        for name, members, renamed in zip(self.component_names, self.members, self.renamed, strict=True):
            variables = tuple(self._variable(self.cells.cells[id], name.id) for id, name in renamed.items())
            machines = tuple(self._machine(part, renamed) for part in members)
            found.append(Component(name, machines, variables, line=members[0].process.template.line))
        return tuple(found)

    def _group(self) -> None:
        # A process that uses a variable which somebody changes joins all that use it:
        #
        #   P1 --x:=1--> [x] <--reads-- P2      P3 --reads--> [k] <--reads-- P4      nobody changes k
        #   '----- component P1_P2 -----'       component P3      component P4       k is a constant of both
        #
        # Clocks count as changed: their values differ with time.
        written = [{action.target for step in part.steps for action in step.actions} for part in self.parts]
        changed = set().union(*written)
        used = [_read(part) | own for part, own in zip(self.parts, written, strict=True)]
        shared = [[id for id in ids if id in changed or self.cells.kinds[id] == CLOCK] for ids in used]
        self.members: list[list[ProcessPart]] = []
        for group, indices in enumerate(grouped(shared)):
            self.members.append([self.parts[at] for at in indices])
            for part in self.members[-1]:
                part.group = group
        users: dict[str, set[int]] = {}
        for part, ids in zip(self.parts, used, strict=True):
            for id in ids:
                users.setdefault(id, set()).add(part.group)
        self.constants: dict[str, Expression] = {}
        for id, cell in self.cells.cells.items():
            if cell.is_global and id not in users:
                self.losses.add(f"variable {id!r}", cell.line, "no process uses it; it is left out")
            elif len(users.get(id, ())) > 1:
                self.constants[id] = literal(cell.initial)
                rule = "several components read it, but none changes it; its value stands in its place"
                self.losses.add(f"variable {id!r}", cell.line, rule)
        self.users = users

    def _name(self) -> None:
        components = UniqueNames()
        self.component_names, self.machine_names = [], dict[str, str]()
        self.renamed: list[dict[str, Name]] = []
        for group, kept in zip(self.members, self._kept(), strict=True):
            members = [part.process.name for part in group]
            joint = "_".join(members) if len(members) < 4 else f"{members[0]}_and_others"
            self.component_names.append(components.identifier(joint))
            labels, variables = UniqueNames(), UniqueNames()
            for name in members:
                self.machine_names[name] = labels.label(name)
            # A local variable has its own name where that tells it from all others of the component.
            plain = Counter(map(_plain, kept))
            wanted = {id: _plain(id) if plain[_plain(id)] == 1 else id for id in kept}
            self.renamed.append({id: Name(variables.identifier(name)) for id, name in wanted.items()})

    def _kept(self) -> list[list[str]]:
        """Return the ids of the variables of each component: those local to its processes, and those it uses."""
        home = {part.process.name: part.group for part in self.parts}
        found: list[list[str]] = [[] for _ in self.members]
        for id, cell in self.cells.cells.items():
            groups = set() if id in self.constants else set(self.users.get(id, ()))
            if not cell.is_global and (own := home.get(id.partition(".")[0])) is not None:
                groups.add(own)
            for group in groups:
                found[group].append(id)
        return found

    def _variable(self, cell: UppaalVariable, name: str) -> Variable:
        if cell.kind == CLOCK:
            return Variable(name, CLOCK, None, unit="s", line=cell.line)
        domain: range | tuple[()] = ()
        if cell.low is not None and cell.high is not None:
            if cell.high - cell.low < MAX_RANGE:
                domain = range(cell.low, cell.high + 1)
            else:
                rule = f"its range has more than {MAX_RANGE} values and is left out"
                self.losses.add(f"variable {cell.id!r}", cell.line, rule)
        return Variable(name, cell.kind, cell.initial, domain=domain, line=cell.line)

    def _machine(self, part: ProcessPart, values: dict[str, Name]) -> Machine:
        template = part.process.template
        meaning: Mapping[str, Expression] = ChainMap(cast(dict[str, Expression], values), self.constants)
        urgent = {each.name for each in template.locations.values() if each.is_urgent or each.is_committed}
        transitions = []
        for step in part.steps:
            guard = replaced(step.guard, meaning)
            holds, duration = None if guard == TRUE else guard, (0.0, 0.0) if step.source in urgent else None
            actions = tuple(Assignment(values[each.target].id, replaced(each.value, meaning)) for each in step.actions)
            ends_here = list(self._ends(part, step))
            if not ends_here and step.link is not None:
                rule = f"no other process meets it on channel {step.link.id!r}, so that it can never be taken; left out"
                self.losses.add(f"edge {step.id!r}", step.line, rule)
            for id, event, sends in ends_here:
                ends = (id, step.source, step.target, event)
                transitions.append(Transition(*ends, holds, actions, sends, duration, step.weight, line=step.line))
        locations = template.locations
        return Machine(
            self.machine_names[part.process.name],
            locations[template.initial].name,
            tuple(each.name for each in locations.values()),
            tuple(transitions),
            invariants=tuple((state, replaced(condition, meaning)) for state, condition in part.invariants),
            line=template.line,
        )

    def _ends(self, part: ProcessPart, step: ProcessStep) -> Iterator[tuple[str, Receive | None, tuple[Send, ...]]]:
        if step.link is None:
            yield step.id, None, ()
            return
        partners = self.links.partners.get((part.process.name, step.link.id, step.sign), [])
        for name, partner in partners:
            id = step.id if len(partners) == 1 else f"{step.id} with {partner}"
            yield (id, None, (Send(name),)) if step.sign == "!" else (id, Receive(name), ())


def _read(part: ProcessPart) -> set[str]:
    said = [condition for _, condition in part.invariants]
    said += [each for step in part.steps for each in (step.guard, *(action.value for action in step.actions))]
    return set().union(*map(names, said))


def _plain(id: str) -> str:
    return id.rpartition(".")[2]


_Side = dict[str, tuple[int, list[ProcessStep]]]


class Linking:
    """The channels of one system."""

    def __init__(
        self,
        parts: Sequence[ProcessPart],
        components: Sequence[str],
        losses: Losses,
        tester: Set[tuple[str, str]],
        origin: str,
    ) -> None:
        self.components, self.losses, self.tester, self.origin, self._steps = components, losses, tester, origin, 0
        self.partners: dict[tuple[str, str, str], list[tuple[str, str]]] = {}
        self._names, self._made = UniqueNames(), list[Channel]()
        ends: dict[str, tuple[UppaalChannel, dict[str, _Side]]] = {}
        for part in parts:
            for step in part.steps:
                if step.link is not None:
                    _, sides = ends.setdefault(step.link.id, (step.link, {"!": {}, "?": {}}))
                    sides[step.sign].setdefault(part.process.name, (part.group, []))[1].append(step)
        for link, sides in sorted(ends.values(), key=lambda end: end[0].line):
            self._join(link, sides["!"], sides["?"])
            self._limits(link, sides["!"], sides["?"])
        self.channels = tuple(self._made)
        self.messages = (SIGNAL,) if self._made else ()

    def _join(self, link: UppaalChannel, senders: _Side, receivers: _Side) -> None:
        self._bounded(link, senders, receivers)
        pairs = {
            (one, other): (mine, theirs)
            for one, mine in _by_component(senders).items()
            for other, theirs in _by_component(receivers).items()
            if mine != theirs or len(mine) > 1
        }
        for side, sign, other_sign in ((senders, "!", "?"), (receivers, "?", "!")):
            if not pairs or (link.id, other_sign) in self.tester:
                for group in dict.fromkeys(group for group, _ in side.values()):
                    ends = (self.components[group], ENVIRONMENT)
                    name = self._channel(link, ends if sign == "!" else ends[::-1], alone=len(side) == 1)
                    for process in (process for process, (owner, _) in side.items() if owner == group):
                        self.partners.setdefault((process, link.id, sign), []).append((name, ENVIRONMENT))
        for (one, other), (mine, theirs) in pairs.items():
            between = (self.components[one], self.components[other])
            name = self._channel(link, between, alone=len(pairs) == 1)
            for processes, others, sign, partner in ((mine, theirs, "!", between[1]), (theirs, mine, "?", between[0])):
                for process in processes:
                    if others != [process]:  # nobody meets itself
                        self.partners.setdefault((process, link.id, sign), []).append((name, partner))

    def _bounded(self, link: UppaalChannel, senders: _Side, receivers: _Side) -> None:
        # Each step on the channel is there once for each component on the other side.
        for side, others in ((senders, receivers), (receivers, senders)):
            partners = len({group for group, _ in others.values()})
            self._steps += max(partners, 1) * sum(len(steps) for _, steps in side.values())
        if self._steps > MAX_STEPS:
            ends = f"{len(senders)} processes that send with {len(receivers)} that receive"
            most = f"steps that meet are written out once for each partner, at most {MAX_STEPS} in all"
            rule = f"{most}, but channel {link.id!r} joins {ends}"
            remedy = "instantiate fewer processes: a few on each side behave like many"
            raise BadModel(f"{self.origin}:{link.line}", rule, remedy, slug="expansion-size")

    def _channel(self, link: UppaalChannel, between: tuple[str, str], *, alone: bool) -> str:
        name = self._names.identifier(link.id if alone else f"{link.id}_{between[0]}_{between[1]}")
        self._made.append(Channel(name, *between, SIGNAL.name, capacity=0, line=link.line))
        return name

    def _limits(self, link: UppaalChannel, senders: _Side, receivers: _Side) -> None:
        where = f"channel {link.id!r}"
        met = any(sender != receiver for sender in senders for receiver in receivers)
        if link.is_broadcast and (met or not senders):
            rule = "a broadcast meets all that are ready and waits for none; here it meets one, and waits for it"
            self.losses.add(where, link.line, rule, alters=True)
        if link.is_urgent:
            self.losses.add(where, link.line, "is urgent; here time may pass before it is taken", alters=True)
        meets_tester = any((link.id, sign) in self.tester for sign in "!?")
        if not met and not meets_tester and not (link.is_broadcast and senders):
            other = "no other process" if senders and receivers else "no process"
            rule = f"{other} {'receives' if senders else 'sends'} on it, so that it blocks; here the environment does"
            self.losses.add(where, link.line, rule, alters=True)
        sent = {action.target for _, steps in senders.values() for step in steps for action in step.actions}
        read = {id for _, steps in receivers.values() for step in steps for id in names(step.guard)}
        if both := sorted(sent & read):
            rule = f"a receiver's guard reads {', '.join(both)} before the sender's update; here it reads after it"
            self.losses.add(where, link.line, rule, alters=True)


def _by_component(side: _Side) -> dict[int, list[str]]:
    found: dict[int, list[str]] = {}
    for process, (group, _) in side.items():
        found.setdefault(group, []).append(process)
    return found
