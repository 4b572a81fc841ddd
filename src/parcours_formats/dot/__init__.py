"""Reads and writes Graphviz' DOT: automata as LearnLib and the automata wiki draw them, and GraphWalker's labels.

Labels with guards or actions, as `e_Name[guard]/action;`, are GraphWalker's. In any other file a label is
`input / output`, or an input alone: the environment sends the one and receives the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from parcours.model.conversion import ForeignModel, Writing, accepted
from parcours.model.structure import Cefsm, Component, Machine
from parcours_formats.dot.dot_graphs import parse_dot, quoted
from parcours_formats.dot.drawing import drawings
from parcours_formats.graphwalker.joining import joined
from parcours_formats.graphwalker.labels import Model, edge_label, vertex_label
from parcours_formats.graphwalker.splitting import parted
from parcours_formats.losses import Losses, unsaid
from parcours_formats.naming import UniqueNames, joint_name, part_names, stem
from parcours_formats.symbols import Alphabet, is_alphabetic, symbols_of, unsaid_of_channels


def read(text: str, origin: str) -> ForeignModel:
    """Return the model that a DOT file holds; each of its digraphs is a machine.

    The start is where the only edge of a node that just marks it leads (`__start0 -> s0`), or else the source of the
    first edge. States drawn as double circles are final. Raises BadModel if a graph is not directed, or a label says
    what our language cannot.
    """
    graphs = parse_dot(text, origin)
    drawn = [drawing for graph in graphs for drawing in drawings(graph, origin, stem(origin))]
    losses = [loss for drawing in drawn for loss in drawing.losses()]
    name = drawn[0].name if len(graphs) == 1 else stem(origin)
    if any(drawing.is_walked for drawing in drawn):
        return joined([drawing.model() for drawing in drawn], name, origin, losses)
    alphabet, ids = Alphabet(), UniqueNames()
    components: dict[str, list[Machine]] = {}
    machines: dict[str, UniqueNames] = {}
    for drawing in drawn:
        component, wanted = part_names(drawing.name)
        given = machines.setdefault(component, UniqueNames()).label(wanted)
        machine, lost = drawing.machine(component, given, alphabet, ids)
        components.setdefault(component, []).append(machine)
        losses += lost
    made = tuple(Component(component, tuple(found)) for component, found in components.items())
    return accepted(Cefsm(name, made, tuple(alphabet.channels), alphabet.messages(), origin), losses)


def write(cefsm: Cefsm) -> Writing:
    """Return a model as digraphs, one for each machine.

    A model whose transitions all take an input from the environment, and give it one output or none, is written as
    LearnLib does; any other with GraphWalker's labels, which have guards and actions but no messages.
    """
    machines = [(component, machine) for component in cefsm.components for machine in component.machines]
    names = [joint_name(owner.name, machine.name, alone=len(owner.machines) == 1) for owner, machine in machines]
    losses = Losses()
    if names != [cefsm.name]:
        told = f"its only machine, {names[0]!r}" if len(names) == 1 else "the file"
        losses.add(f"model {cefsm.name!r}", 0, f"its name is not written; it is called as {told}")
    if is_alphabetic(cefsm):
        symbols = symbols_of(cefsm, barred="/")
        losses += [*unsaid(cefsm, {"events", "sends", "finals", "ids", "states"}), *unsaid_of_channels(cefsm, symbols)]
        drawn = [_automaton(machine, name, symbols) for (_, machine), name in zip(machines, names, strict=True)]
    else:
        models, unwritten = parted(cefsm)
        losses += unwritten
        drawn = [_walked(model) for model in models]
    return Writing("\n".join(line for lines in drawn for line in lines) + "\n", tuple(losses))


def _automaton(machine: Machine, name: str, symbols: Mapping[str, str]) -> Iterator[str]:
    ids = {state: f"s{number}" for number, state in enumerate(machine.states)}
    yield f"digraph {quoted(name)} {{"
    for state, id in ids.items():
        shape = "doublecircle" if state in machine.final else "circle"
        yield f'  {id} [shape="{shape}" label={quoted(state)}];'
    yield '  __start0 [label="" shape="none"];'
    for transition in machine.transitions:
        taken = symbols[transition.event.channel] if transition.event else ""
        label = " / ".join([taken, *(symbols[send.channel] for send in transition.sends)])
        ends = f"{ids[transition.source]} -> {ids[transition.target]}"
        yield f"  {ends} [label={quoted(label)} id={quoted(transition.id)}];"
    yield f"  __start0 -> {ids[machine.initial]};"
    yield "}"


def _walked(model: Model) -> Iterator[str]:
    yield f"digraph {quoted(model.name)} {{"
    for vertex in model.vertices:
        label = vertex_label(vertex, model.actions if vertex.id == model.start else ())
        yield f"  {vertex.id} [label={quoted(label)}];"
    yield '  Start [shape="circle"];'
    yield f"  Start -> {model.start};"
    for edge in model.edges:
        yield f"  {edge.source} -> {edge.target} [label={quoted(edge_label(edge))}];"
    yield "}"
