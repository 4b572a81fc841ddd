"""What a model without abstract cases lacks, and the line of the model file that would give one."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice

from parcours.abtc.combining import combinations
from parcours.abtc.interactions import InteractionPath, component_graph, interaction_paths
from parcours.abtc.rendezvous import sends_on
from parcours.abtc.serialising import abstract_cases
from parcours.errors import BadModel, BadRequest
from parcours.model.structure import Cefsm

_TRIED = 200  # chains of components
_SHOWN = 4  # senders, or combinations that were dropped


def require_cases(cefsm: Cefsm, source: str = "") -> None:
    """Raise BadModel if a model has no abstract case: no tests is an error, not a success.

    Args:
        cefsm: the model.
        source: its file, for the message; by default the model's name.

    Raises:
        BadModel: there is none; the message says why, and which line of the model file would change it.
        BadRequest: an interaction path has too many combinations.
    """
    if next(abstract_cases(cefsm), None) is not None:
        return
    asked = interaction_paths(cefsm)
    why = _dropped(cefsm, asked) if asked else _open(cefsm)
    rule = f"some interaction must give an abstract case, but {why}"
    raise BadModel(source or f"model {cefsm.name!r}", rule, _remedy(cefsm), slug="no-abstract-cases")


def _open(cefsm: Cefsm) -> str:
    """Return who sends, and who never answers."""
    edges = component_graph(cefsm)
    senders = [
        f"{transition.id} of {sender} sends {channel.name}"
        for (sender, _), channels in edges.items()
        for channel in channels
        for transition in cefsm.component(sender).transitions()
        if sends_on(transition, channel.name)
    ]
    mute = [f"{receiver} never answers {sender}" for sender, receiver in edges if (receiver, sender) not in edges]
    said = _some(senders) or "no transition sends to another component"
    return f"no interaction closes: {said}, and {_some(mute)}"


def _dropped(cefsm: Cefsm, asked: tuple[InteractionPath, ...]) -> str:
    """Return which interactions there are, and why none of their combinations was kept."""
    found = [str(each) for itp in asked for each in combinations(cefsm, itp).dropped]
    return f"no combination has a rendezvous at every hop: {_some(found) or _some([str(itp) for itp in asked])}"


def _some(parts: list[str]) -> str:
    more = f" and {len(parts) - _SHOWN} more" if len(parts) > _SHOWN else ""
    return ", ".join(parts[:_SHOWN]) + more


def _remedy(cefsm: Cefsm) -> str:
    taken = {name for name, _ in cefsm.interactions} | {itp.name for itp in interaction_paths(cefsm)}
    name = next(free for number in range(1, len(taken) + 2) if (free := f"ITP{number}") not in taken)
    for chain in islice(_chains(cefsm), _TRIED):
        try:
            kept = combinations(cefsm, InteractionPath(name, "SPC", chain)).kept
        except BadRequest:  # too many candidates
            continue
        if kept:
            return _entry(cefsm, name, chain)
    for (sender, receiver), channels in component_graph(cefsm).items():
        sent = {send.channel for each in cefsm.component(sender).transitions() for send in each.sends}
        for channel in channels:
            if channel.name in sent:
                lacking = f"give {receiver} a transition with 'event: {channel.name}', and "
                return lacking + _entry(cefsm, name, (sender, receiver))
    return "let a transition of one component send what a transition of another receives"


def _entry(cefsm: Cefsm, name: str, chain: tuple[str, ...]) -> str:
    entry = f"{name}: [{', '.join(chain)}]"
    if cefsm.interactions:
        return f"add under 'interactions' of the model file: {entry}"
    return f"add to the model file: interactions: {{{entry}}}"


def _chains(cefsm: Cefsm) -> Iterator[tuple[str, ...]]:
    """Yield paths through the component graph without a component twice, longest first among the first found."""
    after: dict[str, list[str]] = {}
    for sender, receiver in component_graph(cefsm):
        after.setdefault(sender, []).append(receiver)

    def grown(chain: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        for name in after.get(chain[-1], ()):
            if name not in chain:
                yield from grown((*chain, name))
        if len(chain) > 1:
            yield chain

    starts = [component.name for component in cefsm.components]
    found = list(islice((chain for start in starts for chain in grown((start,))), _TRIED))
    return iter(sorted(found, key=len, reverse=True))
