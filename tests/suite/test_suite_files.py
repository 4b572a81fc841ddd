"""Suite files: what is written is read back to the bit; what is damaged is refused with its line."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from parcours.data import InputModel, split
from parcours.errors import BadSuite
from parcours.suite import Case, combine, read_suite, write_suite

NAMES = st.from_regex(r"[a-z_][a-z0-9_]{0,5}", fullmatch=True)
PARTS = st.from_regex(r"[A-Za-z0-9][A-Za-z0-9_.+@=,-]{0,11}", fullmatch=True)
VALUES = st.dictionaries(NAMES, st.floats(-1e300, 1e300), max_size=4)
CASES = st.lists(
    st.tuples(PARTS, PARTS, st.integers(0, 2**63 - 1), VALUES, st.floats(1e-9, 1e9), st.integers(0, 2**64 - 1)),
    max_size=5,
).map(
    lambda rows: [
        Case(study, 3 * number, abstract, row, tuple(values), tuple(values.values()), budget, seed)
        for number, (study, abstract, row, values, budget, seed) in enumerate(rows)
    ]
)
PLAN = combine("s", ["a", "b"], InputModel("m", (split("v", "m/s", [0.0, 0.25, 0.5]),)), seed=7)


@pytest.fixture
def suite(tmp_path: Path) -> Path:
    path = tmp_path / "suite.jsonl"
    assert write_suite(path, PLAN.cases()) == 4
    return path


@settings(max_examples=60, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(CASES)
def test_a_suite_is_read_back_as_it_was_written(tmp_path: Path, cases: list[Case]) -> None:
    assert write_suite(tmp_path / "suite.jsonl", cases) == len(cases)
    assert list(read_suite(tmp_path / "suite.jsonl")) == cases


def test_the_same_plan_gives_the_same_bytes(suite: Path) -> None:
    before = suite.read_bytes()
    write_suite(suite, PLAN.cases())
    assert suite.read_bytes() == before


def test_a_file_cut_anywhere_is_refused(suite: Path) -> None:
    whole = suite.read_bytes()
    for end in range(len(whole) - 1):
        suite.write_bytes(whole[:end])
        with pytest.raises(BadSuite):
            list(read_suite(suite))


def test_the_cases_before_the_damage_can_still_be_streamed(suite: Path) -> None:
    lines = suite.read_bytes().splitlines(keepends=True)
    suite.write_bytes(b"".join(lines[:3]))
    stream = read_suite(suite)
    assert [next(stream).number, next(stream).number] == [0, 1]
    with pytest.raises(BadSuite, match=r"suite.jsonl:3: .*stops after 2.*suite-cut"):
        next(stream)


@pytest.mark.parametrize(
    ("line", "old", "new", "slug"),
    [
        (1, "suite/1", "suite/2", "suite-format"),
        (2, '"number":0', '"number":0.5', "suite-case"),
        (2, '"number":0', '"number":true', "suite-case"),
        (2, '"number":0', '"number":-1', "case-number"),
        (2, '"number":0', f'"number":{10**30}', "case-number"),
        (2, '"seed":7', '"seed":"7"', "suite-case"),
        (2, '"seed":7', '"seed":7,"seed":7', "suite-line"),
        (2, '"seed":7', '"extra":7', "suite-case"),
        (2, '"time_budget":20.0', '"time_budget":0', "time-budget"),
        (2, '"time_budget":20.0', '"time_budget":NaN', "suite-line"),
        (2, '"time_budget":20.0', '"time_budget":1e400', "suite-case"),
        (2, '"values":{"v":', '"values":{"v":[1],"w":', "suite-case"),
        (2, '"values":{"v":', '"values":{"\\u001b[31m":', "case-values"),
        (2, '"study":"s"', '"study":"../s"', "case-id"),
        (2, '"id":"s/a/0"', '"id":"s/a/1"', "suite-case"),
        (3, '"number":1', '"number":0', "suite-order"),
        (6, '{"cases":4}', '{"cases":5}', "suite-cut"),
        (6, '{"cases":4}', "[4]", "suite-line"),
        (6, '{"cases":4}\n', '{"cases":4}\n{"cases":4}\n', "suite-cut"),
    ],
)
def test_each_fault_is_refused_at_its_line(suite: Path, line: int, old: str, new: str, slug: str) -> None:
    lines = suite.read_text().splitlines(keepends=True)
    assert old in lines[line - 1]
    lines[line - 1] = lines[line - 1].replace(old, new)
    suite.write_text("".join(lines))
    with pytest.raises(BadSuite, match=rf"suite.jsonl:\d+: .*\[{slug}\]") as caught:
        list(read_suite(suite))
    assert caught.value.where.rpartition(":")[2] in (str(line), str(line + 1))


@pytest.mark.parametrize(
    "raw",
    [
        b"",
        b"\n",
        b"\xff\xfe\n",
        b"null\n",
        b"[" * 100_000 + b"\n",
        b"x" * 1_000_001,
        b'{"a":' + b"9" * 5000 + b"}\n",
    ],
    ids=["empty", "blank", "bytes", "null", "nesting", "long line", "digits"],
)
def test_hostile_first_lines_and_later_lines_get_one_clear_answer(suite: Path, raw: bytes) -> None:
    good = suite.read_bytes().splitlines(keepends=True)
    for content in (raw, good[0] + raw):
        suite.write_bytes(content)
        with pytest.raises(BadSuite, match=r"suite.jsonl:\d+: .*\[suite-[a-z]+\]"):
            list(read_suite(suite))


def test_a_write_that_fails_midway_leaves_the_old_file_and_nothing_else(suite: Path) -> None:
    def breaking() -> Iterator[Case]:
        yield PLAN.case(0)
        raise KeyboardInterrupt

    before = suite.read_bytes()
    with pytest.raises(KeyboardInterrupt):
        write_suite(suite, breaking())
    with pytest.raises(BadSuite, match="suite-order"):
        write_suite(suite, [PLAN.case(1), PLAN.case(0)])
    assert suite.read_bytes() == before and list(suite.parent.iterdir()) == [suite]


def test_places_that_cannot_be_written_or_read_are_named(tmp_path: Path) -> None:
    with pytest.raises(BadSuite, match="suite-unwritable"):
        write_suite(tmp_path / "absent" / "suite.jsonl", PLAN.cases())
    with pytest.raises(BadSuite, match="suite-unwritable"):
        write_suite(tmp_path, PLAN.cases())
    assert not list(tmp_path.iterdir())
    for path in (tmp_path / "absent.jsonl", tmp_path):
        with pytest.raises(BadSuite, match="unreadable-file"):
            read_suite(path)


def test_a_line_holds_what_another_tool_needs(suite: Path) -> None:
    record = json.loads(suite.read_text().splitlines()[1])
    case = PLAN.case(0)
    assert record == {
        "id": "s/a/0", "study": "s", "number": 0, "abstract": "a", "row": 0, "values": {"v": case["v"]},
        "time_budget": 20.0, "seed": 7,
    }  # fmt: skip


def test_an_input_that_a_case_does_not_have_is_a_key_error() -> None:
    with pytest.raises(KeyError, match="omega"):
        PLAN.case(0)["omega"]
