"""Cells, alignment and prose: what a reader sees of a value or a sentence."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.report import prose
from parcours.report.cells import UNKNOWN, group_spans, shown, sides
from parcours.report.pieces import Column, Marked, Page, Section, Table, anchors


def test_what_is_not_known_is_a_dash_and_never_a_zero() -> None:
    column = Column("p", ".1%")
    assert [shown(cell, column) for cell in (None, math.nan, Marked(None))] == [UNKNOWN] * 3
    assert shown(0.0, column) == "0.0%"


def test_a_mark_changes_no_text() -> None:
    column = Column("p", ".2f")
    assert shown(Marked(1.234, "bad"), column) == shown(1.234, column) == "1.23"


def test_a_format_that_does_not_fit_is_refused_with_column_and_value() -> None:
    with pytest.raises(BadRequest, match=r"column 'n'.*'d'.*0\.5.*\[column-format\]"):
        shown(0.5, Column("n", "d"))


def test_numbers_keep_right_text_keeps_left_and_gaps_do_not_matter() -> None:
    columns = (Column("name"), Column("n"), Column("mixed"), Column("asked", align="center"), Column("empty"))
    table = Table("t", columns, (("a", 1, 1, 1, None), ("b", None, "x", 2, None), ("c", Marked(2.5), 3, 3, None)))
    assert sides(table) == ("left", "right", "left", "center", "left")


def test_a_row_of_another_width_is_refused() -> None:
    with pytest.raises(BadRequest, match=r"table 'rates', row 2: .* 2, but has 3; .*\[table-width\]"):
        Table("rates", (Column("a"), Column("b")), ((1, 2), (1, 2, 3)))


@given(st.lists(st.sampled_from(["", "ours", "theirs"]), min_size=1))
def test_shared_headings_span_every_column_once_and_in_order(groups: list[str]) -> None:
    table = Table("t", tuple(Column("c", group=group) for group in groups), ())
    spans = group_spans(table)
    spread = [name for name, width in spans for _ in range(width)]
    assert spread == (groups if any(groups) else [])


@given(st.text())
def test_prose_lets_no_markup_of_its_author_through(text: str) -> None:
    hostile = f"<script>{text}</script>"
    html = prose.html(hostile)
    assert "<script" not in html
    assert all(f"<{tag}" not in html for tag in ("img", "iframe", "style", "svg"))


def test_prose_knows_its_marks_and_links_only_inside_the_page() -> None:
    assert prose.html("a **b** *c* `d`") == "<p>a <strong>b</strong> <em>c</em> <code>d</code></p>"
    assert "<a" not in prose.html("[x](javascript:alert(1)) [y](//elsewhere)")
    assert prose.html("[x](#there)") == '<p><a href="#there">x</a></p>'


def test_plain_prose_keeps_the_words_and_drops_the_marks() -> None:
    assert prose.plain("**a** `b` *c* [d](#e) 2 * 3") == "a b c d 2 * 3"


@given(st.lists(st.text(max_size=8)))
def test_anchors_are_unique_and_safe_in_an_address(titles: list[str]) -> None:
    found = anchors(Page("p", "", (), tuple(Section(title, "", ()) for title in titles)))
    assert len(set(found)) == len(titles)
    assert all(name and name.isascii() and '"' not in name and " " not in name for name in found)
