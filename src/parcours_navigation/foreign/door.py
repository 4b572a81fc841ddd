"""Foreign nodes behind a binding (docs/bindings.md) as every command meets a study.

Cases run in a process apart (`apart`), and are kept one by one, so that a run that was stopped goes on.
"""

from __future__ import annotations

import dataclasses
import itertools
import json
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from parcours.abtc import MARK, parse_orders
from parcours.errors import BadRequest, BadResults, BadSuite, ParcoursError, one_of
from parcours.report.pieces import Piece, Table
from parcours.run.atomic import require_writable, write_atomically
from parcours.run.binding import Binding
from parcours.run.campaign import terminable
from parcours.run.faults import read_plan
from parcours.run.locations import require_folder
from parcours.run.recording.topic import no_bag
from parcours.study.journal import Journal, read_question, write_question
from parcours.study.parameters import Parameter, Settings
from parcours.study.protocol import Judged, Progress, Rejudged, Reported, Request, Run, StudyFinding
from parcours.suite import Case
from parcours.verdict.judgement import Verdict
from parcours.verdict.timing import parse_bound
from parcours_navigation.cases.family import SystemCases
from parcours_navigation.foreign.abstract import PATIENCE
from parcours_navigation.foreign.cases import AbstractScene, abstract_scenes, find_scenes, in_orders
from parcours_navigation.foreign.checking import check_nodes, check_types, is_own
from parcours_navigation.foreign.isolation import ProcessOrder, run_apart
from parcours_navigation.foreign.results import RosResults, machines, tables, waterfalls
from parcours_navigation.foreign.timing import spans

if TYPE_CHECKING:
    from parcours.study.protocol import Results

FILE = "results.json"
_FORMAT = "ros/2"
SYSTEM = "system"
"""What stands for the abstract case in the id of a system case; its row is the number of the case."""

PARAMETERS = (
    Parameter(SYSTEM, "int", 0, "system cases to run after the abstract ones", low=0, high=100_000, decides=False),
    Parameter("protocol", "text", "table-vii", "how obstacles move in system cases",
              choices=("table-vii", "published", "empty")),
    Parameter("orders", "text", "", "of each abstract case to try beside its own: all, N, or pct:d or pct:d:N"),
    Parameter("repeats", "int", 0, "of each span that `timing` of the binding bounds", low=0, high=1_000_000),
    Parameter("faults", "text", "", "a file of faults, or lines: 'Planner: crash at 3 s'"),
    Parameter("record", "text", "", "keep a recording of every case", choices=("", "mcap", "bag"), decides=False),
    Parameter("master", "text", "", "address of a running ROS 1 master; else one of its own", decides=False),
    Parameter("network", "text", "own", "whether its own master and the nodes are isolated from the network",
              choices=("own", "shared"), decides=False),
)  # fmt: skip


@dataclass(frozen=True)
class RosStudy:
    """Foreign nodes behind a binding (`parcours.study.protocol.Study`).

    Args:
        name: first part of every case id.
        binding: of any transport.
        doc: a sentence about the study.
        where: how a command line names it.
        n_cases: how many abstract cases are run by default; None for each once.
        defaults: other defaults of parameters.
        digests: what its results depend on beside its settings: name of a file -> digest.
    """

    name: str
    binding: Binding
    doc: str = ""
    where: str = ""
    n_cases: int | None = None
    defaults: Mapping[str, object] = field(default_factory=dict)
    digests: Mapping[str, str] = field(default_factory=dict)

    kind = "ros"
    family = "ros"

    @property
    def parameters(self) -> Sequence[Parameter]:
        """System cases, timing, faults, recordings, and where the nodes run."""
        given = self.defaults
        return tuple(dataclasses.replace(one, default=one.read(given.get(one.name, one.default))) for one in PARAMETERS)

    @property
    def files(self) -> Mapping[str, Path]:
        """Where its model and its data lie."""
        found = {"model": self.binding.model.source, "data": self.binding.data_file}
        return {kind: Path(file) for kind, file in found.items() if file}

    def suite(self, settings: Settings, seed: int, n_cases: int | None = None) -> Iterator[Case]:
        """Yield the abstract cases, of which there are `n_cases`, then the system cases."""
        abstract = self._abstract(seed, self.n_cases if n_cases is None else n_cases, str(settings["orders"]))
        system = (self._system(k, settings, seed) for k in range(int(settings[SYSTEM])))
        for number, case in enumerate(itertools.chain(abstract, system)):
            yield dataclasses.replace(case, number=number)

    def run(self, request: Request, progress: Progress) -> Run:
        """Run the cases that are missing in a folder, then the timing, unless cases were chosen.

        Raises:
            BadRequest: the folder cannot be written to, or a chosen case is not the study's.
            BadResults: it holds another run.
            HostFailure: ROS or the nodes cannot be had here.
        """
        settings, out = request.settings, request.out
        cases = self._chosen(request) if request.chosen else list(self.suite(settings, request.seed, request.n_cases))
        ids = [case.id.partition("/")[2] for case in cases]
        timing = [] if request.chosen else self._limits(settings)
        if settings["record"] == "bag" and self.binding.transport == "ros2":
            raise no_bag("--record bag")
        require_folder(out)
        require_writable(out)
        decides = {one.name: settings[one.name] for one in self.parameters if one.decides}
        decides["faults"] = str(read_plan(str(settings["faults"]))) if settings["faults"] else ""
        question = {"form": _FORMAT, "seed": request.seed, "settings": decides, "files": dict(self.digests)}
        write_question(out, self.name, self.where, question)
        planned = len(ids) + len(timing)
        write_atomically(out / FILE, (json.dumps({"parcours": _FORMAT, "planned": planned}) + "\n").encode())
        interrupted = False
        with Journal(out) as journal, terminable():
            wanted = [*ids, *timing]
            try:
                for entry in self._missing(ids, timing, journal, request):
                    journal.add(str(entry["id"]), entry)
                    progress(f"cases, {self.binding.transport}", sum(id in journal.done for id in wanted), planned)
            except KeyboardInterrupt:
                interrupted = True
            n = sum(id in journal.done for id in wanted)
        if interrupted:
            text = f"interrupted: {n} of {planned} cases are finished and kept in {out}"
            return Run(True, f"{text}; run the same command again for the rest")
        return Run(False, f"all {planned} cases are finished in {out}")

    def read(self, folder: Path) -> Results:
        """Return the results in a folder."""
        study = read_question(folder)["study"]
        if study != self.name:
            rule = f"results of {self.name} are expected, but it holds those of {study}"
            raise BadResults(str(folder), rule, slug="results-study")
        planned = 0
        if (folder / FILE).is_file():
            try:
                planned = int(json.loads((folder / FILE).read_bytes())["planned"])
            except (OSError, ValueError, KeyError, TypeError) as error:
                rule = f"must say how many cases were planned, but: {error}"
                raise BadResults(str(folder / FILE), rule, "run the study again", slug="results-manifest") from error
        return RosResults(self.name, folder, planned, self.binding.transport)

    def report(self, results: Mapping[str, Results]) -> Reported:
        """Return tables, pieces and documents on results of foreign nodes."""
        found: list[Table] = []
        drawn: list[tuple[str, RosResults]] = []
        documents: dict[str, object] = {}
        for folder, one in results.items():
            assert isinstance(one, RosResults)
            label = f"{one.study}, {folder}" if len(results) > 1 else one.study
            found += [dataclasses.replace(table, title=f"{table.title}: {label}") for table in tables(one.found)]
            drawn.append((label, one))
            documents[folder] = one.entries

        def pieces() -> list[Piece]:
            figures = [(label, figure) for label, one in drawn for figure in waterfalls(one.found)]
            charts = [dataclasses.replace(one, title=f"{one.title}: {label}") for label, one in figures]
            return [
                *found,
                *charts,
                *(piece for label, one in drawn for piece in machines(one.found, self.binding, label)),
            ]

        return Reported(found, pieces, documents)

    def judge(self, case: Case, settings: Settings) -> Judged:
        """Run one case again on the nodes and judge it.

        Raises:
            BadSuite: the study has no such case, or other values than its row and seed give.
        """
        id = case.id.partition("/")[2]
        ours = self._find(id, settings, case.seed)
        if ours is None or (ours.names, ours.values) != (case.names, case.values):
            rule = f"a case must be one that the study has, but row {case.row} of {case.abstract} is not it"
            raise BadSuite(f"case {case.id!r}", rule, "write the suite again with this version", slug="foreign-case")
        with tempfile.TemporaryDirectory(prefix="parcours-") as folder:
            [entry] = run_apart(self._order({**settings, "record": "", "repeats": 0}, case.seed, Path(folder), [id]))
        deaths = entry["deaths"]
        assert isinstance(deaths, dict)
        known = {"outcome": str(entry["outcome"]), "length": f"{entry['seconds']} s",
                 "dead": ", ".join(f"{name} ({how})" for name, how in deaths.items())}  # fmt: skip
        facts = tuple((name, text) for name, text in known.items() if text)
        command = f"parcours run {self.where} --seed {case.seed} --case {case.id} --record mcap --out out"
        command += " && parcours judge out/recordings"
        return Judged(case, Verdict(str(entry["verdict"])), str(entry["why"]), facts, command)

    def rejudge(self, recording: Path) -> Rejudged:
        """Judge a recording by what is recorded alone."""
        from parcours_navigation.foreign.recorded import rejudge

        judged, recorded, id = rejudge(recording, self.binding)
        return Rejudged(recording, f"{self.name}/{id}", recorded, judged.judgement)

    def check(self, progress: Progress) -> Sequence[StudyFinding]:
        """Check the binding: its form, message types, and, with the nodes started, what they register."""
        settings = {one.name: one.default for one in self.parameters}
        found: list[StudyFinding] = []
        if not settings[SYSTEM] and self.binding.system is not None:
            rule = "the binding describes some, but none is run"
            found.append(StudyFinding("note", "system cases", rule, "write system: 10"))
        master, network = str(settings["master"]), str(settings["network"])
        checks: tuple[tuple[str, Callable[[], list[str] | None]], ...] = (
            ("message types", lambda: check_types(self.binding, others=True)),
            ("nodes started", lambda: check_nodes(self.binding, master, network)),
        )
        for done, (what, check) in enumerate(checks):
            progress("checks", done, len(checks))
            try:
                for said in check() or ():
                    where, _, rule = said.partition(": ")
                    found.append(StudyFinding("note", where, *rule.split("; ", 1)))
            except ParcoursError as error:
                absent = error.slug in ("no-ros1", "ros2-missing", "network-namespace")
                rule = f"not checked: {error.rule}" if absent else error.rule
                found.append(StudyFinding("note" if absent else "error", f"{what}, {error.where}", rule, error.remedy))
                break  # what comes after would only say it again
        progress("checks", len(checks), len(checks))
        return found

    # Cases.

    def _abstract(self, seed: int, n_cases: int | None, orders: str = "") -> Iterator[Case]:
        """Yield the first abstract cases, each in the orders that are wanted; None is each once."""
        every: Iterable[AbstractScene] = abstract_scenes(self.binding, seed)
        if n_cases is None:
            every = itertools.takewhile(lambda scene: scene.id.endswith("/0"), every)
        if orders:
            wanted = parse_orders(orders)
            every = (one for scene in every for one in in_orders(scene, wanted, seed))
        for scene in itertools.islice(every, n_cases):
            yield self._case(scene, seed)

    def _case(self, scene: AbstractScene, seed: int) -> Case:
        abstract, _, row = scene.id.rpartition("/")
        names, values = zip(*scene.inputs, strict=True) if scene.inputs else ((), ())
        return Case(self.name, 0, abstract, int(row), names, values, len(scene.events) * PATIENCE * 1e-9, seed)

    def _system(self, number: int, settings: Settings, seed: int) -> Case:
        """Return a system case. Raises BadRequest if the binding describes none."""
        system, protocol = self.binding.system, str(settings["protocol"])
        if system is None:
            rule = "system cases need a section 'system' in the binding, but it has none"
            raise BadRequest("--system", rule, "see docs/bindings.md", slug="foreign-system")
        names: tuple[str, ...] = ()
        values: tuple[float, ...] = ()
        if protocol != "empty":
            cases = SystemCases(seed, protocol)  # type: ignore[arg-type]
            names, values = cases.inputs.names, tuple(cases.values(np.array([number]))[0].tolist())
        return Case(self.name, number, SYSTEM, number, names, values, system.duration, seed)

    def _find(self, id: str, settings: Settings, seed: int) -> Case | None:
        """Return the case of an id without the study, or None; an abstract case alone is its first row."""
        abstract, _, row = id.partition("/")
        if abstract == SYSTEM and row.isdecimal() and len(row) < 7:
            return self._system(int(row), settings, seed)
        id = f"{abstract}/{row or 0}"
        found = find_scenes(self.binding, seed, [id])
        return self._case(found[id], seed) if found else None

    def _chosen(self, request: Request) -> list[Case]:
        """Return the cases of the given ids, with or without the study."""
        prefix = f"{self.name}/"
        given = {id: self._find(id.removeprefix(prefix), request.settings, request.seed) for id in request.chosen}
        wrong = [id for id, case in given.items() if case is None]
        if wrong:
            known = [case.abstract for case in self._abstract(request.seed, None)]
            rule = f"chosen cases must be the study's, but it has no {', '.join(wrong[:5])}"
            remedy = one_of(wrong[0].split("/")[-2] if "/" in wrong[0] else wrong[0], [*known[:200], "system/0"])
            raise BadRequest(f"study {self.name!r}", rule, remedy[:300], slug="case-unknown")
        chosen = {case.id: case for case in given.values() if case is not None}.values()
        return [one for case in chosen for one in self._ordered(case, request.settings)]

    def _ordered(self, case: Case, settings: Settings) -> Iterator[Case]:
        """Yield a chosen case in the orders that are wanted; a system case, or one in a named order, as it is."""
        if not settings["orders"] or MARK in case.abstract or case.abstract == SYSTEM:
            yield case
            return
        scene = find_scenes(self.binding, case.seed, [id := f"{case.abstract}/{case.row}"])[id]
        for one in in_orders(scene, parse_orders(str(settings["orders"])), case.seed):
            yield self._case(one, case.seed)

    def _limits(self, settings: Settings) -> list[str]:
        """Return the ids of the verdicts on limits, if there is timing."""
        if not settings["repeats"]:
            return []
        return [f"timing/{span.name}/{parse_bound(text)}" for span in spans(self.binding) for text in span.texts]

    def _missing(
        self, ids: Sequence[str], timing: Sequence[str], journal: Journal, request: Request
    ) -> Iterator[dict[str, object]]:
        """Yield the results that a folder lacks, each as soon as it is known."""
        left = [id for id in ids if id not in journal.done]
        is_timed = all(id in journal.done for id in timing)
        if not left and is_timed:
            return
        settings = {**request.settings, "repeats": 0 if is_timed else request.settings["repeats"]}
        passive: dict[str, list[list[int]]] = {}
        for entry in journal.done.values():
            for name, times in entry.get("passive", {}).items():  # type: ignore[attr-defined]
                passive.setdefault(name, []).extend(times)
        order = self._order(settings, request.seed, request.out, left)
        yield from run_apart(dataclasses.replace(order, passive=passive))

    def _order(self, settings: Settings, seed: int, out: Path, ids: Sequence[str]) -> ProcessOrder:
        system = [id for id in ids if id.startswith(f"{SYSTEM}/")]
        return ProcessOrder(
            self.binding.source, str(out), is_own(self.binding, settings["master"], settings["network"]),
            str(settings["master"]), seed, str(settings["protocol"]), str(settings["faults"]), str(settings["record"]),
            int(settings["repeats"]), tuple(id for id in ids if id not in system),
            tuple(int(id.partition("/")[2]) for id in system), about={"study": self.name, "where": self.where},
        )  # fmt: skip
