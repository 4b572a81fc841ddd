"""A model of one machine in a few lines, for tests of guards and time."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from parcours.model import Cefsm, parse_model


@pytest.fixture(scope="session")
def component() -> Callable[..., Cefsm]:
    """Return the builder of a component `C` with one machine `m` that begins in `a`.

    It takes declarations of variables, lines of transitions, and as `extra` more lines of the machine.
    """

    def build(variables: str, *transitions: str, extra: str = "") -> Cefsm:
        lines = "\n".join(f"          {transition}" for transition in transitions)
        return parse_model(f"""
parcours: model/1
name: m
components:
  C:
    variables: {{{variables}}}
    machines:
      m:
        initial: a
{extra}
        transitions:
{lines}
""")

    return build
