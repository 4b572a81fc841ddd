"""The cases of a study -> pytest items: `pytest --parcours-study ramp_system --parcours-cases 50`.

Inert unless a study or a suite is asked for. Nothing of Parcours but the options is loaded before that.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from parcours.studies.judging import Judged
    from parcours.suite import Case

DEFAULT_CASES = 50
"""Cases of a study if no number is given; a suite file has its own."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Declare the options."""
    group = parser.getgroup("parcours", "test cases of motion planners")
    group.addoption("--parcours-study", metavar="STUDY", help="collect the cases of a study: ramp_system, ...")
    group.addoption("--parcours-suite", metavar="FILE", help="collect the cases of a suite file (parcours suite)")
    group.addoption("--parcours-cases", metavar="N", type=int, help=f"how many, the first N [{DEFAULT_CASES}]")
    group.addoption("--parcours-seed", metavar="N", type=int, default=1, help="campaign seed of the study [1]")
    group.addoption("--parcours-schedule", default="", help="ramp_system: original or guarded [original]")
    group.addoption(
        "--parcours-inconclusive",
        choices=("xfail", "fail"),
        default="xfail",
        help="how a case that cannot be judged is reported [xfail]",
    )


def _is_asked(config: pytest.Config) -> bool:
    return bool(config.getoption("--parcours-study") or config.getoption("--parcours-suite"))


@pytest.hookimpl(trylast=True)
def pytest_configure(config: pytest.Config) -> None:
    """Collect nothing else, unless files or folders are named on the command line."""
    if _is_asked(config) and config.args_source is not pytest.Config.ArgsSource.ARGS:
        config.args = []


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Say what is run, and that compiling comes first if it does."""
    if not _is_asked(config):
        return []
    from parcours.kernels import is_warm

    source = config.getoption("--parcours-suite") or config.getoption("--parcours-study")
    cold = [] if is_warm() else ["parcours: compiling for this machine first, once: about a minute"]
    schedule = config.getoption("--parcours-schedule") or "its own"
    return [f"parcours: {source}, seed {config.getoption('--parcours-seed')}, schedule {schedule}", *cold]


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(session: pytest.Session, config: pytest.Config, items: list[pytest.Item]) -> None:
    """Add one item a case; -k, -m and xdist see them like any other."""
    if not _is_asked(config):
        return
    from parcours.errors import ParcoursError

    try:
        cases = list(_cases(config))
    except ParcoursError as error:
        raise pytest.UsageError(str(error)) from None
    suites: dict[str, CaseSuite] = {}
    for case in cases:
        if case.study not in suites:
            suites[case.study] = CaseSuite.from_parent(session, name=case.study, nodeid=case.study)
        items.append(CaseItem.from_parent(suites[case.study], name=f"{case.abstract}/{case.row}", case=case))


def _cases(config: pytest.Config) -> Iterator[Case]:
    """Yield the cases asked for. Raises ParcoursError."""
    from parcours.errors import BadRequest
    from parcours.studies import suite_of
    from parcours.studies.judging import check_schedule
    from parcours.suite import read_suite

    file, study = config.getoption("--parcours-suite"), config.getoption("--parcours-study")
    wanted, seed = config.getoption("--parcours-cases"), config.getoption("--parcours-seed")
    if wanted is not None and wanted < 1:
        raise BadRequest("--parcours-cases", f"must be at least 1, but is {wanted}", slug="case-count")
    if not 0 <= seed < 2**63:
        raise BadRequest("--parcours-seed", f"must lie in 0 .. 2**63 - 1, but is {seed}", slug="seed")
    schedule = config.getoption("--parcours-schedule")
    if study:
        check_schedule(study, schedule)
    if not file:
        yield from suite_of(study, seed=seed, n_cases=wanted or DEFAULT_CASES)
        return
    for case in islice(read_suite(Path(config.invocation_params.dir, file)), wanted):
        check_schedule(case.study, schedule)
        if not study or case.study == study:
            yield case


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
    """One case: executed anew and judged."""

    def __init__(self, *, case: Case, **keywords: Any) -> None:
        super().__init__(**keywords)
        self.case = case
        self.user_properties += [("abstract", case.abstract), ("row", case.row), ("seed", case.seed)]

    def runtest(self) -> None:
        """Execute the case: fail raises, inconclusive is xfail unless it is to fail."""
        from parcours.studies.judging import judge_case
        from parcours.verdict.judgement import Verdict

        judged = judge_case(self.case, schedule=self.config.getoption("--parcours-schedule"))
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
        file = self.config.getoption("--parcours-suite")
        source = f"--parcours-suite {file}" if file else f"--parcours-study {self.case.study}"
        seed = "" if file else f" --parcours-seed {self.case.seed} --parcours-cases {self.case.number + 1}"
        schedule = self.config.getoption("--parcours-schedule")
        tail = f" --parcours-schedule {schedule}" if schedule else ""
        return f"pytest {source}{seed}{tail} -k '{self.name}'"
