"""The numbers of a case -> values as components and simulations want them: whole, true or false, or names."""

from __future__ import annotations

from parcours.data import Domain, InputModel
from parcours.study.parameters import Scalar
from parcours.suite import Case


def natural(domain: Domain, value: float) -> Scalar:
    """Return a drawn value as people write it: a whole number, a name of an enumeration, or a number."""
    if domain.kind == "enumeration":
        return domain.values[int(value)]
    return int(value) if domain.kind == "integer" else float(value)


def natural_values(inputs: InputModel, case: Case) -> dict[str, Scalar]:
    """Return the test inputs of a case by name, each as its domain means it."""
    domains = {domain.name: domain for domain in inputs.domains}
    return {
        name: natural(domains[name], value) if name in domains else value
        for name, value in zip(case.names, case.values, strict=True)
    }
