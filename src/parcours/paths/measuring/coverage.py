"""Which requirements of a criterion the transitions taken meet, and which they miss."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from parcours.model.structure import Cefsm, Machine, Variable
from parcours.paths.criteria.communication import delivered, wiring
from parcours.paths.criteria.grammar import CoverageCriterion, parse_criterion
from parcours.paths.criteria.requirement import CoverageRequirement, RequirementLimits
from parcours.paths.criteria.requiring import demands, model_of, requirements
from parcours.paths.graph import Graph
from parcours.paths.measuring.answering import met_goals
from parcours.paths.measuring.recorded import looked_up, walks_of
from parcours.paths.measuring.tours import Tours, checked


@dataclass(frozen=True, slots=True)
class Coverage:
    """What a criterion requires, and how much of it was met; met and missed partition required."""

    criterion: str
    required: tuple[CoverageRequirement, ...]
    met: tuple[CoverageRequirement, ...]
    missed: tuple[CoverageRequirement, ...]

    @property
    def ratio(self) -> float:
        """The share of the requirements that were met [1]; 1 where nothing is required."""
        return len(self.met) / len(self.required) if self.required else 1.0


def measure(
    of: Machine | Cefsm | Graph, criterion: str | CoverageCriterion, *sequences: Sequence[str], tours: Tours = "direct",
    variables: Sequence[Variable] = (), limits: RequirementLimits | None = None,
) -> Coverage:  # fmt: skip
    """Return which requirements the sequences meet, seen machine by machine.

    A machine stands in its initial state before it moves, so that state counts as visited. Two transitions are a pair
    if the machine took them one after the other, whatever other machines did between. Where a sequence jumps (a machine
    was reset) nothing is toured across the jump, and values of variables are not known after it.

    Args:
        of: a machine, a model with all its machines, or the graph of a composition.
        sequences: transition ids, or moves of two as `p24+p16`, in the order in which they were taken, one sequence for
            each run.
        tours: direct, sidetrips or detours.
        variables: for data criteria on a machine: those of the component that runs it.
        limits: how many requirements are too many.

    Raises BadRequest: as for `requirements`; or a sequence names a transition that the model does not have.
    """
    checked(tours)
    chosen = parse_criterion(criterion) if isinstance(criterion, str) else criterion
    if chosen.family == "communication":
        return _communication(model_of(of, chosen), chosen, sequences, limits)
    asked = demands(of, chosen, variables, limits)
    walks = walks_of(of, [each.subject for each in asked], sequences)
    required = [goal.requirement for each in asked for goal in each.goals]
    answers = [yes for each, own in zip(asked, walks, strict=True) for yes in met_goals(each, own, tours)]
    if not sequences:  # nothing ran, so no machine stood in its initial state
        answers = [False] * len(required)
    return _coverage(chosen, required, answers)


def _coverage(
    criterion: CoverageCriterion, required: Sequence[CoverageRequirement], answers: Sequence[bool]
) -> Coverage:
    sides: dict[bool, list[CoverageRequirement]] = {True: [], False: []}
    for need, is_met in zip(required, answers, strict=True):
        sides[is_met].append(need)
    return Coverage(str(criterion), tuple(required), tuple(sides[True]), tuple(sides[False]))


def _communication(
    cefsm: Cefsm, criterion: CoverageCriterion, sequences: Sequence[Sequence[str]], limits: RequirementLimits | None
) -> Coverage:
    required = requirements(cefsm, criterion, limits=limits)
    wires = wiring(cefsm)
    known = {id: [id] for id in wires.sends}
    done: set[tuple[str, ...]] = set()
    for sequence in sequences:
        run = [id for taken in looked_up(cefsm.name, sequence, known) for id in taken]
        done |= delivered(wires, criterion.name, run)
    return _coverage(criterion, required, [need.steps in done for need in required])
