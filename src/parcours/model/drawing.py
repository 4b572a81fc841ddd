"""Prints a model as tables for the terminal."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence

from parcours.model.structure import Cefsm, Machine, Transition

WIDTH = 110
"""Widest line of a table [characters]."""


def predicate(transition: Transition) -> str:
    """Return the predicate of a transition as the paper prints it: (event/[guard]/actions/messages).

    Its duration follows, if it has one: `(-/-/-/-) within [0.005, 0.05] s`.
    """
    event = "-"
    if transition.event is not None:
        event = transition.event.channel + (f"({transition.event.name})" if transition.event.name else "")
    guard = "-" if transition.guard is None else f"[{transition.guard}]"
    actions = "; ".join(map(str, transition.actions)) or "-"
    sends = "; ".join(f"{send.channel}({', '.join(map(str, send.payload))})" for send in transition.sends) or "-"
    within = "" if transition.duration is None else " within [{:g}, {:g}] s".format(*transition.duration)
    return f"({event}/{guard}/{actions}/{sends}){within}"


def to_text(cefsm: Cefsm) -> str:
    """Return the model as tables, one for each machine and one of the channels, WIDTH wide or less."""
    machines = [machine for component in cefsm.components for machine in component.machines]
    counts = (
        _counted(len(cefsm.components), "component"),
        _counted(len(machines), "machine"),
        _counted(sum(len(machine.states) for machine in machines), "state"),
        _counted(sum(len(machine.transitions) for machine in machines), "transition"),
        _counted(len(cefsm.channels), "channel"),
    )
    lines = [f"{cefsm.name}: {', '.join(counts)}"]
    lines += textwrap.wrap(cefsm.doc, WIDTH, initial_indent="  ", subsequent_indent="  ")
    for component in cefsm.components:
        title = f" ({component.title})" if component.title and component.title != component.name else ""
        lines += ["", component.name + title]
        if component.variables:
            said = ", ".join(f"{each.name}: {each.type}" + _note(each.role) for each in component.variables)
            lines += textwrap.wrap(f"variables {said}", WIDTH, initial_indent="  ", subsequent_indent="    ")
        for machine in component.machines:
            ends = f", may end in {', '.join(machine.final)}" if machine.final else ""
            lines += textwrap.wrap(f"{machine.name}, starts in {machine.initial}{ends}", WIDTH, initial_indent="  ")
            lines += textwrap.wrap(_invariants(machine), WIDTH, initial_indent="    ", subsequent_indent="      ")
            said = "; ".join(", ".join(group) for group in machine.exclusive)
            said = f"exclusive: {said}" if said else ""
            lines += textwrap.wrap(said, WIDTH, initial_indent="    ", subsequent_indent="      ")
            lines += _machine_table(machine)
    if cefsm.channels:
        rows = [
            (each.name, each.sender, each.receiver, each.message, each.topic or "-", str(each.capacity))
            for each in cefsm.channels
        ]
        lines += ["", "channels", *_table(("channel", "from", "to", "message", "topic", "capacity"), rows, 2)]
    if cefsm.interactions:
        lines += ["", "interactions"]
        lines += _table(("name", "path"), [(name, " -> ".join(path)) for name, path in cefsm.interactions], 2)
    return "\n".join(lines)


def _invariants(machine: Machine) -> str:
    said = ", ".join(f"{condition} in {state}" for state, condition in machine.invariants)
    return f"invariants: {said}" if said else ""


def _machine_table(machine: Machine) -> list[str]:
    rows = []
    for state in machine.states:
        leaving = [transition for transition in machine.transitions if transition.source == state]
        for first, transition in enumerate(leaving):
            rows.append((state if not first else "", transition.id, predicate(transition), transition.target))
        if not leaving:
            rows.append((state, "-", "-", "-"))
    return _table(("state", "transition", "predicate", "target"), rows, 4)


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], indent: int) -> list[str]:
    # A column starts as wide as its longest cell.
    widths = [max(len(row[at]) for row in [head, *rows]) for at in range(len(head))]
    # The widest columns are wrapped until the table fits.
    while indent + sum(widths) + 2 * (len(widths) - 1) > WIDTH and max(widths) > 12:
        widths[widths.index(max(widths))] -= 1
    lines = []
    for row in [head, ["-" * width for width in widths], *rows]:
        cells = [textwrap.wrap(cell, width) or [""] for cell, width in zip(row, widths, strict=True)]
        for at in range(max(map(len, cells))):
            parts = [cell[at] if at < len(cell) else "" for cell in cells]
            said = "  ".join(part.ljust(width) for part, width in zip(parts, widths, strict=True))
            lines.append(" " * indent + said.rstrip())
    return lines


def _counted(number: int, noun: str) -> str:
    return f"{number} {noun}" + ("" if number == 1 else "s")


def _note(role: str) -> str:
    return " (input)" if role == "input" else ""
