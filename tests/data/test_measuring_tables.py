"""The coverage of any table is what counting by hand gives, and tables of many makes are read."""

from __future__ import annotations

import itertools
import json
import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import InputModel, enumeration, split
from parcours.data.inputs import constraint_of
from parcours.data.measuring import HeldCombinations, cover, measure
from parcours.data.tables import read_table
from parcours.errors import BadRequest
from parcours.model.expression import parse_expression
from parcours_formats.pict import parse_pict

DOMAINS = (
    split("v", "m/s", [0.0, 0.25, 0.5]),
    enumeration("mode", ["auto", "manual", "off"]),
    split("n", "1", [1, 3, 6], kind="integer"),
)
RULES = (
    constraint_of("stop", parse_expression("mode != 'off' || v <= 0.25"), DOMAINS),
    constraint_of("few", parse_expression("n == '[1, 3]' || mode != 'auto'"), DOMAINS, over="blocks"),
)
MODEL = InputModel("m", DOMAINS, RULES)
CELLS = st.tuples(
    st.sampled_from([0.0, 0.1, 0.25, 0.4, 0.7]), st.sampled_from([0.0, 1.0, 2.0]), st.sampled_from([1.0, 2.5, 3.0, 5.0])
)


def is_allowed(v: int, mode: int, n: int) -> bool:
    return (mode != 2 or v == 0) and (n == 0 or mode != 0)


@settings(max_examples=80, deadline=None)
@given(st.lists(CELLS, max_size=10), st.integers(1, 3))
def test_coverage_is_what_counting_gives(rows: list[tuple[float, float, float]], strength: int) -> None:
    counted = []
    for v, mode, n in rows:
        blocks = (int(v > 0.25), int(mode), int(n > 3))
        if v <= 0.5 and n != 2.5 and is_allowed(*blocks):
            counted.append(blocks)
    wanted, held = set(), set()
    for columns in itertools.combinations(range(3), strength):
        for row in itertools.product(range(2), range(3), range(2)):
            if is_allowed(*row):
                wanted.add((columns, tuple(row[c] for c in columns)))
        held |= {(columns, tuple(row[c] for c in columns)) for row in counted}
    found = measure(np.array(rows, dtype=float).reshape(len(rows), 3), MODEL, strength)
    assert (found.n_wanted, found.n_held, found.n_counted) == (len(wanted), len(held), len(counted))
    assert len(found.missing) == found.n_missing == len(wanted - held)
    assert len(found.uncounted) == len(rows) - len(counted)
    assert found.is_complete == (wanted == held) and found.share == pytest.approx(len(held) / len(wanted))


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(CELLS, st.integers(0, 1)), max_size=12), st.integers(0, 12), st.integers(1, 3))
def test_tables_one_after_the_other_and_groups_hold_what_each_holds_alone(
    rows: list[tuple[tuple[float, float, float], int]], cut: int, strength: int
) -> None:
    table = np.array([row for row, _ in rows], dtype=float).reshape(len(rows), 3)
    of = np.array([group for _, group in rows], np.int64)
    found, parts = HeldCombinations(MODEL, strength, 2), [cover(MODEL, part) for part in (table[:cut], table[cut:])]
    counted = sum(found.add(table[part], of[part]).sum() for part in (slice(0, cut), slice(cut, None)))
    for group, alone in ((None, table), (0, table[of == 0]), (1, table[of == 1])):
        one = measure(alone, MODEL, strength)
        assert found.held(group) == (one.n_held, one.missing) and found.n_wanted == one.n_wanted
    assert counted == measure(table, MODEL, strength).n_counted
    assert parts[0] + parts[1] == cover(MODEL, table)


def test_what_is_missing_or_does_not_count_is_said() -> None:
    table = np.array([[0.1, 2.0, 2.0], [0.9, 0.0, 1.0], [0.4, 2.0, 1.0], [0.1, 0.0, 5.0], [0.1, 1.0, 1.5]])
    found = measure(table, MODEL)
    assert found.uncounted == (
        (2, "v = 0.9 lies in no block"),
        (3, "it breaks 'stop'"),
        (4, "it breaks 'few'"),
        (5, "n = 1.5 lies in no block"),
    )
    assert "v = (0.25, 0.5], mode = manual" in found.missing and found.n_forbidden == 2


def test_only_so_much_is_listed_as_is_asked_for() -> None:
    found = measure(np.zeros((0, 3)), MODEL, most_shown=2)
    assert len(found.missing) == 2 < found.n_missing


def test_tables_and_strengths_that_do_not_fit_are_refused() -> None:
    with pytest.raises(BadRequest, match="table-shape"):
        measure(np.zeros((1, 2)), MODEL)
    with pytest.raises(BadRequest, match="strength"):
        measure(np.zeros((1, 3)), MODEL, 0)


TABLE = [[0.1, 2.0, 2.0], [0.4, 0.0, 5.0]]


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("t.csv", "n,extra,mode,v\n2,x,off,0.1\n\n5,,auto,4e-1\n"),
        ("t.csv", "\ufeffv, mode, n\r\n0.1, off, 2\r\n0.4, auto, 5\r\n"),
        ("t.jsonl", '{"v": 0.1, "mode": "off", "n": 2}\n\n{"n": 5, "mode": 0, "v": 0.4, "more": []}\n'),
        (
            "t.jsonl",
            '{"parcours": "suite/1"}\n{"id": "a", "values": {"v": 0.1, "mode": 2, "n": 2}}\n'
            '{"id": "b", "values": {"v": 0.4, "mode": 0, "n": 5}}\n{"cases": 2}\n',
        ),
        ("t.json", json.dumps({"names": ["mode", "v", "n"], "rows": [["off", 0.1, 2], ["auto", 0.4, 5]], "seed": 1})),
    ],
)
def test_tables_of_many_makes_say_the_same(tmp_path: Path, name: str, text: str) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert read_table(tmp_path / name, MODEL).tolist() == TABLE


def test_a_cell_that_is_no_value_lies_in_no_block(tmp_path: Path) -> None:
    (tmp_path / "t.csv").write_text("v,mode,n\nfast,auto,1\n0.1,car,1\n0.1,auto,\n" + "9" * 999 + ",auto,1\n")
    found = measure(read_table(tmp_path / "t.csv", MODEL), MODEL)
    assert found.n_counted == 0 and len(found.uncounted) == 4


@pytest.mark.parametrize(
    ("name", "content", "told"),
    [
        ("t.csv", b"v,mode\n", "n have none"),
        ("t.csv", b"", "v, mode, n have none"),
        ("t.csv", b"v,mode,n\n1,2\n", "t.csv:2.*3 cells"),
        ("t.csv", b'v,mode,n\n"' + b"x" * 200_000 + b'",1,1\n', "must be CSV"),
        ("t.csv", b"\xff\xfe\x00", "UTF-8"),
        ("t.jsonl", b'{"v": 1}\n', "t.jsonl:1"),
        ("t.jsonl", b"[1]\n", "must be an object"),
        ("t.jsonl", b"{\n", "must be JSON"),
        ("t.jsonl", b"[" * 100_000, "must be JSON"),
        ("t.json", b'{"names": [], "rows": 3}', "names and rows"),
        ("t.json", b'{"names": ["v", "mode", "n"], "rows": [[1]]}', "row 1 has not"),
        ("absent.csv", None, "No such file"),
    ],
)
def test_files_that_are_no_tables_are_refused_with_one_answer(
    tmp_path: Path, name: str, content: bytes | None, told: str
) -> None:
    if content is not None:
        (tmp_path / name).write_bytes(content)
    with pytest.raises(BadRequest, match=told):
        read_table(tmp_path / name, MODEL)


def test_what_pict_prints_is_read_with_its_model(tmp_path: Path) -> None:
    reading = parse_pict("Format tool: Quick, Slow, ~None\nSIZE: 1, 10, ~-1", "disk.pict")
    table = tmp_path / "cases.txt"
    table.write_text("Format tool\tSIZE\nquick\t10\n~None\t1\nSlow\t~-1\n")
    assert read_table(table, reading.model, reading.titles).tolist() == [[0, 10], [2, 1], [1, -1]]
    table.write_text("size;Format_tool\n1;SLOW\n")
    assert read_table(table, reading.model, reading.titles).tolist() == [[1, 1]]


def test_a_pipe_or_a_device_is_no_table(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path / "pipe", Path("/dev/zero")):
        with pytest.raises(BadRequest, match=r"no regular file.*unreadable-file"):
            read_table(path, MODEL)
