"""Turns blocks into boundary values: on, just inside and just outside the ends of each block.

       below  min  min+          nominal          max-  max  above
         x    [x    x               x               x    x]    x

On the result every criterion does what it says: base choice from the nominal values is classical boundary value
analysis (4 n + 1 rows for n inputs of one block), with the values just outside as negative tests its robust form (6 n +
1), and all combinations the worst case (5 ** n). (Jorgensen, Software Testing: A Craftsman's Approach, ch. 5.)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import reduce

from parcours.data.blocks import Block, point
from parcours.data.domains import Domain
from parcours.data.inputs import InputModel, extent
from parcours.model.expression import Binary, Expression, Literal, Name
from parcours.model.expression.syntax import substitute

STEP = 1e-3
"""How far `just inside` is from an end, as a share of the range of a real or an angle; 1 for integers."""

_Pieces = Mapping[str, list[range]]


def at_boundaries(model: InputModel) -> InputModel:
    """Return the model whose blocks are the boundary values of the given one's.

    Enumerations and listed values stay as they are. Just outside, one step below and above the range, lie invalid
    blocks; an invalid block that holds such a value already shrinks to it. Rules stay: those over blocks mean all
    values of the block.
    """
    changed = [_boundaries(domain) for domain in model.domains]
    pieces = {domain.name: ranges for domain, ranges in changed}
    constraints = tuple(
        replace(c, expression=substitute(c.expression, lambda node: _spread(node, pieces))) if c.over == "blocks" else c
        for c in model.constraints
    )
    return replace(model, domains=tuple(domain for domain, _ in changed), constraints=constraints)


def _boundaries(domain: Domain) -> tuple[Domain, list[range]]:
    """Return the domain of boundary values, and which of its blocks stand for each of the old ones."""
    if domain.kind == "enumeration" or all(block.is_point for block in domain.blocks):
        return domain, [range(place, place + 1) for place in range(len(domain.choices))]
    step = domain.step or (1.0 if domain.kind == "integer" else STEP * domain.span.width)
    points: list[Block] = []
    pieces, middles = [], []
    for block in domain.blocks:
        first = len(points)
        found = _points(domain, block, step)
        prefix = f"{block.label} " if len(domain.blocks) > 1 else ""
        points += [point(value, f"{prefix}{name}") for value, name in found.items()]
        pieces.append(range(first, len(points)))
        middles.append(first + next((i for i, name in enumerate(found.values()) if name == "nominal"), 0))
    ends = _outside(domain, step)
    invalid = [next((end for end in ends if end.low in block), block) for block in domain.invalid]
    invalid = [replace(new, name=old.name or new.name) for new, old in zip(invalid, domain.invalid, strict=True)]
    invalid += [end for end in ends if not any(end.low in block for block in domain.invalid)]
    pieces += [range(len(points) + i, len(points) + i + 1) for i in range(len(domain.invalid))]
    bases = tuple(middles[base] for base in domain.bases)
    return replace(domain, blocks=tuple(points), invalid=tuple(invalid), bases=bases, stated=None), pieces


def _points(domain: Domain, block: Block, step: float) -> dict[float, str]:
    """Return the boundary values of a block, ascending, with their names; where two coincide, ends win over all."""
    low, high = extent(domain, block) if domain.kind == "integer" else (block.first, block.last)
    inner = step if domain.kind == "integer" else min(step, (high - low) / 4)
    middle = (low + high) // 2 if domain.kind == "integer" else (low + high) / 2
    found = {middle: "nominal"}
    for name, value in (("min+", low + inner), ("max-", high - inner), ("min", low), ("max", high)):
        if low <= value <= high and (
            value not in found or (name == "min" or (name == "max" and found[value] != "min"))
        ):
            found[value] = name
    return dict(sorted(found.items()))


def _outside(domain: Domain, step: float) -> list[Block]:
    """Return the values one step below and above the range, unless it is one of angles."""
    if domain.kind == "angle":
        return []
    low, high = extent(domain, domain.blocks[0])[0], extent(domain, domain.blocks[-1])[1]
    return [point(low - step, "below"), point(high + step, "above")]


def _spread(node: Expression, pieces: _Pieces) -> Expression | None:
    """Return a comparison of blocks as one of their boundary values, which are several for each block."""
    match node:
        case Binary("==" | "!=" as operator, Name(id), Literal(place)) if id in pieces and isinstance(place, int):
            return _within(id, pieces[id][place], operator == "==")
        case Binary("==" | "!=" as operator, Name(left), Name(right)) if left in pieces and right in pieces:
            pairs = zip(pieces[left], pieces[right], strict=True)
            same = [Binary("&&", _within(left, a, True), _within(right, b, True)) for a, b in pairs]
            either = reduce(lambda a, b: Binary("||", a, b), same)
            return either if operator == "==" else Binary("==", either, Literal(False))
        case _:
            return None


def _within(name: str, places: range, is_inside: bool) -> Expression:
    low, high = Literal(places.start), Literal(places.stop - 1)
    if is_inside:
        return Binary("&&", Binary(">=", Name(name), low), Binary("<=", Name(name), high))
    return Binary("||", Binary("<", Name(name), low), Binary(">", Name(name), high))
