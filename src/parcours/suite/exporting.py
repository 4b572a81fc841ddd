"""Writes cases as a Python file that pytest runs: one test per case, its id the case's, its failure explained.

What stands in the script is written with `repr` from checked values, so a hostile suite cannot put code into
it. The cases stand in the script itself, or it names the suite file and remembers its checksum.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath

from parcours.errors import BadRequest, BadSuite
from parcours.suite.cases import Case
from parcours.suite.files import read_suite, unreadable

MOST_EMBEDDED = 10_000
"""Most cases that a script holds itself."""

_SCRIPT = '''\
"""{title}

Written by `parcours export pytest`. Each test executes its case again and judges it: a case that fails says why, and
how to see its run. A case that cannot be judged (verdict inconclusive) is reported as xfail.

    pytest {name}                    all cases
    pytest {name} -k {some}
"""

{imports}

STUDY = find({study})
{cases}


@pytest.mark.parametrize("case", CASES, ids=[case.id for case in CASES])
def test_case(case: Case) -> None:
    judged = judge_case(case, STUDY{arguments})
    if judged.verdict == "inconclusive":
        pytest.xfail(judged.why)
    if judged.verdict != "pass":
        pytest.fail(str(judged), pytrace=False)
'''


def to_pytest(
    cases: Sequence[Case], name: str, *, study: str = "", settings: Mapping[str, object] | None = None, suite: str = "",
    sha256: str = "",
) -> str:  # fmt: skip
    """Return the text of a pytest file for some cases.

    >>> case = Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)
    >>> print("\\n".join(to_pytest([case], "test_demo.py").splitlines()[9:21]))
    import pytest
    <BLANKLINE>
    from parcours.study import judge_case
    from parcours.study.finding import find
    from parcours.suite import Case
    <BLANKLINE>
    STUDY = find('demo')
    NAMES = ('v',)
    <BLANKLINE>
    CASES = [
        Case('demo', 0, 'together', 0, NAMES, (0.1,), 20.0, seed=7),
    ]
    """
    studies = sorted({case.study for case in cases})
    if len(studies) != 1:
        rule = f"a script needs cases of one study, but the suite has those of {', '.join(studies) or 'none'}"
        raise BadRequest("export", rule, "write a suite for each study", slug="export-cases")
    if not suite and len(cases) > MOST_EMBEDDED:
        rule = f"a script holds at most {MOST_EMBEDDED} cases, but the suite has {len(cases)}"
        raise BadRequest("export", rule, "let the script read the suite file: --refer", slug="export-size")
    imports = [
        "import pytest", "", "from parcours.study import judge_case", "from parcours.study.finding import find",
        "from parcours.suite import Case",
    ]  # fmt: skip
    is_place = "/" in study or study.endswith((".yaml", ".yml")) or study.startswith(".")
    if suite:
        imports += ["from parcours.suite.exporting import sealed_cases"]
    if suite or is_place:
        imports = ["from pathlib import Path", "", *imports]
    found = f"str(Path(__file__).parent / {study!r})" if is_place else repr(study or studies[0])
    arguments = [f"{key}={value!r}" for key, value in (settings or {}).items()]
    where = f"SUITE = Path(__file__).parent / {suite!r}\nSHA256 = {sha256!r}\n\nCASES = sealed_cases(SUITE, SHA256)"
    return _SCRIPT.format(
        title=f"{len(cases)} cases of {studies[0]}, {len({case.abstract for case in cases})} abstract cases.",
        name=re.sub(r"[^\w.-]", "_", PurePath(name).name),  # a file may be called anything
        some=f"{cases[0].abstract!r}    those of one abstract case",
        imports="\n".join(imports),
        study=found,
        cases=where if suite else _embedded(cases),
        arguments="".join(f", {one}" for one in arguments),
    )


def _embedded(cases: Sequence[Case]) -> str:
    # The names of the inputs stand once where all cases share them, as those of one study do.
    shared = cases[0].names
    lines = [f"NAMES = {shared!r}", "", "CASES = ["]
    for case in cases:
        names = "NAMES" if case.names == shared else repr(case.names)
        head = f"{case.study!r}, {case.number!r}, {case.abstract!r}, {case.row!r}, {names}"
        lines.append(f"    Case({head}, {case.values!r}, {case.time_budget!r}, seed={case.seed!r}),")
    return "\n".join([*lines, "]"])


def checksum(path: Path | str) -> str:
    """Return the SHA-256 of a file in hexadecimal digits.

    Raises:
        BadSuite: the file cannot be read.
    """
    try:
        with Path(path).open("rb") as file:
            return hashlib.file_digest(file, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(path, error) from None


def sealed_cases(path: Path | str, sha256: str) -> list[Case]:
    """Return the cases of a suite file that has not changed since a script was written for it.

    >>> import tempfile
    >>> from parcours.suite import write_suite
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "suite.jsonl")
    ...     n = write_suite(path, [Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)])
    ...     [case.id for case in sealed_cases(path, checksum(path))]
    ['demo/together/0']
    """
    found = checksum(path)
    if found != sha256:
        rule = f"the suite must have the checksum {sha256[:16]}..., but has {found[:16]}..."
        raise BadSuite(str(path), rule, "export the script again", slug="suite-changed")
    return list(read_suite(path))
