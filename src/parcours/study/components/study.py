"""A component study: abstract cases of a model, filled with data, enforced on whatever stands for the components.

What a study leaves out has a default: edge coverage, every abstract case once or as often as Each Choice needs,
messages and input variables under which the guards of a case hold, and an oracle that wants the order kept.
"""

from __future__ import annotations

import copy
import dataclasses
import functools
import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from parcours.abtc import (
    MARK,
    AbstractCase,
    Event,
    Visits,
    as_one_instance,
    ask_alone,
    in_order,
    order_names,
    parse_orders,
    serialise,
)
from parcours.data import InputModel
from parcours.errors import BadSuite
from parcours.model.structure import Cefsm
from parcours.run.in_process import View
from parcours.run.port import links
from parcours.run.recording import PayloadCodec as RecordingCodec
from parcours.run.trace import Trace, durations
from parcours.study import protocol
from parcours.study.components.executing import Exercise, TimingGroup, whole_case
from parcours.study.components.messages import ModelMessages
from parcours.study.components.options import host_parameters
from parcours.study.components.references import Relation
from parcours.study.components.results import PER_CASE
from parcours.study.components.selecting import Selection, select_cases
from parcours.study.components.simple import is_full
from parcours.study.components.stimuli import Chooser, Formulas, Stimuli
from parcours.study.components.systems import PATIENCE, PythonPart, System
from parcours.study.components.tester import StudyTester, Tester
from parcours.study.hosting import Nodes
from parcours.study.loading import members_of
from parcours.study.parameters import Parameter, Scalar, Settings, natural_values
from parcours.study.protocol import Judged, Progress, Rejudged, Reported, Request, Results, Run, StudyFinding
from parcours.suite import Case, Plan, combine
from parcours.verdict.conformance import NOTHING, Allowance
from parcours.verdict.contracts import contracts_of, plain
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import NEVER, Bound

NO_INPUTS = InputModel("no inputs", ())  # the test inputs of a study that has none: each abstract case is one case
_CHOICES = 10_000  # cases whose stimuli are remembered
_TIMED = 5  # abstract cases that are timed for each limit, evenly spread

Oracle = Callable[[Case, Trace, Settings], Judgement]


@dataclass(frozen=True, slots=True)
class Limit:
    """A bound on how long an interaction path takes, or the way from one transition to the next of another."""

    name: str  # of the interaction path, or of the limit
    bound: Bound  # the limit
    begin: str = ""  # the transition from whose end it counts; empty for whole cases of the interaction path
    end: str = ""  # the transition at whose end it is over


def order_is_kept(case: Case, trace: Trace, settings: Settings) -> Judgement:
    """Pass: an oracle is asked only when every transition was taken in its turn."""
    n = sum(event.kind == "take" for event in trace.events)
    return Judgement(Verdict.PASS, f"all {n} transitions were taken in their order")


@dataclass(frozen=True, eq=False)
class ComponentStudy:
    """A study of components (`parcours.study.protocol.Study`)."""

    name: str  # first part of every case id
    model: Cefsm  # the behavioural and the structural model
    system: System | None  # what makes the components
    inputs: InputModel = NO_INPUTS  # test inputs; without any, each abstract case is one case
    doc: str = ""  # a sentence about the study
    where: str = ""  # how a command line names it; empty for an object that no other process can find
    own: tuple[Parameter, ...] = ()  # parameters of its own
    criterion: str = "each_choice"  # how blocks of inputs are combined
    paths: str = "edge"  # coverage criterion of the internal paths
    policy: str = ""  # of serialisation; the model's if empty
    alone: bool = False  # whether paths that hear from their peers only are asked by the tester, too (`ask_alone`)
    n_cases: int | None = None  # how many cases are run by default; None for what the criterion needs
    time_budget: float = 20.0  # of a case [s]
    supply: Formulas = field(default_factory=dict)  # formulas for fields of the environment's messages
    set_before: Formulas = field(default_factory=dict)  # formulas for input variables before a transition
    oracles: tuple[Oracle, ...] = (order_is_kept,)  # judge a case whose order was kept; all must pass
    relations: tuple[Relation, ...] = ()  # between two runs of a case, in simulated time
    limits: tuple[Limit, ...] = ()  # bounds on durations
    # what its results depend on beside its settings: name of a file -> digest
    digests: Mapping[str, str] = field(default_factory=dict)
    files: Mapping[str, Path] = field(default_factory=dict)  # where its model and its data lie
    patience: float = PATIENCE  # longest turn [s of wall clock]
    mutants: tuple[str, ...] = ()  # files and modules that mutants are made of; empty for those of its components
    allowance: Allowance = NOTHING  # what its components may do beside the model, where conformance is judged

    kind = "components"
    trusted = False  # Whether components run in this process: only those that ship with Parcours do
    compiles = False  # Whether kernels are compiled before the first case

    @property
    def family(self) -> str:
        """Component studies are reported together."""
        return "components"

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of every component study, then its own."""
        return host_parameters(*self.own)

    @functools.cached_property
    def _selection(self) -> Selection:
        return select_cases(self.model, self.paths, self.policy, Chooser(self.model, self.messages, {}, {}, {}))

    @functools.cached_property
    def abstracts(self) -> Mapping[str, AbstractCase]:
        """The abstract cases by id, those that are infeasible left out. Raises BadModel if there are none."""
        return self._selection.cases

    @functools.cached_property
    def infeasible(self) -> Mapping[str, str]:
        """The abstract cases whose guards cannot hold together whatever the tester chooses, and why."""
        return self._selection.infeasible

    @property
    def untaken(self) -> frozenset[tuple[str, str]]:
        """Component and id of each transition that only infeasible cases would take."""
        return self._selection.untaken

    @functools.cached_property
    def messages(self) -> ModelMessages:
        """The messages of the model."""
        return ModelMessages(self.model)

    @functools.cached_property
    def _chooser(self) -> Chooser:
        limits = {
            domain.name: (domain.blocks[0].first, domain.blocks[-1].last)
            for domain in self.inputs.domains
            if not domain.values
        }
        return Chooser(self.model, self.messages, self.supply, self.set_before, limits)

    def plan(self, seed: int, n_cases: int | None = None) -> Plan:
        """Return the plan of the first `n_cases` cases."""
        return combine(
            self.name, tuple(self.abstracts), self.inputs, criterion=self.criterion, time_budgets=(self.time_budget,),
            seed=seed, n_cases=n_cases or self.n_cases,
        )  # fmt: skip

    def suite(self, settings: Settings, seed: int, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the cases, each in the orders that are wanted; each has the data that it has without them."""
        cases = self.plan(seed, n_cases).cases()
        return itertools.islice(self.in_orders(cases, settings), n_cases)

    def in_orders(self, cases: Iterable[Case], settings: Settings) -> Iterator[Case]:
        """Yield each case in all orders that are wanted, the ways of enforcing it that differ; one that has one, as is.

        Raises BadRequest: the setting is wrong, or a case has too many orders.
        """
        wanted = parse_orders(str(settings["orders"])) if settings.get("orders") else None
        for case in cases:
            if wanted is None or MARK in case.abstract:
                yield case
                continue
            seen = set()
            for name in order_names(case.abstract, self._events(case.abstract), wanted, case.seed):
                one = dataclasses.replace(case, abstract=f"{case.abstract}{MARK}{name}")
                enforced = self.visits(one, settings).enforced
                if (key := tuple((event.reference, event.transition) for event in enforced)) not in seen:
                    seen.add(key)
                    yield one

    @property
    def recorded(self) -> RecordingCodec:
        """How its messages are recorded."""
        return self.messages

    def nodes(self) -> Nodes:
        """Return how its components become nodes."""
        room = "parcours.study.components.node_program"
        names = tuple(component.name for component in self.model.components)
        return Nodes(
            self.model, links(self.model), names, f"{room}:StudyNodeProgram", self.messages,
            f"{room}:ros1_node_program", f"{room}:ros1_codec", (room,), self.where, self.fields,
            self.messages.specimens,
        )  # fmt: skip

    def exercise(self, settings: Settings, *, timed: bool = False) -> Exercise:
        """Return what executing and judging its cases needs, the parameters being set; timed are interactions only."""
        return Exercise(
            lambda case: self.visits(case, settings, timed=timed).enforced,
            functools.partial(self.tester, settings=settings, timed=timed),
            functools.partial(self.oracle, settings=settings),
            functools.partial(self.contradiction, settings=settings),
            self.view(),
            contracts_of(self.model),
            self.fields,
            self.relations,
        )

    def fields(self, channel: str, payload: object) -> Mapping[str, object] | None:
        """Return a payload as the model's message. Raises BadRequest if it is not one."""
        return plain(channel, payload)

    def known(self, case: Case, settings: Settings) -> dict[str, Scalar]:
        """Return what formulas, constructors and programs may read: parameters and test inputs by name."""
        return {**settings, **natural_values(self.inputs, case)}

    def tester(self, case: Case, settings: Settings, *, timed: bool = False) -> Tester:
        """Return the tester of a case."""
        assert self.system is not None
        known, visits = self.known(case, settings), self.visits(case, settings, timed=timed)
        stimuli = copy.deepcopy(self._stimuli(case, settings, timed=timed).of)  # components may change a message
        components = {component.name: component for component in self.model.components}
        early = {at: [visits.events[one] for one in those] for at, those in visits.early.items()}
        return StudyTester(self.system, components, case, settings, known, stimuli, early)

    def contradiction(self, case: Case, settings: Settings) -> str:
        """Return why no choice of the tester's can make this case run with its data and formulas; empty if one can."""
        try:
            self.visits(case, settings)
        except BadSuite as error:
            return f"{error.rule}; {error.remedy}"
        return "" if self.system is None else self._stimuli(case, settings).infeasible

    def _stimuli(self, case: Case, settings: Settings, *, timed: bool = False) -> Stimuli:
        """Return what the tester chooses for a case; it is remembered, since some choices take a second to find."""
        key = case.abstract, case.seed, case.values, timed, tuple(sorted(settings.items()))
        if key not in self._chosen:
            if len(self._chosen) >= _CHOICES:
                self._chosen.clear()
            visits = self.visits(case, settings, timed=timed)
            self._chosen[key] = self._chooser.stimuli(visits.events, self.known(case, settings), visits.again)
        return self._chosen[key]

    @functools.cached_property
    def _chosen(self) -> dict[object, Stimuli]:
        return {}

    def order_of(self, abstract: str) -> tuple[Event, ...]:
        """Return the events of an abstract case."""
        return self._events(abstract)

    @functools.lru_cache(maxsize=256)  # noqa: B019 - a study lives as long as its process
    def _events(self, abstract: str, order: str = "", seed: int = 0) -> tuple[Event, ...]:
        return in_order(abstract, serialise(self.abstracts[abstract]), order, seed)

    @functools.lru_cache(maxsize=256)  # noqa: B019 - as above
    def _visits(self, abstract: str, order: str, seed: int, alone: bool, one_instance: bool) -> Visits:
        events = self._events(abstract, order, seed)
        events = ask_alone(events) if alone else events
        return as_one_instance(events, self.takes_any_time) if one_instance else Visits(events)

    def visits(self, case: Case, settings: Settings, *, timed: bool = False) -> Visits:
        """Return the events of a case with these instances, and what comes beside them.

        Timed, each visit is an instance of its own: visits that overlap are what is timed.

        Raises BadSuite: the study has no such abstract case, or it cannot run with one instance of each component.
        """
        abstract, _, order = case.abstract.partition(MARK)
        if abstract not in self.abstracts:
            rule = f"a case must be one that the study has, but no abstract case of {self.name} is called like that"
            raise BadSuite(f"case {case.id!r}", rule, "write the suite again with this version", slug="foreign-case")
        one_instance = settings.get("instances") == PER_CASE and not timed
        return self._visits(abstract, order, case.seed if order else 0, self.alone and not timed, one_instance)

    def events(self, case: Case) -> tuple[Event, ...]:
        """Return the events of a case, with one instance per visit. Raises BadSuite if it is no case of the study."""
        return self.visits(case, {}).events

    def takes_any_time(self, component: str) -> bool:
        """Return whether a component is handed messages while it is busy: one that keeps the port itself.

        A class in a file must say so in its own body: the file is parsed, not run.
        """
        part = getattr(self.system, "parts", {}).get(component)
        if not isinstance(part, PythonPart):
            return False
        if isinstance(part.target, str):
            return members_of(part.target, part.folder) >= {"handle", "next_wake", "wake", "reset"}
        return is_full(part.target)

    def view(self) -> View:
        """Return what shows something of an instance at the end of a case: nothing."""
        return lambda component: None

    def oracle(self, case: Case, trace: Trace, settings: Settings) -> Judgement:
        """Judge a case whose order was kept: the first oracle that does not let it pass decides."""
        judgement = Judgement(Verdict.PASS, "")
        for oracle in self.oracles:
            judgement = oracle(case, trace, settings)
            if not judgement.passed:
                return judgement
        return judgement

    def timing(self, seed: int, settings: Settings) -> list[TimingGroup]:
        """Return what is timed: for each limit a few abstract cases, evenly spread."""
        plan = self.plan(seed)
        groups = []
        for limit in self.limits:
            ids = self.limited(limit)
            chosen = [ids[k * len(ids) // min(_TIMED, len(ids))] for k in range(min(_TIMED, len(ids)))]
            cases = tuple((plan.case(plan.number(one, 0)), limit.bound) for one in chosen)
            span = whole_case if not limit.begin else functools.partial(span_of, begin=limit.begin, end=limit.end)
            if cases:
                groups.append(TimingGroup(limit.name, cases, span))
        return groups

    def limited(self, limit: Limit) -> list[str]:
        """Return the ids of the abstract cases that a limit is about."""
        if not limit.begin:
            return [id for id, case in self.abstracts.items() if case.interaction.name == limit.name]
        taken = {id: [event.transition for event in self._events(id)] for id in self.abstracts}
        return [id for id, ids in taken.items() if limit.begin in ids and limit.end in ids[ids.index(limit.begin) :]]

    def run(self, request: Request, progress: Progress) -> Run:
        """Execute cases and keep the results (`parcours.study.components.running`)."""
        from parcours.study.components.running import run_study

        return run_study(self, request, progress)

    def measure_names(self, settings: Settings) -> tuple[str, ...]:
        """Return what `--fail-if` may ask for; timing cases have durations."""
        return "failed", "passed", "inconclusive", "errors", "duration"

    def read(self, folder: Path) -> Results:
        """Return the results in a folder."""
        from parcours.study.components.running import read_results

        return read_results(self, folder)

    def report(self, results: Mapping[str, Results]) -> Reported:
        """Return tables, pieces and documents on component results."""
        from parcours.study.components.running import report_results

        return report_results(results)

    def judge(self, case: Case, settings: Settings) -> Judged:
        """Execute one case again, in simulated time, and judge it."""
        self._require_same(case)
        from parcours.study.components.running import run_again

        judgement, trace = run_again(self, case, settings)
        taken = [event.transition for event in trace.events if event.kind == "take"]
        facts = (
            ("interaction", self.abstracts[case.abstract.partition(MARK)[0]].interaction.name),
            ("taken", " ".join(taken)),
        )
        command = f"parcours run {self.where or self.name} --seed {case.seed} --case {case.id} --out out"
        return Judged(case, judgement.verdict, judgement.why, facts, f"{command} && parcours replay out {case.id}")

    def _require_same(self, case: Case) -> None:
        """Raise BadSuite unless this is a case that the study has, with the values that its seed gives."""
        self.events(case)
        plan = self.plan(case.seed, case.number + 1)
        abstract = case.abstract.partition(MARK)[0]
        if plan.case(case.number) != dataclasses.replace(case, abstract=abstract, time_budget=self.time_budget):
            rule = f"a case must be one that the study has, but case {case.number} of seed {case.seed} is another"
            raise BadSuite(f"case {case.id!r}", rule, "write the suite again with this version", slug="foreign-case")

    def rejudge(self, recording: Path) -> Rejudged:
        """Judge a recording by what is recorded alone."""
        from parcours.study.components.archive import rejudge

        return rejudge(self, recording)

    def faults(self, request: protocol.FaultRequest, progress: Progress) -> protocol.FaultReport:
        """Execute cases under faults on purpose (`parcours.study.components.faults`)."""
        from parcours.study.components.faults import strike

        return strike(self, request, progress)

    def check(self, progress: Progress) -> Sequence[StudyFinding]:
        """Run the battery for its author."""
        from parcours.study.components.battery import check_study

        return check_study(self, progress)


def span_of(trace: Trace, begin: str, end: str) -> int:
    """Return the longest time from a taking of `begin` to the next taking of `end` [ns]; `NEVER` if there is none."""
    if any(one.kind == "deviation" for one in trace.events):
        return NEVER
    return max(durations(trace, begin, end), default=NEVER)
