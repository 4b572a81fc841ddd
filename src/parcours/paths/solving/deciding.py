"""Decides what of a machine can be covered, with the values that make it so; what cannot, and why.

First the state space of the component is searched, as far as it is small; what is met there is covered, and if all
of it was seen, the rest is infeasible. Then the solver looks for conflicts, and for longer paths.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING

from parcours.errors import require_known
from parcours.model.configuration import Inputs, Move
from parcours.model.structure import Cefsm, Component, Machine
from parcours.paths.criteria import requirements
from parcours.paths.criteria.requirement import CoverageRequirement
from parcours.paths.graph import graph_of
from parcours.paths.solving import verdicts
from parcours.paths.solving.exploring import Exploration, Explored, Node, Targets
from parcours.paths.solving.verdicts import BUDGET, BudgetSpent, Executability, Path, Work, has_solver
from parcours.paths.spaces import part_of
from parcours.paths.timing.events import events_of
from parcours.paths.timing.replaying import StepReplay
from parcours.paths.timing.schedules import Contradiction, Schedule, schedule
from parcours.paths.timing.time_constraints import is_timed

if TYPE_CHECKING:
    from parcours.paths.solving.proving import Prover
    from parcours.paths.solving.searching import PathSearch, Prefixes

    Found = tuple[tuple[str, ...], tuple[Inputs, ...]]

MOST_STATES = 20_000
"""State spaces up to this size are searched exactly."""

MOST_CHECKS = 1_000_000
"""Most questions to the solver before a search for one more path is given up."""

WAYS_FOR_PROOF, WAYS_FOR_REASONS = 120, 6
"""Most ways back that are looked at for one proof, and where it is only to say why."""

EXTENSION_CHECKS = 40
"""Most questions to the solver to make a path longer that has met something, before another is begun."""

SEEN = "none of the {} states that can be reached allows it"

Report = Callable[[str, int, int], None]
"""Called with (what, done, in all) while work goes on."""


def solve(
    cefsm: Cefsm, component: str, machine: str, wanted: str | Sequence[CoverageRequirement], budget: float = BUDGET,
    seed: int = 0, complete: bool = True, report: Report | None = None,
) -> Executability:  # fmt: skip
    """Return which requirements of one machine can be met, by few paths that run, and which cannot.

    The tester stands in at both ends of every channel that leaves the component. Paths found in the state space
    may let other machines of the component move too; in paths that the solver finds they stand still. What is
    found infeasible is infeasible whatever they do.

    Args:
        wanted: a coverage criterion, or requirements: states, sequences of transitions, du-paths.
        budget: most units of work (`Work`, some 1 ms each); what is not decided by then is undecided.
        complete: whether paths go on to where a test may end, where they can.
        report: called as the work goes on.

    Raises BadRequest: the component, the machine, the criterion or something a requirement names is unknown.
    """
    owner, found = _owner(cefsm, component, machine)
    needs = requirements(found, wanted, variables=owner.variables) if isinstance(wanted, str) else wanted
    return _Solving(cefsm, owner, found, needs, budget, report).run(seed, complete=complete)


class _Verifier:
    """Runs paths of one machine through the step relation of its component."""

    def __init__(self, cefsm: Cefsm, component: Component, machine: Machine, finals: Collection[str]) -> None:
        self._cefsm, self._name, self._machine, self._finals = cefsm, component.name, machine, finals
        self._targets = {transition.id: transition.target for transition in machine.transitions}
        self._timed, self._replay = is_timed(component), StepReplay(cefsm)

    def runs(self, ids: Sequence[str], inputs: Sequence[Inputs]) -> bool:
        """Return whether transitions run with inputs; clock readings among these are taken to be in time."""
        return not self._replay.run(events_of(self._cefsm, ids), inputs).why_not

    def path(self, moves: Sequence[Move], *, in_time: bool = False) -> Path | None:
        """Return the path that makes these moves, with clock readings that are in time; None if it does not run."""
        path = Path(tuple(moves))
        if not self.runs(path.ids, path.inputs):
            return None
        if self._timed:
            found = schedule(self._cefsm, path.ids, inputs=path.inputs)
            timely = self._read(moves, found) if isinstance(found, Schedule) else None
            if timely is not None and self.runs(timely.ids, timely.inputs):
                path = timely
            elif not in_time or isinstance(found, Contradiction):
                return None
        return Path(path.moves, self.ends(path.ids))

    def ends(self, ids: Sequence[str]) -> bool:
        """Return whether the machine may end a test after these transitions."""
        ours = [id for id in ids if id in self._targets]
        return (self._targets[ours[-1]] if ours else self._machine.initial) in self._finals

    def _read(self, moves: Sequence[Move], found: Schedule) -> Path:
        readings, timely = iter(found.readings), []
        for move in moves:
            inputs = dict(move.inputs)
            for _ in range(2 if move.partner else 1):
                inputs |= {f"{self._name}.{name}": value for name, value in next(readings).items()}
            timely.append(Move(move.transition, move.partner, tuple(sorted(inputs.items()))))
        return Path(tuple(timely))


# Each step may spend a share of what is left of the budget when it starts; what it does not need goes to the next.
#
#   state space   bounds of    conflicts,    longer    conflicts,     longer paths
#   (no solver) > variables >  short look >  paths  >  long look  >   with all that is left
#      60 %         20 %          30 %        50 %        50 %
#
# The state space comes first because what it finds has run already; proofs come before long searches because a search
# for what is impossible ends only with its budget.
class _Solving:
    def __init__(
        self, cefsm: Cefsm, owner: Component, machine: Machine, needs: Sequence[CoverageRequirement], budget: float,
        report: Report | None,
    ) -> None:  # fmt: skip
        self.owner, self.machine, self.needs = owner, machine, tuple(dict.fromkeys(needs))
        self.work, self.report = Work(budget), report
        self.model = part_of(cefsm, owner.name)
        self.targets = Targets(machine, self.needs)
        graph = graph_of(machine)
        self.finals = frozenset(graph.states[state] for state in graph.finals)
        self.verifier = _Verifier(self.model, owner, machine, self.finals)
        self.open = dict.fromkeys(self.needs)
        self.covered: dict[CoverageRequirement, Path] = {}
        self.infeasible: dict[CoverageRequirement, tuple[str, ...]] = {}

    def run(self, seed: int, *, complete: bool) -> Executability:
        """Return the verdicts."""
        share = 0.6 if has_solver() else 1.0
        until = self.work.after(share)
        explorer = Exploration(self.model, self.targets, self.finals, MOST_STATES, self.work, until)
        explored = explorer.runs(complete=complete)
        if self.targets.at(self.targets.start()):
            self._take(self.verifier.path(()))  # the start needs no transition, which might not come in time
        for run in explored.runs:
            self._take(self.verifier.path(run))
        if has_solver():
            reason = self._by_solver(explored, seed, complete=complete)
        else:
            self._exclude(self._unreached(explored), lambda need: (SEEN.format(explored.n_states),))
            reason = f"{explored.doubt or 'a path to it did not run in time'}; z3, which might tell, is not installed"
        return self._verdicts(reason)

    def _by_solver(self, explored: Explored, seed: int, *, complete: bool) -> str:
        """Look for proofs and for longer paths, in turns; return why what is still open stays undecided."""
        if not self.open:
            return ""
        from parcours.paths.solving.proving import Prover, bounds_of
        from parcours.paths.solving.reading import ModelTables
        from parcours.paths.solving.searching import PathSearch, Prefixes

        ground = ModelTables(self.model)
        prover = Prover(
            ground, self.owner, self.machine, seed,
            bounds_of(ground, self.owner, self.work, self.work.after(0.2)), self.work,
        )  # fmt: skip
        until = self.work.after(0.3)
        # What is infeasible for sure is worth a look for reasons, no more.
        self._exclude(
            self._unreached(explored),
            lambda need: prover.proof(need, until, WAYS_FOR_REASONS) or (SEEN.format(explored.n_states),),
        )
        self._exclude(list(self.open), lambda need: prover.proof(need, until, 1))
        prefixes = Prefixes(ground, self.owner, self.machine, seed, self.work)
        root = PathSearch(prefixes, self.targets, (), self.verifier.runs)
        prefixes.until = self.work.after(0.5)
        reason = self._grow(prefixes, root, prover, complete=complete)
        until = self.work.after(0.5)
        self._exclude(list(self.open), lambda need: prover.proof(need, until, WAYS_FOR_PROOF))
        prefixes.until = self.work.budget
        return self._grow(prefixes, root, prover, complete=complete) if self.open else reason

    def _unreached(self, explored: Explored) -> list[CoverageRequirement]:
        """Return what no run meets, where all that can happen was seen."""
        reached = {need for run in explored.runs for need in self.targets.met(Path(run).ids)}
        return [need for need in self.open if need not in reached] if not explored.doubt else []

    def _exclude(
        self, needs: Sequence[CoverageRequirement], proof: Callable[[CoverageRequirement], tuple[str, ...] | None]
    ) -> None:
        """Note what is infeasible."""
        for need in needs:
            if (found := proof(need)) is not None:
                self.infeasible[need] = found
                self.open.pop(need, None)
                self._tell()

    def _grow(self, prefixes: Prefixes, root: PathSearch, prover: Prover, *, complete: bool) -> str:
        """Cover what is left by paths that the solver finds; return why the rest stays undecided."""
        try:
            while self.open and (found := root.onward(self._meets, MOST_CHECKS)) is not None:
                ids = found[0]
                longer: Found | None = found
                while longer is not None:
                    found, ids = longer, longer[0]
                    for need in self.targets.met(ids):
                        self.open.pop(need, None)
                    longer = self._extended(root.beginning(ids), self._meets)
                if complete and not self.verifier.ends(ids):
                    found = self._extended(root.beginning(ids), lambda node: node[0] in self.finals) or found
                moves = [Move(id, "", chosen) for id, chosen in zip(*found, strict=True)]
                self._take(self.verifier.path(moves, in_time=True))
        except BudgetSpent:
            return f"the budget of {self.work.budget:g} units was spent, {prefixes.checks} questions to the solver"
        if prefixes.doubt:
            return prefixes.doubt
        tried = f"none of the paths that can run comes to it, of {prefixes.checks} tried"
        until = self.work.after(0.5)
        self._exclude(list(self.open), lambda need: prover.proof(need, until, WAYS_FOR_PROOF) or (tried,))
        return ""

    def _extended(self, search: PathSearch, wanted: Callable[[Node], bool]) -> Found | None:
        try:
            return search.onward(wanted, EXTENSION_CHECKS)
        except BudgetSpent:
            return None

    def _meets(self, node: Node) -> bool:
        return not self.open.keys().isdisjoint(self.targets.at(node))

    def _take(self, path: Path | None) -> None:
        for need in self.targets.met(path.ids) if path is not None else ():
            assert path is not None
            self.open.pop(need, None)
            if need not in self.covered or not self.covered[need].moves:
                self.covered[need] = path
        self._tell()

    def _tell(self) -> None:
        if self.report is not None:
            self.report("requirements decided", len(self.needs) - len(self.open), len(self.needs))

    def _verdicts(self, reason: str) -> Executability:
        spent = round(self.work.spent)
        return Executability(
            tuple(verdicts.Covered(need, self.covered[need]) for need in self.needs if need in self.covered),
            tuple(verdicts.Infeasible(need, self.infeasible[need]) for need in self.needs if need in self.infeasible),
            tuple(
                verdicts.Undecided(need, reason or "a path to it did not run in time", spent)
                for need in self.needs
                if need not in self.covered and need not in self.infeasible
            ),
            tuple(dict.fromkeys(self.covered[need] for need in self.needs if need in self.covered)),
            spent,
        )


def _owner(cefsm: Cefsm, component: str, machine: str) -> tuple[Component, Machine]:
    owners = {each.name: each for each in cefsm.components}
    require_known(component, list(owners), "component", slug="unknown-component")
    machines = {each.name: each for each in owners[component].machines}
    require_known(machine, list(machines), f"machine of {component!r}", slug="unknown-machine")
    return owners[component], machines[machine]
