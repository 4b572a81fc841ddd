"""Values that make a serialised sequence over one component or several run, or what conflicts; and its times."""

from __future__ import annotations

from collections.abc import Sequence

from parcours.model.structure import Cefsm
from parcours.paths.criteria.requirement import CoverageRequirement
from parcours.paths.solving.verdicts import BUDGET, Covered, Infeasible, Path, Undecided, Verdict, Work, require_solver
from parcours.paths.timing.events import TimedEvent, events_of, places_of, taken_messages
from parcours.paths.timing.replaying import StepReplay
from parcours.paths.timing.schedules import Contradiction, Schedule, Unscheduled, schedule


def solve_sequence(
    cefsm: Cefsm, transition_ids: Sequence[str], instances: Sequence[int] = (), sends: Sequence[int | None] = (),
    budget: float = BUDGET,
) -> Verdict:  # fmt: skip
    """Return values under which a sequence runs from the initial state, or why there are none.

    A message that one of the transitions sends arrives with the values it was sent with; what no transition of the
    sequence sends, the tester supplies.

    Args:
        transition_ids: what is taken, in order, each machine from its initial state on. A rendezvous is its send
            followed by its receive.
        instances: for each transition which copy of its component takes it; empty if there is one of each.
        sends: for each transition the position, from 0, of the one whose message it takes, or None if the
            tester supplies it; empty for first in, first out on every channel inside the model.
        budget: most units of work (`Work`) for one question to the solver.

    Raises BadRequest: an id is unknown, a machine would go on from where it does not stand, or z3 is not installed.
    """
    events = events_of(cefsm, transition_ids, instances, sends)
    require_solver()
    from parcours.paths.solving.terms import NoTerm

    work = Work(budget)
    need = CoverageRequirement("", "transitions", tuple(transition_ids))
    try:
        found = _decided(cefsm, events, work)
    except NoTerm as reason:
        found = str(reason)
    if isinstance(found, str):
        return Undecided(need, found, round(work.spent))
    return Infeasible(need, found) if isinstance(found, tuple) else Covered(need, found)


def _decided(cefsm: Cefsm, events: Sequence[TimedEvent], work: Work) -> Path | tuple[str, ...] | str:
    """Return a path that runs, what conflicts, or why neither is known."""
    from parcours.paths.solving.reading import ModelTables
    from parcours.paths.solving.walk import SymbolicWalk

    ground, places = ModelTables(cefsm), places_of(cefsm, events)
    taken = frozenset(taken_messages(events))

    def walked(*, exact: bool, explain: bool) -> SymbolicWalk:
        walk = SymbolicWalk(ground, places, exact=exact, explain=explain, taken=taken, work=work)
        for event in events:
            walk.push(event)
        walk.finish()
        return walk

    walk = walked(exact=True, explain=False)
    answer = walk.check(work.budget)
    if answer:
        replay, why_not = StepReplay(cefsm), ""
        for inputs in (walk.inputs, walk.settled):
            run = replay.run(events, inputs())
            if not run.why_not:
                return Path(run.moves, ends=False)
            why_not = why_not or run.why_not
        return f"a solution did not run: {why_not}"
    if answer is False:
        # Once more, for reasons; and where reals are computed with, as floating point might round them.
        walk = walked(exact=not walk.rounds, explain=True)
        answer = walk.check(work.budget)
        if answer is False:
            return walk.core()
    return "rounding might make it run" if answer else f"the solver gave no answer within {work.budget:g} units of work"


def solved_schedule(
    cefsm: Cefsm, transition_ids: Sequence[str], instances: Sequence[int] = (), sends: Sequence[int | None] = (),
    budget: float = BUDGET,
) -> Schedule | Contradiction | Unscheduled:  # fmt: skip
    """Return when each transition of a sequence can be taken, under values that the solver finds where it needs some.

    Args and errors are those of `schedule` and `solve_sequence`.
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
