"""Data files: what they say arrives, and whatever is wrong with one is said at once, with lines."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from parcours.data import parse_input_model, read_input_model
from parcours.errors import BadDomain, BadRequest

GOOD = """\
parcours: data/1
name: two
repeat: 2
constants:
  gap: {value: 0.2, unit: m}
  start: {value: -1, unit: m}
parameters:
  x: {unit: m, range: "[0, 2]", blocks: ["[0, 1]", "(1, 2]"], doc: where it stands}
  w: {unit: rad/s, edges: [-pi/2, 0, pi/2]}
  n: {unit: "1", kind: integer, edges: [2, 5, 7], closed: left}
constraints:
  apart: {pairs: abs(a.x - b.x) >= gap}
  ahead: {each: x > start, doc: why}
  first: {row: x1 != x2 && n1 >= 2}
"""


def test_a_file_arrives_with_its_numbers_units_replicas_and_rules() -> None:
    model = parse_input_model(GOOD, "two.yaml")
    assert model.names == ("x1", "w1", "n1", "x2", "w2", "n2")
    assert model.sizes == (2, 2, 2, 2, 2, 2) and model.repeat == 2 and model.source == "two.yaml"
    x, w, n = model.domains[:3]
    assert (x.unit, x.doc, str(x.stated), [str(b) for b in x.blocks]) == (
        "m", "where it stands", "[0, 2]", ["[0, 1]", "(1, 2]"])  # fmt: skip
    assert w.span.low == -math.pi / 2 and w.block_of(0.0) == 0
    assert n.kind == "integer" and n.block_of(5.0) == 1
    assert [str(rule) for rule in model.constraints] == [
        "apart(1, 2): abs(x1 - x2) >= 0.2",
        "ahead(1): x1 > -1.0",
        "ahead(2): x2 > -1.0",
        "first: x1 != x2 && n1 >= 2",
    ]


def test_constants_can_be_replaced_by_name() -> None:
    model = parse_input_model(GOOD, "two.yaml", {"gap": 0.42})
    assert str(model.constraints[0]) == "apart(1, 2): abs(x1 - x2) >= 0.42"
    with pytest.raises(BadRequest, match=r"did you mean 'gap'"):
        parse_input_model(GOOD, "two.yaml", {"gab": 0.42})
    with pytest.raises(BadRequest, match="finite"):
        parse_input_model(GOOD, "two.yaml", {"gap": math.inf})


@pytest.mark.parametrize(
    ("old", "new", "line", "slug"),
    [
        ("data/1", "data/9", 1, "format"),
        ("name: two\n", "", 1, "missing-key"),
        ("repeat: 2", "repeat: 1e9", 3, "value"),
        ("value: 0.2", "value: 1 / 0", 5, "division-by-zero"),
        ("value: 0.2", "value: gob", 5, "no-value"),
        ("value: 0.2", "value: true", 5, "number"),
        ("  gap:", "  pi:", 5, "duplicate-name"),
        ("unit: m, range", "range", 8, "missing-key"),
        ("unit: m, range", "unit: [m], range", 8, "kind"),
        ('"[0, 1]"', '"[0, 1"', 8, "interval"),
        ('"[0, 1]"', '"[0, 0.9]"', 8, "blocks-gap"),
        ('"[0, 1]"', '"[0, 1.1]"', 8, "blocks-overlap"),
        ('"[0, 1]"', '"[0, 1)"', 8, "blocks-edge"),
        ('range: "[0, 2]"', 'range: "[0, 3]"', 8, "blocks-range"),
        ("[-pi/2, 0, pi/2]", "[0, 0]", 9, "edges-order"),
        ("[-pi/2, 0, pi/2]", "[0]", 9, "edges-few"),
        ("[-pi/2, 0, pi/2]", "[0, 2e999]", 9, "overflow"),
        ("[-pi/2, 0, pi/2]", "0", 9, "kind"),
        ("edges: [-pi/2, 0, pi/2]", "closed: left", 9, "blocks-or-edges"),
        ("edges: [-pi/2", 'blocks: ["[0, 1]"], edges: [-pi/2', 9, "blocks-or-edges"),
        ("kind: integer", "kind: whole", 10, "choice"),
        ("closed: left", "close: left", 10, "unknown-key"),
        ("  n: {", "  gap: {", 10, "duplicate-name"),
        ("  n: {", "  x: {", 10, "duplicate-key"),
        ("pairs: abs(a.x - b.x) >= gap", "pairs: abs(a.x - b.z) >= gap", 12, "unknown-name"),
        ("pairs: abs(a.x - b.x) >= gap", "pairs: abs(a.x - b.x)", 12, "type"),
        ("pairs: abs", "row: x1 > 0, pairs: abs", 12, "constraint-scope"),
        ("each: x > start", "each: x >> start", 13, "syntax"),
        ("row: x1", "row: x3", 14, "unknown-name"),
    ],
)
def test_each_fault_is_found_at_its_line(old: str, new: str, line: int, slug: str) -> None:
    assert old in GOOD
    with pytest.raises(BadDomain) as caught:
        parse_input_model(GOOD.replace(old, new, 1), "two.yaml")
    assert f"two.yaml:{line}: " in str(caught.value)
    assert f"[{slug}]" in str(caught.value)


def test_a_number_that_cannot_be_read_has_no_other_faults() -> None:
    with pytest.raises(BadDomain) as caught:
        parse_input_model(GOOD.replace("[-pi/2, 0, pi/2]", "[0, 2e999]", 1), "two.yaml")
    assert caught.value.slug == "overflow"


def test_all_faults_are_said_together() -> None:
    broken = GOOD.replace('"[0, 1]"', '"[0, 0.9]"').replace("kind: integer", "kind: whole")
    with pytest.raises(BadDomain) as caught:
        parse_input_model(broken, "two.yaml")
    assert "two.yaml:8" in str(caught.value) and "two.yaml:10" in str(caught.value)


def test_replica_rules_need_replicas() -> None:
    with pytest.raises(BadDomain, match="constraint-scope"):
        parse_input_model(GOOD.replace("repeat: 2\n", ""), "two.yaml")


def test_names_that_collide_when_numbered_are_refused() -> None:
    text = "parcours: data/1\nname: m\nrepeat: 11\nparameters:\n  x: {unit: m, edges: [0, 1]}\n"
    text += "  x1: {unit: m, edges: [0, 1]}\n"
    with pytest.raises(BadDomain, match="'x11' when numbered"):
        parse_input_model(text, "m.yaml")


def test_a_file_cannot_stand_for_more_columns_or_constraints_than_allowed() -> None:
    many = "".join(f"  p{i}_: {{unit: m, edges: [0, 1]}}\n" for i in range(20))
    head = "parcours: data/1\nname: m\nrepeat: 100\nparameters:\n"
    with pytest.raises(BadDomain, match="columns"):
        parse_input_model(head + many, "m.yaml")
    with pytest.raises(BadDomain, match="columns"):
        parse_input_model(head + "  x: {unit: m, edges: [0, 1]}\nconstraints: {c: {pairs: a.x != b.x}}\n", "m.yaml")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "a: &x [1]\nb: *x",
        "!!python/object/apply:os.system ['true']",
        "a: " + "[" * 40 + "]" * 40,
        "a: 1\n---\nb: 2",
        "parcours: data/1\nname: m\nparameters: {}\n",
        "parcours: data/1\nname: m\nparameters: {x: {unit: m, edges: [0, " + "(" * 500 + "1" + ")" * 500 + "]}}",
        "parcours: data/1\nname: m\nparameters: {x: {unit: m, edges: [0, " + "9" * 2000 + "]}}",
        "x" * 1_000_001,
    ],
    ids=[
        "empty",
        "list",
        "alias",
        "tag",
        "nesting",
        "two documents",
        "no parameter",
        "parentheses",
        "digits",
        "size",
    ],
)
def test_hostile_text_gets_one_clear_answer(text: str) -> None:
    with pytest.raises(BadDomain, match=r"\[[a-z-]+\]$"):
        parse_input_model(text, "hostile.yaml")


@settings(max_examples=150, deadline=None)
@given(st.integers(0, len(GOOD) - 1), st.integers(0, 12), st.text("{}[](),:\"'-|&*!%#\n 0x9.é\x00", max_size=4))
def test_a_damaged_file_is_read_or_refused_but_never_breaks_the_reader(at: int, cut: int, put: str) -> None:
    damaged = GOOD[:at] + put + GOOD[at + cut :]
    try:
        model = parse_input_model(damaged, "damaged.yaml")
    except BadDomain as error:
        assert str(error).startswith("damaged.yaml")
    else:
        assert model.domains


def test_files_that_cannot_be_read_are_refused_by_name(tmp_path: Path) -> None:
    with pytest.raises(BadDomain, match=r"absent.yaml.*No such file.*unreadable-file"):
        read_input_model(tmp_path / "absent.yaml")
    with pytest.raises(BadDomain, match="unreadable-file"):
        read_input_model(tmp_path)
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadDomain, match="UTF-8"):
        read_input_model(tmp_path / "bytes.yaml")
