"""Writes an input model as a PICT model, with a report of what PICT cannot say."""

from __future__ import annotations

import re
from collections.abc import Iterator

import numpy as np

from parcours.data.constraints import Constraint
from parcours.data.domains import Domain
from parcours.data.inputs import InputModel, rules_of
from parcours.errors import ParcoursError
from parcours.model.conversion import Writing
from parcours.model.expression import Binary, Expression, Literal, Name, Unary, parse_expression
from parcours_formats.losses import Losses
from parcours_formats.pict.pict_reader import CROSSED

MAX_FORBIDDEN = 1_000
"""Most combinations that a constraint is written out as, where PICT has no words for it."""

_RELATIONS = {"==": "=", "!=": "<>", "<": "<", "<=": "<=", ">": ">", ">=": ">="}
_UNFIT = re.compile(r"[,|]|^[~<]+|\(\s*[0-9]+\s*\)$")


def write_pict(model: InputModel) -> Writing:
    """Return the PICT text of a model, and what of the model it does not hold.

    >>> from parcours.data.domains import enumeration, split
    >>> from parcours.data.inputs import constraint_of
    >>> domains = enumeration("gear", ["slow", "fast"]), split("v", "m/s", [0.0, 0.5, 1.0])
    >>> rule = constraint_of("c", parse_expression("gear == 'fast' || v <= 0.5"), domains)
    >>> written = write_pict(InputModel("m", domains, (rule,)))
    >>> print(written.text, end="")
    gear: slow, fast
    v: [0 0.5], (0.5 1]
    NOT ([gear] = "slow" AND [v] = "(0.5 1]");
    >>> len(written.losses)
    3
    """
    return _Writer(model).writing()


class _Writer:
    def __init__(self, model: InputModel) -> None:
        self.model = model
        self.losses = Losses()
        self.words = {domain.name: self.words_of(domain) for domain in model.domains}
        self.domains = {domain.name: domain for domain in model.domains}

    def writing(self) -> Writing:
        lines = [self.parameter(domain) for domain in self.model.domains]
        for group in self.model.groups:
            lines.append(f"{{ {', '.join(group.inputs)} }} @ {group.strength}")
            if len(group.inputs) > 1:
                self.lose(f"group of {len(group.inputs)} parameters", CROSSED)
        for constraint in self.model.constraints:
            lines += self.constraint(constraint)
        if any(domain.unit != "1" or domain.doc for domain in self.model.domains):
            self.lose("parameters", "units and remarks are not written")
        return Writing("\n".join(lines) + "\n", tuple(self.losses))

    def lose(self, where: str, what: str) -> None:
        self.losses.add(where, 0, what)

    def words_of(self, domain: Domain) -> list[str]:
        """Return what PICT calls each block, all different."""
        where = f"parameter {domain.name!r}"
        words: list[str] = []
        for index, block in enumerate(domain.choices):
            label = block.name if domain.kind == "enumeration" else block.label
            word = " ".join(_UNFIT.sub(" ", label).split())
            while word.casefold() in {known.casefold() for known in words} or not word:
                word = f"{word} {index}".strip()
            if word != label and block.name:
                self.lose(where, f"its block {label!r} is called {word!r}")
            words.append(word)
        if domain.kind == "enumeration" and len(domain.values) > len(words):
            self.lose(where, "of the values of a block only the name of the block is written")
        if domain.kind == "enumeration" and all(_is_number(word) for word in words):
            self.lose(where, "its names are numbers to PICT")
        elif domain.kind != "enumeration" and not all(block.is_point for block in domain.choices):
            self.lose(where, "its intervals are words to PICT, without a value")
        elif domain.kind == "angle":
            self.lose(where, "angles are plain numbers to PICT")
        if domain.bases != (0,):
            self.lose(where, "its bases are not written")
        return words

    def parameter(self, domain: Domain) -> str:
        marks = ["" if index < len(domain.blocks) else "~" for index in range(len(domain.choices))]
        return f"{domain.name}: " + ", ".join(f"{m}{w}" for m, w in zip(marks, self.words[domain.name], strict=True))

    def constraint(self, constraint: Constraint) -> Iterator[str]:
        """Yield the constraint in PICT's language, or the combinations that it forbids."""
        # First in words; what PICT has no words for, as the combinations of blocks that it forbids.
        try:
            yield self.said(parse_expression(constraint.text or str(constraint.expression)), constraint) + ";"
            return
        except (ValueError, ParcoursError):
            pass
        where = f"constraint {constraint.name!r}"
        table = next((t for t in rules_of(self.model).tables if t.name == constraint.name), None)
        forbidden = [] if table is None else np.argwhere(~table.allowed).tolist()
        if table is None or len(forbidden) > MAX_FORBIDDEN:
            self.lose(where, f"{constraint.text or constraint.expression} is left out: it forbids no few whole blocks")
            return
        self.lose(where, f"{constraint.text or constraint.expression} is written as the blocks that it forbids")
        for blocks in forbidden:
            terms = [
                f"[{self.model.names[c]}] = {self.quoted(self.model.names[c], b)}"
                for c, b in zip(table.columns, blocks, strict=True)
            ]
            yield f"NOT ({' AND '.join(terms)});"

    def said(self, node: Expression, constraint: Constraint) -> str:
        """Return a condition in PICT's language. Raises ValueError where PICT has no words for it."""
        match node:
            case Unary("!", operand):
                return f"NOT ({self.said(operand, constraint)})"
            case Binary("&&" | "||" as sign, left, right):
                word = "AND" if sign == "&&" else "OR"
                return f"({self.said(left, constraint)} {word} {self.said(right, constraint)})"
            case Binary(sign, Name(id), Name(other)) if sign in _RELATIONS and self.are_alike(id, other, constraint):
                return f"[{id}] {_RELATIONS[sign]} [{other}]"
            case Binary(sign, Name(id), right) if sign in _RELATIONS and id in self.domains:
                return f"[{id}] {_RELATIONS[sign]} {self.value(id, right, constraint)}"
            case _:
                raise ValueError

    def are_alike(self, left: str, right: str, constraint: Constraint) -> bool:
        both = [self.domains.get(left), self.domains.get(right)]
        points = all(d and d.kind in ("real", "integer") and all(b.is_point for b in d.choices) for d in both)
        return points and constraint.over == "values"

    def value(self, name: str, node: Expression, constraint: Constraint) -> str:
        domain = self.domains[name]
        if isinstance(node, Literal) and isinstance(node.value, str):
            names = domain.labels if constraint.over == "blocks" else domain.values
            if len(names) == len(domain.choices) and node.value in names:
                return self.quoted(name, names.index(node.value))
            raise ValueError
        sign = -1 if isinstance(node, Unary) and node.operator == "-" else 1
        literal = node.operand if isinstance(node, Unary) else node
        is_plain = isinstance(literal, Literal) and not isinstance(literal.value, bool | str)
        is_point = all(block.is_point and not block.name for block in domain.choices)
        if not (is_plain and is_point and domain.kind in ("real", "integer") and constraint.over == "values"):
            raise ValueError
        assert isinstance(literal, Literal)
        return f"{sign * float(literal.value):.17g}"

    def quoted(self, name: str, block: int) -> str:
        domain, word = self.domains[name], self.words[name][block]
        is_number = all(_is_number(each) for each in self.words[name])
        if is_number and domain.kind != "enumeration":
            return word
        escaped = re.sub(r'([\\"])', r"\\\1", word)
        return f'"{escaped}"'


def _is_number(word: str) -> bool:
    return bool(re.fullmatch(r"[-+]?[0-9.]+([eE][-+]?[0-9]+)?", word))
