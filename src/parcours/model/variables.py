"""Checks the declaration of a variable: its type, its domain and its initial value."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from parcours.model.expression.evaluation import INTEGER_LIMIT
from parcours.model.finding import Finding, advice
from parcours.model.structure import BASE_TYPES, CLOCK, Variable


def variable_findings(owner: str, variable: Variable, classes: Sequence[str], origin: str) -> Iterator[Finding]:
    """Yield the errors in the declaration of a variable.

    >>> for finding in variable_findings("Lamp", Variable("lit", "boole", True), [], "lamp.yaml"):
    ...     print(finding)
    lamp.yaml: error: variable 'Lamp.lit' must have a base type or a message class, but is 'boole'; did you mean ...
    """

    def error(slug: str, rule: str, remedy: str = "") -> Finding:
        return Finding(origin, variable.line, "error", slug, f"{what} {rule}", remedy)

    what = f"variable '{owner}.{variable.name}'"
    known = [*BASE_TYPES, CLOCK, *classes]
    if variable.type == CLOCK:
        return
    if variable.type not in known:
        rule = f"must have a base type or a message class, but is {variable.type!r}"
        yield error("unknown-message", rule, advice(variable.type, known, ()))
    elif variable.type not in BASE_TYPES:
        if variable.initial is not None:
            rule = f"is a message, which has no initial value, but has {variable.initial!r}"
            yield error("initial", rule, "delete it")
    elif variable.type == "enum" and len(set(variable.domain)) != max(len(variable.domain), 1):
        yield error("value", f"must list one or more different 'values', but has {list(variable.domain)!r}")
    elif variable.initial is None:
        if variable.role == "local":
            yield error("initial", "must have an initial value, but has none", "add it")
    elif not _fits(variable):
        allowed = f"one of {list(variable.domain)}" if variable.type == "enum" else f"of type {variable.type}"
        if isinstance(variable.domain, range):
            allowed = f"an integer from {variable.domain[0]} to {variable.domain[-1]}"
        yield error("initial", f"must have an initial value that is {allowed}, but has {variable.initial!r}")


def _fits(variable: Variable) -> bool:
    value = variable.initial
    if variable.domain and value not in variable.domain:
        return False
    kinds: dict[str, tuple[type, ...]] = {"bool": (bool,), "int": (int,), "real": (int, float)}
    right = isinstance(value, kinds.get(variable.type, (str,)))
    if isinstance(value, bool):
        return right and variable.type == "bool"
    return right and (not isinstance(value, int | float) or abs(value) <= _LARGEST[variable.type])


_LARGEST = {"int": float(INTEGER_LIMIT), "real": 1.7976931348623157e308}
