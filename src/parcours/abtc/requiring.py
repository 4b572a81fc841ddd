"""What a model without abstract cases lacks, and the line of the model file that would give one."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice

from parcours.abtc.combining import combinations
from parcours.abtc.interactions import InteractionPath, component_graph, interaction_paths
from parcours.abtc.rendezvous import rendezvous_pairs
from parcours.abtc.serialising import abstract_cases
from parcours.errors import BadModel, BadRequest
from parcours.model.checking import findings
from parcours.model.structure import Cefsm
from parcours.paths.internal import InternalPath

_TRIED = 200  # chains of components
_SHOWN = 4  # senders, or combinations that were dropped
_MISSPELT = ("unreachable-state", "no-way-back")  # warnings that a misspelt state gives


def require_cases(cefsm: Cefsm, source: str = "", paths: Mapping[str, Sequence[InternalPath]] | None = None) -> None:
    """Raise BadModel if a model has no abstract case: no tests is an error, not a success.

    Args:
        source: its file, for the message; by default the model's name.
        paths: the internal paths of each component; by default those of edge coverage.

    Raises:
        BadModel: there is none; the message says why, and which line of the model file would change it, or that
            another criterion would.
        BadRequest: an interaction path has too many combinations.
    """
    if next(abstract_cases(cefsm, paths=paths), None) is not None:
        return
    edges, asked = component_graph(cefsm), interaction_paths(cefsm)
    if asked:
        found = [str(each) for itp in asked for each in combinations(cefsm, itp, paths).dropped]
        why = f"no combination has a rendezvous at every hop: {_some(found or [str(itp) for itp in asked])}"
    else:
        sent = dict.fromkeys((pair.channel, pair.send) for pair in rendezvous_pairs(cefsm))
        order = [channel.name for channels in edges.values() for channel in channels]
        senders = [
            f"{id} of {cefsm.channel(channel).sender} sends {channel}"
            for channel, id in sorted(sent, key=lambda pair: order.index(pair[0]))
        ]
        mute = [f"{receiver} never answers {sender}" for sender, receiver in edges if (receiver, sender) not in edges]
        said = _some(senders) or "no transition sends to another component"
        why = f"no interaction closes: {said}, and {_some(mute)}"
    rule = f"some interaction must give an abstract case, but {why}"
    if paths is not None and next(abstract_cases(cefsm), None) is not None:
        remedy = "choose a criterion whose paths meet; those of `edge` do"
    else:
        remedy = _suspected(cefsm) + _remedy(cefsm)
    raise BadModel(source or f"model {cefsm.name!r}", rule, remedy, slug="no-abstract-cases")


def _suspected(cefsm: Cefsm) -> str:
    """Return a remedy to try first where states are never reached or left, as with a misspelt `to`; else nothing."""
    found = [one.message.partition(", but ")[2] for one in findings(cefsm) if one.rule in _MISSPELT]
    return f"first see to what `parcours model check` says: {_some(found)}; if that is meant, " if found else ""


def _some(parts: list[str]) -> str:
    more = f" and {len(parts) - _SHOWN} more" if len(parts) > _SHOWN else ""
    return ", ".join(parts[:_SHOWN]) + more


def _remedy(cefsm: Cefsm) -> str:
    taken = {name for name, _ in cefsm.interactions} | {itp.name for itp in interaction_paths(cefsm)}
    name = next(free for number in range(1, len(taken) + 2) if (free := f"ITP{number}") not in taken)
    head, tail = (
        ("add under 'interactions' of the model file: ", "") if cefsm.interactions
        else ("add to the model file: interactions: {", "}")
    )  # fmt: skip
    # Longest first among the first found: a line that visits more components gives more of a test.
    for chain in sorted(islice(_chains(cefsm), _TRIED), key=len, reverse=True):
        try:
            if combinations(cefsm, InteractionPath(name, "SPC", chain)).kept:
                return f"{head}{name}: [{', '.join(chain)}]{tail}"
        except BadRequest:  # too many candidates
            continue
    if (pair := next(iter(rendezvous_pairs(cefsm)), None)) is not None:
        channel = cefsm.channel(pair.channel)
        lacking = f"give {channel.receiver} a transition with 'event: {channel.name}', and "
        return f"{lacking}{head}{name}: [{channel.sender}, {channel.receiver}]{tail}"
    return "let a transition of one component send what a transition of another receives"


def _chains(cefsm: Cefsm) -> Iterator[tuple[str, ...]]:
    # Paths through the component graph that visit no component twice.
    edges = component_graph(cefsm)

    def grown(chain: tuple[str, ...]) -> Iterator[tuple[str, ...]]:
        for sender, receiver in edges:
            if sender == chain[-1] and receiver not in chain:
                yield from grown((*chain, receiver))
        if len(chain) > 1:
            yield chain

    for component in cefsm.components:
        yield from grown((component.name,))
