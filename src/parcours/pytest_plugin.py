"""Collects the cases of a study as pytest items: `pytest --parcours-study examples/lift --parcours-cases 50`.

Inert unless a study or a suite is asked for. Nothing of Parcours but the options is loaded before that.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from parcours.study import Judged, Study
    from parcours.suite import Case

DEFAULT_CASES = 50
"""Cases of a study if no number is given; a suite file has its own."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options."""
    group = parser.getgroup("parcours", "test cases of studies")
    group.addoption("--parcours-study", metavar="STUDY", help="collect the cases of a study: a name, folder or file")
    group.addoption("--parcours-suite", metavar="FILE", help="collect the cases of a suite file (parcours suite)")
    group.addoption("--parcours-planner", metavar="NAME", default="",
                    help="the planner under test: module:Name or file.py:Name, for a study that has one")  # fmt: skip
    group.addoption("--parcours-set", metavar="NAME=VALUE", action="append", default=[],
                    help="a parameter of the study; may be repeated")  # fmt: skip
    group.addoption("--parcours-case", metavar="ID", action="append", default=[], help="this case only; repeatable")
    group.addoption("--parcours-cases", metavar="N", type=int, help=f"how many, the first N [{DEFAULT_CASES}]")
    group.addoption("--parcours-seed", metavar="N", type=int, default=1, help="campaign seed of the study [1]")
    group.addoption("--parcours-inconclusive", choices=("xfail", "fail"), default="xfail",
                    help="how a case that cannot be judged is reported [xfail]")  # fmt: skip


def _is_asked(config: pytest.Config) -> bool:
    return any(config.getoption(f"--parcours-{name}") for name in ("study", "suite", "planner"))


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Collect nothing else, unless files or folders are named on the command line."""
    if _is_asked(config) and config.args_source is not pytest.Config.ArgsSource.ARGS:
        config.args = []


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Say what is run."""
    if not _is_asked(config):
        return []
    given = [config.getoption(f"--parcours-{name}") for name in ("suite", "study", "planner")]
    source = ", ".join(str(one) for one in given if one)
    settings = ", ".join(config.getoption("--parcours-set")) or "default settings"
    return [f"parcours: {source}, seed {config.getoption('--parcours-seed')}, {settings}"]


@pytest.hookimpl(trylast=True)
def pytest_sessionstart(session: pytest.Session) -> None:
    """Say that compiling comes first if it does: at once, also where -q leaves the header out."""
    config = session.config
    if not _is_asked(config) or config.option.collectonly or hasattr(config, "workerinput"):
        return
    from parcours.kernels import is_warm

    reporter = config.pluginmanager.get_plugin("terminalreporter")
    if reporter is not None and not is_warm():
        reporter.write_line("parcours: compiling for this machine first, once: up to half a minute")
        reporter.flush()


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """Add one item per case; -k, -m and xdist see them like any other."""
    if not _is_asked(config):
        return
    from parcours.errors import ParcoursError

    try:
        cases = list(_cases(config))
    except ParcoursError as error:
        raise pytest.UsageError(str(error)) from None
    suites: dict[str, CaseSuite] = {}
    for case, study, settings in cases:
        if case.study not in suites:
            suites[case.study] = CaseSuite.from_parent(session, name=case.study, nodeid=case.study)
        name = f"{case.abstract}/{case.row}"
        items.append(CaseItem.from_parent(suites[case.study], name=name, case=case, study=study, settings=settings))


def _study(config: pytest.Config) -> Study | None:
    """Return the study that is named, or the one that has a planner if one is named; None if only a suite is."""
    from parcours.errors import BadRequest
    from parcours.study.finding import find, registered

    if config.getoption("--parcours-study"):
        return find(config.getoption("--parcours-study"))
    if not config.getoption("--parcours-planner"):
        return None
    for one in registered():
        study = find(one.name)
        if any(parameter.name == "planner" for parameter in study.parameters):
            return study
    raise BadRequest("--parcours-planner", "no registered study has a planner", slug="option-study")


def _settings(config: pytest.Config, study: Study) -> dict[str, Any]:
    from parcours.study.parameters import pairs_of, settings_of

    planner = config.getoption("--parcours-planner")
    given = [*config.getoption("--parcours-set"), *([f"planner={planner}"] if planner else [])]
    return settings_of(study.parameters, pairs_of(given), study.name)


def _cases(config: pytest.Config) -> Iterator[tuple[Case, Study, dict[str, Any]]]:
    """Yield the cases asked for, each with its study and settings. Raises ParcoursError."""
    from parcours.errors import BadRequest
    from parcours.study.finding import find
    from parcours.study.selection import named
    from parcours.suite import read_suite

    file, study = config.getoption("--parcours-suite"), _study(config)
    wanted, seed = config.getoption("--parcours-cases"), config.getoption("--parcours-seed")
    if wanted is not None and wanted < 1:
        raise BadRequest("--parcours-cases", f"must be at least 1, but is {wanted}", slug="case-count")
    if not 0 <= seed < 2**63:
        raise BadRequest("--parcours-seed", f"must lie in 0 .. 2**63 - 1, but is {seed}", slug="seed")
    chosen = config.getoption("--parcours-case")
    known: dict[str, tuple[Study, dict[str, Any]]] = {}
    if study is not None:
        known[study.name] = study, _settings(config, study)
    if not file:
        assert study is not None
        settings = known[study.name][1]
        if chosen:
            cases = named(study.suite(settings, seed, wanted), chosen)
        else:  # of an endless family of cases the first ones, of a study that ends no more than it has
            n = wanted if wanted is not None or study.kind == "components" else DEFAULT_CASES
            cases = islice(study.suite(settings, seed, n), wanted or DEFAULT_CASES)
        yield from ((case, study, settings) for case in cases)
        return
    cases = read_suite(Path(config.invocation_params.dir, file))
    for case in islice(named(cases, chosen) if chosen else cases, wanted):
        if case.study not in known:
            if study is not None:
                continue
            found = find(case.study)
            known[case.study] = found, _settings(config, found)
        yield case, *known[case.study]


class CaseSuite(pytest.Collector):
    """The cases of one study; its items are made by the plugin."""

    def collect(self) -> list[pytest.Item]:
        """Return nothing: the items are there already."""
        return []


class CaseFailedError(Exception):
    """A case was executed, and its verdict is not pass."""

    def __init__(self, judged: Judged) -> None:
        super().__init__(str(judged))


class CaseItem(pytest.Item):
    """One case: executed and judged."""

    def __init__(self, *, case: Case, study: Study, settings: dict[str, Any], **keywords: Any) -> None:
        super().__init__(**keywords)
        self.case, self.study, self.settings = case, study, settings
        self.user_properties += [("abstract", case.abstract), ("row", case.row), ("seed", case.seed)]

    def runtest(self) -> None:
        """Execute the case: fail raises, inconclusive is xfail unless it is to fail."""
        from parcours.verdict.judgement import Verdict

        judged = self.study.judge(self.case, self.settings)
        self.user_properties.append(("verdict", str(judged.verdict)))
        if judged.verdict is Verdict.INCONCLUSIVE and self.config.getoption("--parcours-inconclusive") == "xfail":
            pytest.xfail(judged.why)
        if judged.verdict is not Verdict.PASS:
            raise CaseFailedError(judged)

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Return the explanation of a failed case, and how to run it again; the trace of anything else."""
        from parcours.errors import ParcoursError

        if isinstance(excinfo.value, CaseFailedError):
            return f"{excinfo.value}\n  again   {self._again()}"
        if isinstance(excinfo.value, ParcoursError):
            return f"error: {excinfo.value}\n  case    {self.case.id}"
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, None, str]:
        """Return where the case is listed, and its id."""
        return self.config.rootpath, None, self.case.id

    def _again(self) -> str:
        file, planner = self.config.getoption("--parcours-suite"), self.config.getoption("--parcours-planner")
        source = [f"--parcours-suite {file}"] if file else [f"--parcours-seed {self.case.seed}"]
        named = self.config.getoption("--parcours-study")
        source += [f"--parcours-study {named}"] * bool(named) + [f"--parcours-planner {planner}"] * bool(planner)
        source += [f"--parcours-set {one}" for one in self.config.getoption("--parcours-set")]
        return f"pytest {' '.join(source)} --parcours-case {self.case.id}"
