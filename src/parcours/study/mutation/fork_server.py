"""Where mutants run: a process that holds all of them in one build, and from which one more is forked for each.

    parent                      builder (started afresh)                   workers (forked, one a mutant)
      | what is built ---------->| import hook, kernels, originals          |
      |                          | mutant 17 ------------------------------>| chooses 17, cases until all is seen
      |<---- outcome of 17 ------|<-----------------------------------------| ends, and all that it left behind
      |                          | killed when it hangs, blamed when it dies|

Nothing of a mutant runs in the parent. The machine code of the build lies in a folder of its own.
"""

from __future__ import annotations

import contextlib
import hashlib
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib.machinery import SourceFileLoader
from itertools import islice
from pathlib import Path
from types import CodeType
from typing import Literal

from parcours.errors import HostFailure
from parcours.kernels import keep_kernels_in, kernel_cache
from parcours.model.checking import errors
from parcours.run.heartbeat import write_place
from parcours.run.serving import tell
from parcours.run.workers import Crew, Done, Lost, failure_of
from parcours.study.components.isolation import longest
from parcours.study.mutation.models import model_mutants
from parcours.study.mutation.observing import (
    CHECK,
    PATIENCE,
    TWIN,
    CaseObservation,
    Components,
    MutationSubject,
    allowed,
    strikes_of,
    subject_of,
)
from parcours.study.mutation.source import Module, Sources, place_of
from parcours.study.mutation.suites import Suite, with_suite
from parcours.study.parameters import Settings
from parcours.suite import Case

Kind = Literal["code", "model", "channels"]
_MODELS = 12  # judge each trace at a time: to make the trace takes longest
_LONG = 500  # characters of a reason that are kept
_GRACE = 2.0  # so much longer than a turn may take, a worker is waited for [s]


@dataclass(frozen=True, slots=True)
class Build:
    """What a builder needs to know; it can be sent."""

    of: Kind  # what is changed
    where: str  # the study
    settings: Settings
    seed: int
    suite: Suite  # how its cases are selected and judged
    cases: int | None  # of the suite; None for as many as the study has
    twin: int  # cases in which an effect is looked for
    modules: tuple[Module, ...]
    transitions: tuple[tuple[str, ...], ...]
    channels: tuple[str, ...]
    built: tuple[str, ...]  # ids of all mutants in the build; the first is number 1
    folder: Path  # for machine code

    def sources(self) -> Sources:
        """Return the mutants of the modules."""
        return Sources(self.modules, self.transitions, self.channels)


@dataclass(frozen=True, slots=True)
class MutantOutcome:
    """What became of a mutant."""

    # ended: as it should. timeout: a loop went on and on. hung, died: its process. refused: by the compiler
    end: str
    seen: Mapping[str, tuple[str, str]] = field(default_factory=dict)  # stage -> the first case that saw it, and why
    cases: int = 0  # in how many cases its function ran; 0 if none reaches it
    at: Mapping[str, int] = field(default_factory=dict)  # stage -> the place of that case in the suite, from 0
    suite: int = 0  # how many cases the suite has
    sound: int = 0  # how many of them the original passes; the others notice nothing
    facts: str = ""  # digest of all that was sent, or of the facts, in those cases; empty if the model was changed

    def joined(self, other: MutantOutcome) -> MutantOutcome:
        """Return what became of the mutant in the cases of two studies."""
        end = other.end if self.end == "ended" else self.end
        seen, at = {**other.seen, **self.seen}, {**other.at, **self.at}
        return MutantOutcome(end, seen, self.cases + other.cases, at, self.suite, self.sound, self.facts + other.facts)


@dataclass(frozen=True, slots=True)
class Refused:
    """Mutants that the compiler does not accept; the rest are built again without them."""

    ids: tuple[str, ...]
    why: str


Report = tuple[str, MutantOutcome] | Refused | tuple[str, int, int]  # an outcome, or how far the originals are


def judge_mutants(build: Build, ids: Sequence[str], workers: int, heard: Callable[[Report], None]) -> None:
    """Report the outcome of each mutant as it comes, from processes apart.

    Raises HostFailure: the builder died, or the study's cases cannot be executed.
    """
    crew = Crew(_built, 1, own_group=True, heard=heard)
    with contextlib.closing(crew):
        crew.pending.append((0, (build, tuple(ids), workers)))
        for _, answer in crew.answers():
            if isinstance(answer, Lost):
                raise HostFailure("mutants", f"they must be built, but the process that builds them {answer.ending}",
                                  "look at what it printed", slug="mutants-build")  # fmt: skip
            if isinstance(answer, Exception):
                raise failure_of("mutants", answer, "mutants-build")


def _built(build: Build, ids: tuple[str, ...], workers: int) -> None:
    """Build all mutants in this process, and report the outcome of those asked for."""
    bench = Bench(build)
    if refused := bench.refused():
        tell(refused)
        return
    crew = Crew(bench.judge, workers, forks=True, n_words=3, patience=longest(bench.patience) + _GRACE, once=True)
    numbers = {id: k for k, id in enumerate(build.built, start=1)}
    size = _MODELS if build.of == "model" else 1
    items = [ids[k : k + size] for k in range(0, len(ids), size)]
    with contextlib.closing(crew):
        crew.pending.extend((k, (tuple(numbers[id] for id in item),)) for k, item in enumerate(items))
        for k, answer in crew.answers():
            if isinstance(answer, Done):
                for report in zip(items[k], answer.result, strict=True):
                    tell(report)
            elif isinstance(answer, Lost):
                why = f"its process {'hung' if answer.how == 'hung' else answer.ending}, in {answer.place or 'a case'}"
                # Where the model is changed, what runs is the original: a judge that hangs has noticed nothing.
                stages = () if build.of == "model" else (bench.subject.stages[0], TWIN)
                for id in items[k]:
                    tell((id, MutantOutcome(answer.how, dict.fromkeys(stages, ("", why)))))
            else:
                raise failure_of(items[k][0], answer, "mutants-build")


class Bench:
    """The originals' observations, and mutants beside them."""

    def __init__(self, build: Build) -> None:
        from parcours.study.components.study import ComponentStudy
        from parcours.study.finding import find

        self._places = install(build).places if build.of == "code" else {}
        study = with_suite(find(build.where), build.suite, build.seed)
        self.patience = PATIENCE * float(getattr(study, "patience", 5.0))
        self.subject: MutationSubject = subject_of(study, build.settings, build.seed)
        self._build = build
        if build.of != "code":
            assert isinstance(study, ComponentStudy)
            self._models = {one.id: model for one, model in model_mutants(study.model)}
            self._strikes = dict(strikes_of(study))
        self._cases: list[Case] = list(self.subject.cases(build.cases))
        self._originals: list[CaseObservation] = []
        for k, case in enumerate(self._cases):
            found = self.subject.observe(case)
            if any(found.noticed.values()) and not found.refused:  # it may have been held up by the compiler
                found = self.subject.observe(case)
            self._originals.append(found)
            tell(("original cases", k + 1, len(self._cases)))
            if self._originals[-1].refused:
                return
        if not any(not why for one in self._originals for why in one.noticed.values()):
            said = next(iter(self._originals[0].noticed.values()))
            raise HostFailure(self._cases[0].id, f"a case of the original must pass, but none does: {said}",
                              "repair the study first", slug="mutants-original")  # fmt: skip
        self._sound = sum(not one.noticed[self.subject.stages[0]] for one in self._originals)
        self._beyond: list[tuple[Case, CaseObservation]] = []
        """The twin's cases beyond the suite, with what the original does there."""
        if build.of == "code" and build.twin > len(self._cases):
            for case in islice(self.subject.cases(build.twin), len(self._cases), None):
                self._beyond.append((case, self.subject.observe(case, judged=False)))
                tell(("cases of the golden twin", len(self._cases) + len(self._beyond), build.twin))

    def refused(self) -> Refused | None:
        """Return the mutants at the place that the compiler complains of; None if it accepts all."""
        places = self._originals[-1].refused
        if not places:
            return None
        sources = self._build.sources()
        built = [one for one in sources.mutants() if one.id in set(self._build.built)]
        for file, line in places:
            if found := tuple(one.id for one in built if Path(one.file).absolute() == Path(file) and one.line == line):
                return Refused(found, f"{file}:{line}")
        why = next(iter(self._originals[-1].noticed.values()))
        raise HostFailure("mutants", f"the compiler must accept what is built, but: {why[:2000]}",
                          "leave the module out", slug="mutants-build")  # fmt: skip

    def judge(self, numbers: tuple[int, ...]) -> list[MutantOutcome]:
        """Return what becomes of mutants, by their numbers in the build."""
        if self._build.of == "model":
            return self._judged_models([self._build.built[number - 1] for number in numbers])
        judge = self._judged_code if self._build.of == "code" else self._judged_channel
        return [judge(number) for number in numbers]

    def _judged_models(self, ids: Sequence[str]) -> list[MutantOutcome]:
        """Check models that say something else, and judge clean traces by them."""
        assert isinstance(self.subject, Components)
        judges = {id: self.subject.judge_of(self._models[id]) for id in ids}
        seen: dict[str, dict[str, tuple[str, str]]] = {id: {} for id in ids}
        for id in ids:
            write_place(f"check of {id}")
            if refused := errors(self._models[id]):
                seen[id][CHECK] = "", refused[0].message[:_LONG]
        for case, original in zip(self._cases, self._originals, strict=True):
            trace = self.subject.trace(case)
            for id in ids:
                if not seen[id].keys() >= set(self.subject.stages):
                    write_place(f"{case.id}, judged by {id}")
                    for stage, why in judges[id](case, trace).items():
                        if why and not original.noticed[stage]:
                            seen[id].setdefault(stage, (case.id, why[:_LONG]))
        return [MutantOutcome("ended", seen[id], len(self._cases)) for id in ids]

    def _judged_channel(self, number: int) -> MutantOutcome:
        """Execute cases under a fault on a channel."""
        strike = self._strikes[self._build.built[number - 1]]
        assert isinstance(self.subject, Components)
        seen: dict[str, tuple[str, str]] = {}
        ran, sent = 0, hashlib.sha256()
        for case, original in zip(self._cases, self._originals, strict=True):
            found = self.subject.struck(case, strike)
            if found is None:
                continue
            ran += 1
            sent.update(found.print)
            self._note(case, original, found, seen)
            if len(seen) == len(self.subject.stages) + 1:
                break
        return MutantOutcome("ended", seen, ran, facts=_short(sent))

    def _note(
        self, case: Case, original: CaseObservation, found: CaseObservation, seen: dict[str, tuple[str, str]]
    ) -> None:
        for stage, why in found.noticed.items():
            if why and not original.noticed[stage]:
                seen.setdefault(stage, (case.id, why[:_LONG]))
        if found.print != original.print:
            seen.setdefault(TWIN, (case.id, ""))

    def _judged_code(self, number: int) -> MutantOutcome:
        """Run a mutant until every stage has seen it, or in all cases; one that shows nothing in more of them."""
        seen: dict[str, tuple[str, str]] = {}
        at: dict[str, int] = {}
        ran, place, sent = 0, self._place(number), hashlib.sha256()
        for k, (case, original) in enumerate(zip(self._cases, self._originals, strict=True)):
            if place not in original.places:
                continue
            ran += 1
            found = self.subject.observe(case, number, allowed(original))
            sent.update(found.print)
            had_effect = TWIN in seen
            self._note(case, original, found, seen)
            if not found.ended:
                why = "its loops go round and round"
                seen = {self.subject.stages[0]: (case.id, why), TWIN: (case.id, why), **seen}
            at = {stage: at.get(stage, k) for stage in seen}
            if not found.ended:
                return MutantOutcome("timeout", seen, ran, at, len(self._cases), self._sound, _short(sent))
            if TWIN in seen and not had_effect:
                seen[TWIN] = (case.id, self.subject.difference(case, number, allowed(original))[:_LONG])
            if len(seen) == len(self.subject.stages) + 1:
                break
        if not seen:
            for case, original in self._beyond:
                if place not in original.places:
                    continue
                ran += 1
                rounds = allowed(original)
                if self.subject.observe(case, number, rounds, judged=False).print != original.print:
                    seen[TWIN] = (case.id, self.subject.difference(case, number, rounds)[:_LONG])
                    break
        return MutantOutcome("ended", seen, ran, at, len(self._cases), self._sound, _short(sent))

    def _place(self, number: int) -> int:
        return self._places[place_of(self._build.built[number - 1])]


def _short(digest: hashlib._Hash) -> str:
    return digest.hexdigest()[:16]


def install(build: Build) -> Sources:
    """Let Python load the mutated form of the modules in this process, which must not have loaded them yet.

    Raises HostFailure: it has.
    """
    sources = build.sources()
    numbers = {id: k for k, id in enumerate(build.built, start=1)}
    paths = {one.path.resolve(): one.path for one in build.modules}
    loaded = [
        name for name, one in sys.modules.items() if Path(getattr(one, "__file__", None) or ".").resolve() in paths
    ]
    if loaded:
        raise HostFailure("mutants", f"the engine itself cannot be mutated, but {', '.join(loaded)} was asked for",
                          "name modules of the system under test", slug="mutants-build")  # fmt: skip
    said = [kernel_cache().name, *build.built, *(one.text for one in build.modules)]
    digest = hashlib.sha256("\0".join(said).encode()).hexdigest()[:16]
    keep_kernels_in(build.folder / f"kernels-{digest}")
    plain = SourceFileLoader.get_code

    def get_code(loader: SourceFileLoader, fullname: str) -> CodeType | None:
        path = paths.get(Path(loader.get_filename(fullname)).resolve())
        tree = sources.build(path, numbers) if path is not None else None
        return plain(loader, fullname) if tree is None else compile(tree, str(path), "exec", dont_inherit=True)

    SourceFileLoader.get_code = get_code  # type: ignore[assignment, method-assign]
    return sources
