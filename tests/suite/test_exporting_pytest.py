from __future__ import annotations

import ast
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.errors import BadRequest, BadSuite
from parcours.suite import Case, write_suite
from parcours.suite.exporting import MOST_EMBEDDED, checksum, sealed_cases, to_pytest

parts = st.from_regex(r"[A-Za-z0-9_+@=,-]{1,12}", fullmatch=True)
numbers = st.floats(allow_nan=False, allow_infinity=False, width=64)
inputs = st.dictionaries(st.from_regex(r"[a-z_][a-z0-9_]{0,5}", fullmatch=True), numbers, max_size=4)


@st.composite
def suites(draw: st.DrawFn) -> list[Case]:
    n = draw(st.integers(1, 4))
    drawn = [draw(inputs) for _ in range(n)]
    return [
        Case(
            "demo",
            k,
            draw(parts),
            k,
            tuple(values),
            tuple(values.values()),
            draw(st.floats(0.1, 99)),
            draw(st.integers(0, 9)),
        )
        for k, values in enumerate(drawn)
    ]


def cases_in(script: str) -> list[Case]:
    """Return the cases that the script builds, from its text alone: nothing of it is run but `Case`."""
    found = {
        target.id: node.value
        for node in ast.parse(script).body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    names = ast.literal_eval(found["NAMES"])
    assert isinstance(found["CASES"], ast.List)
    built = []
    for call in found["CASES"].elts:
        assert isinstance(call, ast.Call) and isinstance(call.func, ast.Name) and call.func.id == "Case"
        arguments: list[Any] = [names if isinstance(each, ast.Name) else ast.literal_eval(each) for each in call.args]
        built.append(Case(*[*arguments, ast.literal_eval(call.keywords[0].value)]))
    return built


@settings(max_examples=60, deadline=None)
@given(suites())
def test_no_bit_of_a_suite_is_lost_in_its_script(suite: list[Case]) -> None:
    script = to_pytest(suite, "test_demo.py")
    compile(script, "test_demo.py", "exec")
    assert cases_in(script) == suite


@settings(max_examples=60, deadline=None)
@given(st.text(max_size=30), st.text(max_size=30))
def test_names_of_files_put_no_code_into_a_script(name: str, suite: str) -> None:
    case = Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)
    usual = to_pytest([case], "test_demo.py", suite="suite.jsonl", sha256="0")
    script = to_pytest([case], name, suite=suite or "x", sha256="0")
    shapes = [[type(node).__name__ for node in ast.walk(ast.parse(text))] for text in (usual, script)]
    assert shapes[0] == shapes[1]


def test_a_hostile_suite_is_refused_before_it_becomes_a_script(tmp_path: Path) -> None:
    path = tmp_path / "suite.jsonl"
    write_suite(path, [Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)])
    path.write_text(path.read_text().replace("together", "'+__import__('os').name+'"))
    with pytest.raises(BadSuite, match=r"case-id"):
        sealed_cases(path, checksum(path))


def test_a_suite_that_changed_since_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "suite.jsonl"
    write_suite(path, [Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)])
    seal = checksum(path)
    assert len(sealed_cases(path, seal)) == 1
    write_suite(path, [Case("demo", 0, "together", 0, ("v",), (0.2,), 20.0, seed=7)])
    with pytest.raises(BadSuite, match=r"export the script again \[suite-changed\]"):
        sealed_cases(path, seal)
    with pytest.raises(BadSuite, match=r"unreadable-file"):
        checksum(tmp_path / "nothing.jsonl")


def test_what_makes_no_script_is_refused() -> None:
    one, other = (Case(study, k, "together", 0, (), (), 20.0, seed=7) for k, study in enumerate(("demo", "other")))
    for cases, slug in (
        ([], "export-cases"),
        ([one, other], "export-cases"),
        ([one] * (MOST_EMBEDDED + 1), "export-size"),
    ):
        with pytest.raises(BadRequest, match=slug):
            to_pytest(cases, "test_demo.py")
    assert "sealed_cases(SUITE, SHA256)" in to_pytest([one] * (MOST_EMBEDDED + 1), "t.py", suite="s.jsonl", sha256="0")


def test_a_script_reads_its_study_once_however_many_cases_it_has() -> None:
    case = Case("demo", 0, "together", 0, ("v",), (0.1,), 20.0, seed=7)
    for study, found in (
        (".", "find(str(Path(__file__).parent / '.'))"),
        ("other", "find('other')"),
        ("", "find('demo')"),
    ):
        tree = ast.parse(to_pytest([case], "test_demo.py", study=study))
        calls = [ast.unparse(node) for node in ast.walk(tree) if isinstance(node, ast.Call)]
        assert [one for one in calls if one.startswith("find(")] == [found]
        assert next(node.value for node in tree.body if isinstance(node, ast.Assign)).func.id == "find"  # type: ignore[attr-defined]
        assert "judge_case(case, STUDY)" in calls
