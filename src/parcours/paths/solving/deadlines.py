"""A sequence of transitions whose clocks are compared with data -> values that make it run, and its windows of time."""

from __future__ import annotations

from collections.abc import Sequence

from parcours.model.structure import Cefsm
from parcours.paths.solving.sequences import solve_sequence
from parcours.paths.solving.verdicts import Covered, Infeasible
from parcours.paths.timing.schedules import Contradiction, Schedule, Unscheduled, schedule


def solved_schedule(
    cefsm: Cefsm,
    transition_ids: Sequence[str],
    instances: Sequence[int] = (),
    sends: Sequence[int | None] = (),
    budget: float = 10.0,
) -> Schedule | Contradiction | Unscheduled:
    """Return when each transition of a sequence can be taken, under values that the solver finds where it needs some.

    Args:
        cefsm: the model.
        transition_ids: what is taken, in order, from the initial state of each machine on.
        instances: for each transition which copy of its component takes it; empty if there is one of each.
        sends: for each transition the position of the one whose message it takes; empty for first in, first out.
        budget: most time for the solver [s].

    Raises:
        BadRequest: as for `schedule` and `solve_sequence`.

    Example: how long the egg boils is the guest's choice, from 3 to 5 s.

    >>> from parcours.model import parse_model
    >>> egg = parse_model('''
    ... parcours: model/1
    ... name: egg
    ... components:
    ...   Egg:
    ...     variables: {x: {type: clock}, wish: {type: int, initial: 0, range: [0, 9]}, guest: {type: int, role: input}}
    ...     machines:
    ...       egg:
    ...         initial: raw
    ...         transitions:
    ...           ask: {from: raw, to: in, guard: guest >= 3 && guest <= 5, action: wish := guest; x := 0}
    ...           lift: {from: in, to: raw, guard: x >= wish}
    ... ''')
    >>> found = solved_schedule(egg, ["ask", "lift"])
    >>> found.earliest[1] - found.earliest[0] in (3.0, 4.0, 5.0)
    True
    """
    found = schedule(cefsm, transition_ids, instances, sends)
    if not isinstance(found, Unscheduled):
        return found
    solved = solve_sequence(cefsm, transition_ids, instances, sends, budget)
    if isinstance(solved, Infeasible):
        return Contradiction(solved.proof)
    if isinstance(solved, Covered):
        return schedule(cefsm, transition_ids, instances, sends, [move.inputs for move in solved.path.moves])
    return Unscheduled(f"{found.reason}; {solved.reason}")
