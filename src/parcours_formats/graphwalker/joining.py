"""Joins GraphWalker's models to a Cefsm.

One token walks over models that share a state: they are one machine, with a silent jump between vertices of the same
shared state. Models without a shared state are machines side by side; those that use `global.` together are in one
component, so that they share variables.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence

from parcours.errors import BadModel
from parcours.model.conversion import ForeignModel, Loss, accepted
from parcours.model.structure import Cefsm, Component, Machine
from parcours_formats.graphwalker.labels import LabelledEdge, Model, Vertex
from parcours_formats.graphwalker.meaning import StartActions, TransitionDraft, translated
from parcours_formats.grouping import grouped
from parcours_formats.losses import Losses
from parcours_formats.naming import UniqueNames, as_label, part_names

MAX_JUMPS = 100_000
"""Most jumps between vertices of shared states."""

START = "Start"
"""The state before a walk's first edge, where that edge has no source, or one that other edges leave or enter."""

_GLOBAL = re.compile(r"\bglobal\s*\.\s*([A-Za-z_$][A-Za-z0-9_$]*)")


def joined(models: Iterable[Model], name: str, origin: str, losses: Iterable[Loss] = ()) -> ForeignModel:
    """Return models as one Cefsm."""
    joiner = _Joiner(origin, Losses(losses))
    kept = [joiner.unblocked(model) for model in models]
    walks = [[kept[at] for at in group] for group in grouped([_shared_states(model) for model in kept])]
    components, named = [], UniqueNames()
    for group in grouped([_shared_variables(walk) for walk in walks]):
        component = named.identifier(part_names(walks[group[0]][0].name)[0])
        components.append(joiner.component(component, [walks[at] for at in group]))
    return accepted(Cefsm(name, tuple(components), source=origin), joiner.losses)


def _shared_states(model: Model) -> set[str]:
    return {vertex.shared for vertex in model.vertices if vertex.shared}


def _shared_variables(walk: Sequence[Model]) -> set[str]:
    found = {f"component {part_names(model.name)[0]}" for model in walk if "/" in model.name}
    for model in walk:
        texts = [*model.actions, *(text for vertex in model.vertices for text in vertex.actions)]
        texts += [text for edge in model.edges for text in (edge.guard, *edge.actions)]
        found |= {name for text in texts for name in _GLOBAL.findall(text)}
    return found


class _Joiner:
    def __init__(self, origin: str, losses: Losses) -> None:
        self.origin, self.losses = origin, losses
        self.lose = losses.add
        self.ids = UniqueNames()
        self.jumps = 0

    def unblocked(self, model: Model) -> Model:
        """Return the model without what is blocked, and note what of it has no place in ours."""
        gone = {vertex.id for vertex in model.vertices if vertex.blocked}
        for kind, elements in (("vertex", model.vertices), ("edge", model.edges)):
            for each in elements:
                if each.blocked:
                    self.lose(f"{kind} {each.name!r}", each.line, "it is blocked, and left out with what hangs on it")
        where = f"model {model.name!r}"
        if model.requirements:
            self.lose(where, model.line, f"its requirements are not kept: {', '.join(model.requirements)}")
        if model.generator:
            what = f"how to walk is not kept: give {model.generator!r} to parcours walk --generator"
            self.lose(where, model.line, what)
        vertices = [vertex for vertex in model.vertices if not vertex.blocked]
        edges = [each for each in model.edges if not each.blocked and not {each.source, each.target} & gone]
        if not vertices:
            rule = f"a model must have a vertex that is not blocked, but {model.name!r} has none"
            raise BadModel(f"{self.origin}:{model.line}" if model.line else self.origin, rule, slug="graphwalker")
        start = "" if model.start in gone else model.start
        return Model(model.name, vertices, edges, start, model.actions, (), "", model.predefined, model.line)

    def component(self, name: str, walks: Sequence[Sequence[Model]]) -> Component:
        """Return the component of the models; each of the walks is a machine."""
        walkers = [_Walker(self, walk) for walk in walks]
        drafts = [draft for walker in walkers for draft in walker.drafts]
        starts = [start for walker in walkers for start in walker.starts]
        transitions, variables, losses = translated(drafts, starts, self.ids, self.origin)
        self.losses += losses
        made, named, machines = iter(transitions), UniqueNames(), []
        for walker in walkers:
            own = tuple(each for _ in walker.drafts for each in next(made))
            machine = named.label(part_names(walker.first.name)[1])
            states = tuple(dict.fromkeys([*walker.fresh, *walker.states.values()]))
            tags = tuple(walker.tags)
            machines.append(Machine(machine, walker.initial, states, own, line=walker.first.line, tags=tags))
        return Component(name, tuple(machines), variables, line=walks[0][0].line)


class _Walker:
    """One token on its models: the states, what leads from one to the other, and where it starts."""

    def __init__(self, joiner: _Joiner, models: Sequence[Model]) -> None:
        self.joiner, self.models, self.lose = joiner, models, joiner.lose
        self.named = UniqueNames()
        self.fresh: list[str] = []
        self.drafts: list[TransitionDraft] = []
        self.starts = [StartActions(model.name, model.actions, model.line) for model in models if model.actions]
        self.vertices: list[dict[str, Vertex]] = [{} for _ in models]
        self.states: dict[tuple[int, str], str] = {}
        self.tags: list[tuple[str, str]] = []
        for at, model in enumerate(models):
            for vertex in model.vertices:
                self.state(at, model, vertex)
        self.first, self.initial = models[0], ""
        for at, model in enumerate(models):
            self.start(at, model)
            ids = self.edges(at, model)
            if model.predefined:
                said = ", ".join(ids.get(each, each) for each in model.predefined)
                self.lose(f"model {model.name!r}", model.line, f"its predefined path is not kept: {said}")
        if not self.initial:
            self.guess()
        self.jump()

    def state(self, at: int, model: Model, vertex: Vertex) -> None:
        name = vertex.name or vertex.id or "unnamed"
        wanted = f"{model.name}/{name}" if len(self.models) > 1 else name
        if vertex.id in self.vertices[at]:
            rule = f"each vertex of a model must have an id of its own, but {vertex.id!r} is used twice"
            raise BadModel(f"{self.joiner.origin}:{vertex.line}", rule, "rename one", slug="duplicate")
        self.vertices[at][vertex.id] = vertex
        state = self.states[at, vertex.id] = self.named.label(wanted)
        self.tags += [(state, tag) for tag in _tags(vertex)]
        if state != wanted:
            self.lose(f"vertex {name!r}", vertex.line, f"its state is called {state!r}")

    def start(self, at: int, model: Model) -> None:
        """Find where the token starts, if it does in this model and has no start yet."""
        opening = [edge for edge in model.edges if not edge.source or (edge.id == model.start and edge.id)]
        marked = [each.id for each in model.vertices if each.name.lower() == START.lower()]
        at_vertex = model.start if model.start in self.vertices[at] else ""
        if at_vertex:
            self.pass_over(opening)
            opening = []
        if not (opening or marked or at_vertex):
            if model.start and not any(model.start in [e.id for e in other.edges] for other in self.models):
                self.lose(f"model {model.name!r}", model.line, f"no element has its startElementId {model.start!r}")
            return
        if self.initial:
            what = f"the walk starts in model {self.first.name!r}; this model is entered through shared states only"
            self.lose(f"model {model.name!r}", model.line, what)
            self.pass_over(opening)
            return
        self.first = model
        if at_vertex or (not opening and marked):
            vertex = self.vertices[at][at_vertex or marked[0]]
            self.initial = self.states[at, vertex.id]
            self.starts.append(StartActions(model.name, vertex.actions, vertex.line))
            return
        only = opening[0]
        around = [edge for edge in model.edges if edge is not only and only.source in (edge.source, edge.target)]
        if len(opening) == 1 and only.source and only.source != only.target and not around:
            self.initial = self.known(at, only, only.source)
            return
        self.initial = self.named.label(START)
        self.fresh.append(self.initial)
        for edge in opening:
            self.draft(at, model, edge, self.initial)

    def pass_over(self, opening: Sequence[LabelledEdge]) -> None:
        """Note the edges without source that no walk can take."""
        for edge in opening:
            if not edge.source:
                what = "it has no source, and the walk starts elsewhere; it is left out"
                self.lose(f"edge {edge.name or edge.id!r}", edge.line, what)

    def edges(self, at: int, model: Model) -> dict[str, str]:
        """Add a draft for each edge that has a source; return the id of the draft by that of the edge."""
        weights = _weights(model.edges)
        return {
            edge.id: self.draft(at, model, edge, self.known(at, edge, edge.source), weights.get(number, 1.0))
            for number, edge in enumerate(model.edges)
            if edge.source
        }

    def draft(self, at: int, model: Model, edge: LabelledEdge, source: str, weight: float = 1.0) -> str:
        target = self.known(at, edge, edge.target)
        name = edge.name or f"{source} to {target}"
        id = self.joiner.ids.label(name)
        if edge.name and id != edge.name:
            self.lose(f"edge {name!r}", edge.line, f"its transition is called {id!r}")
        if edge.dependency:
            self.lose(f"edge {name!r}", edge.line, f"its dependency {edge.dependency} is not kept")
        actions = (*edge.actions, *self.vertices[at][edge.target].actions)
        self.drafts.append(
            TransitionDraft(id, source, target, model.name, edge.guard, actions, weight, edge.line, _tags(edge))
        )
        return id

    def known(self, at: int, edge: LabelledEdge, vertex: str) -> str:
        state = self.states.get((at, vertex))
        if state is None:
            rule = f"an edge must join vertices of its model, but {edge.name or edge.id!r} has {vertex!r}"
            where = f"{self.joiner.origin}:{edge.line}" if edge.line else self.joiner.origin
            raise BadModel(where, rule, "add the vertex, or correct its id", slug="graphwalker")
        return state

    def guess(self) -> None:
        """Start where nothing leads to, or else at the first vertex: the file does not say."""
        model = self.models[0]
        entered = {edge.target for edge in model.edges if edge.source != edge.target}
        vertex = next((each for each in model.vertices if each.id not in entered), model.vertices[0])
        self.initial = self.states[0, vertex.id]
        what = f"nothing says where the walk starts; it starts in {self.initial!r}"
        self.lose(f"model {model.name!r}", model.line, what)

    def jump(self) -> None:
        """Add the jumps between vertices of different models that share a state."""
        #   model A:  a1 --> [a2 SHARED:S]            one machine:  a1 --> a2 <==> b1 --> b2
        #   model B:  [b1 SHARED:S] --> b2            <==> are two jumps without event or guard
        places: dict[str, list[tuple[int, Vertex]]] = {}
        for at, model in enumerate(self.models):
            for vertex in model.vertices:
                if vertex.shared:
                    places.setdefault(vertex.shared, []).append((at, vertex))
        for shared, found in places.items():
            if len({at for at, _ in found}) == 1:
                what = f"no other model of this file has its shared state {shared!r}; it is not kept"
                for _, vertex in found:
                    self.lose(f"vertex {vertex.name!r}", vertex.line, what)
            self.joiner.jumps += len(found) ** 2
            if self.joiner.jumps > MAX_JUMPS:
                rule = f"shared states have at most {MAX_JUMPS} jumps, but {shared!r} makes them {self.joiner.jumps}"
                raise BadModel(self.joiner.origin, rule, "share fewer vertices", slug="graphwalker")
            for at, vertex in found:
                for to, entered in found:
                    if at != to:
                        source, target = self.states[at, vertex.id], self.states[to, entered.id]
                        id = self.joiner.ids.label(f"{shared}: {source} to {target}")
                        model = self.models[to]
                        draft = TransitionDraft(
                            id, source, target, model.name, actions=entered.actions, line=entered.line
                        )
                        self.drafts.append(draft)


def _tags(element: Vertex | LabelledEdge) -> tuple[str, ...]:
    return tuple(dict.fromkeys(map(as_label, element.requirements)))


def _weights(edges: Sequence[LabelledEdge]) -> dict[int, float]:
    """Return the weight of each edge of a vertex where one is given: the others share what is left of 1."""
    leaving: dict[str, list[int]] = {}
    for number, edge in enumerate(edges):
        leaving.setdefault(edge.source, []).append(number)
    found: dict[int, float] = {}
    for numbers in leaving.values():
        silent = [number for number in numbers if not edges[number].weight]
        if len(silent) < len(numbers):
            left = max(0.0, round(1.0 - sum(edges[number].weight for number in numbers), 9))
            found |= {number: edges[number].weight or left / len(silent) for number in numbers}
    return found
