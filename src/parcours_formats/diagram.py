"""What PlantUML and Mermaid have in common: a composite state for each component, a region for each machine."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from parcours.model.conversion import Loss
from parcours.model.drawing import predicate
from parcours.model.structure import Cefsm, Machine
from parcours_formats.losses import ASPECTS, unsaid


def states(cefsm: Cefsm, plain: Callable[[str], str]) -> Iterator[str]:
    """Yield the lines of a diagram."""
    for number, component in enumerate(cefsm.components):
        yield f'state "{plain(component.name)}" as c{number} {{'
        for at, machine in enumerate(component.machines):
            if at:
                yield "  --"
            yield from (f"  {line}" for line in _region(machine, f"c{number}_m{at}_s", plain))
        yield "}"


def undrawn(cefsm: Cefsm) -> tuple[Loss, ...]:
    """Return what a diagram leaves out; a transition's predicate is drawn as the paper writes it."""
    losses = list(unsaid(cefsm, ASPECTS - {"variables", "durations", "weights", "texts"}))
    for component in cefsm.components:
        said = ", ".join(repr(machine.name) for machine in component.machines)
        losses.append(Loss(f"component {component.name!r}", component.line, f"its machines {said} are not named"))
    for channel in cefsm.channels:
        what = f"its ends, {channel.sender!r} and {channel.receiver!r}, and its class are not drawn"
        losses.append(Loss(f"channel {channel.name!r}", channel.line, what))
    return tuple(losses)


def _region(machine: Machine, prefix: str, plain: Callable[[str], str]) -> Iterator[str]:
    ids = {state: f"{prefix}{number}" for number, state in enumerate(machine.states)}
    for state, id in ids.items():
        yield f'state "{plain(state)}" as {id}'
    yield f"[*] --> {ids[machine.initial]}"
    for each in machine.transitions:
        yield f"{ids[each.source]} --> {ids[each.target]} : {plain(f'{each.id} {predicate(each)}')}"
    for state in machine.final:
        yield f"{ids[state]} --> [*]"
