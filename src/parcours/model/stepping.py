"""The step relation of a model, with which every later stage agrees: a configuration and a move give the next one.

One move is one transition, or the two of a rendezvous. A transition takes its message, needs its guard, does
its actions in order, and then sends. What the model leaves open is the tester's choice:

- `input` variables, and fields of messages whose content is not modelled, may have any value at each step; a
  transition is enabled when its guard holds for some value of what is open (also when that cannot be
  decided);
- a receive from `environment` is always possible, and a send to it, or on a channel that nobody reads, never
  blocks;
- so it is with the channels called `opened`: there the tester stands in at both ends, and nothing is kept.

Other channels of capacity n hold n messages, and a send to a full one is not enabled. Capacity 0 is a
rendezvous.

    Configuration               states           values   queues            one step: move p12 of machine f
    before                  (planning, idle)     (3,)     ((ask1,),)        f: planning ─p12─> waiting
    after                   (waiting,  idle)     (4,)     ((ask1, ask2),)   p12 does n := n + 1 and sends ask
"""

from __future__ import annotations

from collections.abc import Mapping, Set

from parcours.model.configuration import Configuration, Move
from parcours.model.steps import StepRelation
from parcours.model.structure import Cefsm

_recent: list[StepRelation] = []
_RECENT = 8


def initial(cefsm: Cefsm) -> Configuration:
    """Return the configuration in which every machine stands in its initial state and every queue is empty."""
    return _steps(cefsm, frozenset()).layout.initial()


def enabled(
    cefsm: Cefsm, configuration: Configuration, inputs: Mapping[str, object] | None = None,
    opened: Set[str] = frozenset(),
) -> tuple[Move, ...]:  # fmt: skip
    """Return the moves that can be taken, in the order of the file, each with a choice that allows it.

    A transition whose assignments or messages use what is open appears once for each value of a finite
    domain, and for some representatives of an infinite one.

    Args:
        inputs: values of input variables, as 'Component.variable'; those left out are open.
        opened: channels at both ends of which the tester stands in.

    Raises:
        BadRequest: a name among the inputs, or an opened channel, is unknown.
        BadModel: a guard that reads nothing open has no value (division by zero, overflow).
    """
    return _steps(cefsm, frozenset(opened)).enabled(configuration, inputs or {})


def step(cefsm: Cefsm, configuration: Configuration, move: Move, opened: Set[str] = frozenset()) -> Configuration:
    """Return the configuration after a move.

    Args:
        move: what to do, as `enabled` returned it with the same `opened`.
        opened: channels at both ends of which the tester stands in.

    Raises:
        BadRequest: the move is not possible here: wrong state, a false guard, nothing to receive, no room to
            send.
        BadModel: an assigned value leaves the domain of its variable, or cannot be computed.
    """
    return _steps(cefsm, frozenset(opened)).step(configuration, move)


def _steps(cefsm: Cefsm, opened: frozenset[str]) -> StepRelation:
    # Tables are kept for the models in use, found by identity: comparing models costs more than a step.
    for steps in _recent:
        if steps.layout.cefsm is cefsm and steps.layout.opened == opened:
            return steps
    _recent.insert(0, StepRelation(cefsm, opened))
    del _recent[_RECENT:]
    return _recent[0]
