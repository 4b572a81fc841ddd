"""Text for terminals, and XML for build servers."""

from __future__ import annotations

import io
import xml.etree.ElementTree as ET

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.report.junit import CaseResult, to_junit
from parcours.report.pieces import Code, Column, Findings, KeyFigure, Marked, Page, Section, Table
from parcours.report.terminal import print_page, print_table, to_markdown, to_text
from parcours.verdict.judgement import Verdict

TABLE = Table(
    "Rates",
    (Column("vector"), Column("n", ",d"), Column("stuck", ".1%", group="ours")),
    (("(0,0,0)", 1506, 0.083), ("(0,2,4)", 7, None), ("[red]x[/red]", 12, Marked(0.125, "bad"))),
    note="A *dash*: not run.",
)


class Terminal(io.StringIO):
    """A stream that claims to be a terminal."""

    def isatty(self) -> bool:
        return True


def test_columns_of_plain_text_line_up() -> None:
    lines = to_text(TABLE).splitlines()
    rule = lines[2]
    ends = [at for at, c in enumerate(rule) if c == "-" and (at + 1 == len(rule) or rule[at + 1] == " ")]
    assert lines[3].index("1,506") + 4 == ends[1]
    assert lines[4][ends[1]] == "7"
    assert lines[4][ends[2]] == "–"
    assert lines[-1] == "A dash: not run."


def test_without_a_terminal_there_is_no_colour_and_no_line_is_broken() -> None:
    wide = Table("t", (Column("x"), Column("y")), (("a" * 300, "end"),))
    stream = io.StringIO()
    print_table(wide, stream)
    assert stream.getvalue() == to_text(wide) + "\n"
    assert "\x1b" not in stream.getvalue()


def test_a_terminal_gets_colour_and_no_color_takes_it_away(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    coloured = Terminal()
    print_table(TABLE, coloured)
    assert "\x1b[1;31m" in coloured.getvalue(), "a bad value is bold red"
    monkeypatch.setenv("NO_COLOR", "1")
    bare = Terminal()
    print_table(TABLE, bare)
    assert "\x1b[1;31m" not in bare.getvalue()
    assert "[red]x[/red]" in bare.getvalue(), "cells are no markup of the terminal's"


def test_a_cell_cannot_steer_the_terminal() -> None:
    assert "\x1b" not in to_text(Table("t\x1b[2J", (Column("\x1b]0;x\x07"),), (("\x1b[31m\r\n",),)))


def test_markdown_keeps_its_columns_whatever_a_cell_holds() -> None:
    table = Table("t", (Column("a"), Column("b")), (("x|y", "line\nbreak"),))
    lines = to_markdown(table).splitlines()
    assert len(lines) == 3
    assert [line.replace("\\|", "").count("|") for line in lines] == [3, 3, 3]


def test_a_page_on_the_terminal_says_findings_tables_and_folded_titles() -> None:
    folded = Table("All cases", (Column("id"),), (("1",), ("2",)), folded=True)
    pieces = (Findings((KeyFigure("3 %", "stuck", "of 905"),)), TABLE, folded, Code("a -> b"))
    page = Page("Report", "of *all*", (("seed", "7"),), (Section("Out", "In **short**.", pieces),))
    stream = io.StringIO()
    print_page(page, stream)
    said = stream.getvalue()
    for words in (
        "Report",
        "of all",
        "seed: 7",
        "In short.",
        "3 %  stuck (of 905)",
        to_text(TABLE),
        "2 rows",
        "a -> b",
    ):
        assert words in said
    assert "**" not in said


RESULTS = [
    CaseResult("study/abtc/0", Verdict.PASS, 1.0),
    CaseResult("study/abtc/1", Verdict.FAIL, 0.25, 'stuck <&> "here"\nsecond line'),
    CaseResult("study/abtc/2", Verdict.ERROR, 0.0, "planner raised \x1b[31mValueError\x00\ufffe"),
    CaseResult("alone", Verdict.INCONCLUSIVE, 0.5, "an obstacle rests on the goal"),
]


def test_junit_counts_agree_with_its_elements() -> None:
    root = ET.fromstring(to_junit("ramp", RESULTS))
    assert root.tag == "testsuites"
    (suite,) = root
    cases = list(suite)
    assert suite.get("tests") == str(len(cases)) == "4"
    for plural, tag in (("failures", "failure"), ("errors", "error"), ("skipped", "skipped")):
        assert suite.get(plural) == str(sum(case.find(tag) is not None for case in cases)) == "1"
    assert float(suite.get("time", "")) == pytest.approx(sum(float(case.get("time", "")) for case in cases))


def test_junit_uses_only_what_the_common_schema_knows() -> None:
    allowed = {
        "testsuites": {"name", "tests", "failures", "errors", "time"},
        "testsuite": {"name", "tests", "failures", "errors", "skipped", "time"},
        "testcase": {"classname", "name", "time"},
        "failure": {"message", "type"},
        "error": {"message", "type"},
        "skipped": {"message"},
    }
    for element in ET.fromstring(to_junit("ramp", RESULTS)).iter():
        assert set(element.attrib) <= allowed[element.tag]


def test_junit_keeps_the_reason_word_for_word_and_spells_out_control_characters() -> None:
    root = ET.fromstring(to_junit("ramp", RESULTS))
    failure, error = root.find(".//failure"), root.find(".//error")
    assert failure is not None and error is not None
    assert failure.text == RESULTS[1].why
    assert failure.get("message") == 'stuck <&> "here"'
    assert error.text == r"planner raised \x1b[31mValueError\x00\ufffe"


def test_junit_lists_a_case_under_the_parts_of_its_id() -> None:
    deeper = CaseResult("guarded/timing/study/abtc/3", Verdict.PASS, 0.0)
    cases = list(ET.fromstring(to_junit("ramp", [*RESULTS, deeper])).iter("testcase"))
    assert [(case.get("classname"), case.get("name")) for case in cases] == [
        ("study", "abtc/0"), ("study", "abtc/1"), ("study", "abtc/2"), ("ramp", "alone"),
        ("guarded.timing.study", "abtc/3"),
    ]  # fmt: skip


@given(st.text(), st.text(), st.text(), st.sampled_from(list(Verdict)))
def test_junit_is_xml_whatever_the_words_are(suite: str, case: str, why: str, verdict: Verdict) -> None:
    text = to_junit(suite, [CaseResult(case, verdict, 0.0, why)])
    root = ET.fromstring(text.encode("utf-8"))
    assert len(list(root.iter("testcase"))) == 1


@pytest.mark.parametrize("seconds", [-1.0, float("nan"), float("inf")])
def test_a_duration_that_is_none_is_refused(seconds: float) -> None:
    with pytest.raises(BadRequest, match=r"case 'a': .*\[junit-seconds\]"):
        to_junit("s", [CaseResult("a", Verdict.PASS, seconds)])
