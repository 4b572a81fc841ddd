"""A folder of results, while it grows, into counts, rates with intervals and the latest failures.

Only what came since is read: a folder is made beside, with the run's own head and the new part of its cases, and the
study reads that as if it were all. So a shard costs the same at the end of a campaign as at its start.
"""

from __future__ import annotations

import contextlib
import importlib
import json
import os
import sys
import tempfile
import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from pathlib import Path

from parcours.errors import BadRequest, BadResults, ParcoursError
from parcours.report.junit import CaseResult
from parcours.run.store import MANIFEST, Store, open_results
from parcours.studio.folder import Folder
from parcours.study.components.results import FILE as COMPONENTS
from parcours.study.finding import find, registered
from parcours.study.gate import JudgedResults
from parcours.study.journal import CASES, RUN, read_question
from parcours.study.protocol import Results, Study
from parcours.study.summing import Caused
from parcours.verdict.judgement import Verdict
from parcours.verdict.sequential import rate_at_any_time

PERIOD = 0.05
"""Time between two looks at a folder [s]."""

_AT_ONCE = 16  # shards that are read in one look
_LATEST = 20  # failures that are shown
_LARGEST = 500_000_000  # file of a run [bytes]
_RECENT = 32  # arrivals that the speed is taken from


class Watched:
    """What is known of a run from its files alone."""

    def __init__(self, folder: Folder, run: str, *, trusted: bool = False) -> None:
        self.run, self._trusted = run, trusted
        self._path = folder.directory(run)
        self._folder = folder
        self._study: Study | None = None
        self._store: Store | None = None
        self._seen: set[int] = set()
        self._end = 0  # of the journal as far as it is read [bytes]
        self._counts: Counter[str] = Counter()
        self._arrivals: deque[tuple[float, int]] = deque(maxlen=_RECENT)  # (time of the file [s], cases)
        self._latest: deque[dict[str, str]] = deque(maxlen=_LATEST)
        self._planned, self._label, self._is_told = 0, "", False

    def news(self) -> dict[str, object] | None:
        """Return what is known of the run if anything came since the last call, else None.

        Raises:
            BadRequest: its study cannot be read without running code of the folder.
            BadResults: the folder holds no results, or damaged ones.
        """
        before = self._planned, self._counts.total()
        self.load()
        assert self._study is not None
        if self._store is not None:
            self._look_at_shards(self._store)
        else:
            self._look_at_journal()
        is_known, self._is_told = self._is_told, True
        if is_known and before == (self._planned, self._counts.total()):
            return None
        return self._known(self._study.name)

    def load(self) -> None:
        """Load the study, and what reads its cases, without a look at any: the first look is as quick as the next.

        Raises as `news`.
        """
        if self._study is None:
            self._study = study_behind(self._folder, self.run, trusted=self._trusted)
        if self._store is None and (self._path / MANIFEST).is_file():
            self._store = _opened(self._folder, self.run)
            self._planned = self._store.planned
            with self._slice(MANIFEST) as part:
                self._add(part, 0.0)
        rate_at_any_time(0, 1)  # which loads scipy, and that takes a second
        if self._store is not None:
            importlib.import_module("pyarrow.parquet")

    def _look_at_shards(self, store: Store) -> None:
        new = sorted(store.finished() - self._seen)[:_AT_ONCE]
        if not new:
            return
        with self._slice(MANIFEST) as part:
            for name in (store.path(shard).name for shard in new):
                for each in (name, f"{name}.sha256"):
                    (part / each).write_bytes(self._folder.read(f"{self.run}/{each}", _LARGEST))
            self._add(part, max(store.path(shard).stat().st_mtime for shard in new))
        self._seen.update(new)

    def _look_at_journal(self) -> None:
        path, content, changed = self._path / CASES, b"", 0.0
        with contextlib.suppress(FileNotFoundError):
            if (found := path.lstat()).st_size > self._end:
                content = self._folder.read(f"{self.run}/{CASES}", _LARGEST, begin=self._end, cut=True)
                changed = found.st_mtime
        whole = content[: content.rfind(b"\n") + 1]
        if whole:
            with self._slice() as part:
                (part / CASES).write_bytes(whole)
                self._add(part, changed)
            self._end += len(whole)
        if not self._planned and (self._path / COMPONENTS).is_file():
            assert self._study is not None
            self._planned = self._study.read(self._path).planned

    @contextlib.contextmanager
    def _slice(self, *heads: str) -> Iterator[Path]:
        """Give a folder with the heads of this run."""
        with tempfile.TemporaryDirectory(prefix="parcours-studio-") as made:
            for name in (RUN, *heads):
                if (self._path / name).exists():
                    (Path(made) / name).write_bytes(self._folder.read(f"{self.run}/{name}", _LARGEST))
            yield Path(made)

    def _add(self, part: Path, changed: float) -> None:
        assert self._study is not None
        try:
            results = self._study.read(part)
            n, counts, failed = _summed(results)
        except ParcoursError as error:  # it names the folder that was made
            raise type(error)(error.where.replace(str(part), self.run), error.rule.replace(str(part), self.run),
                              error.remedy, slug=error.slug) from error  # fmt: skip

        self._label = results.label
        if n:
            self._arrivals.append((changed, n))
        self._counts.update(counts)
        self._latest.extend({"id": one.id, "verdict": str(one.verdict), "why": one.why[:500]} for one in failed)

    def _known(self, study: str) -> dict[str, object]:
        n = self._counts.total()
        rates = {name: rate_at_any_time(count, n) for name, count in sorted(self._counts.items())}
        span = self._arrivals[-1][0] - self._arrivals[0][0] if self._arrivals else 0.0
        recent = sum(count for _, count in list(self._arrivals)[1:])
        return {
            "run": self.run, "study": study, "label": self._label, "finished": n, "planned": self._planned,
            "verdicts": [{"verdict": name, "cases": of.count, "share": of.share, "low": of.low, "high": of.high}
                         for name, of in rates.items()],
            "per_second": recent / span if span > 0.0 else None,
            "changed": self._arrivals[-1][0] if self._arrivals else None,
            "latest": list(reversed(self._latest)),
        }  # fmt: skip


def _summed(results: Results) -> tuple[int, Counter[str], Sequence[CaseResult]]:
    """Return how many cases there are, how many have each verdict, and the last that did not pass."""
    if not (isinstance(results, JudgedResults) and isinstance(results, Caused)):
        cases = results.cases()
        failed = [one for one in cases if one.verdict is not Verdict.PASS]
        return len(cases), Counter(str(one.verdict) for one in cases), failed[-_LATEST:]
    verdicts = results.case_verdicts()  # reasons are worded only for the cases that are shown
    places = [k for k, verdict in enumerate(verdicts) if verdict is not Verdict.PASS][-_LATEST:]
    return len(verdicts), Counter(map(str, verdicts)), results.some_cases(places)


def study_behind(folder: Folder, run: str, *, trusted: bool = False) -> Study:
    """Return the study that wrote a folder of results, if it is an installed one, or a study.yaml in the folder.

    Args:
        trusted: whether one of Python code in the folder is loaded, too, which runs that code.

    Raises:
        BadRequest: to find it would run code that lies in the folder, or it lies elsewhere.
        BadResults: the folder does not say what was run.
    """
    path = folder.directory(run)
    where = str(_question(folder, run)["where"]) if (path / RUN).is_file() else _opened(folder, run).campaign.study
    if where in {one.name for one in registered()}:
        return find(where)
    if (code := code_in(folder, where)) is not None:
        if not trusted:
            rule = "its study is Python code in the folder, which looking does not run"
            raise BadRequest(run, rule, "choose *Run its code* to read it", slug="studio-code")
        return find(code)
    inside = folder.inside(folder.root / where) if where.endswith((".yaml", ".yml")) else None
    if inside is None:
        rule = f"the study must be a study.yaml in the studio's folder or a registered one, but is {where[:200]!r}"
        remedy = "use `parcours report` on the command line: it runs what the study names"
        raise BadRequest(run, rule, remedy, slug="studio-study")
    folder.read(inside, 1_000_000)
    return find(str(folder.root / inside))


def code_in(folder: Folder, where: str) -> str | None:
    """Return how a command names `file.py:NAME` whose file lies in the folder, without links; None for all else."""
    file, _, name = where.rpartition(":")
    path = folder.root / file
    if not (file.endswith(".py") and name.isidentifier() and path.is_relative_to(folder.root)):
        return None
    with contextlib.suppress(BadRequest):
        folder.read(path.relative_to(folder.root).as_posix(), _LARGEST, cut=True)
        return f"{path}:{name}"
    return None


def main(root: str, run: str) -> None:
    """Print what is known of a run as a line of JSON, each time that it changes; runs the code of its study."""
    watched = Watched(Folder(Path(root)), run, trusted=True)
    while os.getppid() != 1:  # the studio ends it, or is gone
        news = watched.news()
        if news is not None:
            print(json.dumps(news), flush=True)  # noqa: T201
        time.sleep(PERIOD)


def summary(folder: Folder, run: str) -> dict[str, object]:
    """Return what a folder of results says of itself: study, seed and settings; why not, where it does not."""
    try:
        path = folder.directory(run)
        if (path / RUN).is_file():
            question = _question(folder, run)["question"]
            assert isinstance(question, dict)
            settings = question.get("settings")
            said = json.dumps(settings, sort_keys=True)[:500] if isinstance(settings, dict) else ""
            return {"run": run, "study": str(question.get("study")), "seed": question.get("seed"), "settings": said}
        campaign = _opened(folder, run).campaign
        return {"run": run, "study": campaign.study, "seed": campaign.seed, "settings": campaign.schedule}
    except (BadRequest, BadResults) as error:
        return {"run": run, "error": str(error)}


def _question(folder: Folder, run: str) -> dict[str, object]:
    folder.read(f"{run}/{RUN}", _LARGEST)  # is a file, and no link
    return read_question(folder.directory(run))


def _opened(folder: Folder, run: str) -> Store:
    folder.read(f"{run}/{MANIFEST}", _LARGEST)
    return open_results(folder.directory(run))


if __name__ == "__main__":
    try:
        main(*sys.argv[1:3])
    except ParcoursError as error:
        sys.stderr.write(f"parcours: {error}\n")
        sys.exit(2)
