"""Machines are painted by what cases took of them, and a case is drawn as a chart of who sent what to whom."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from parcours.abtc import serialise
from parcours.model.picture import Paint, PaintState, to_svg
from parcours.report.page import to_html
from parcours.report.pieces import Figure, Marked, Page, Table
from parcours.report.sequences import MOST, ChartRow, sequence_chart
from parcours.study.components.sequence import steps_to_be
from parcours.study.components.study import ComponentStudy
from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from parcours.study.reporting import report_page

LIFT = Path(__file__).parents[2] / "examples" / "lift"


@pytest.fixture(scope="module")
def broken(tmp_path_factory: pytest.TempPathFactory) -> tuple[ComponentStudy, Path, Page]:
    """A lift whose door says that it is open when it is shut; run and reported."""
    folder = tmp_path_factory.mktemp("broken")
    shutil.copytree(LIFT, folder / "lift")
    code = folder / "lift" / "lift.py"
    wrong = code.read_text(encoding="utf-8").replace(
        'took("d2", door={"shut": True})', 'took("d2", door={"shut": False})'
    )
    code.write_text(wrong, encoding="utf-8")
    study = find(str(folder / "lift"))
    assert isinstance(study, ComponentStudy)
    out = folder / "out"
    study.run(Request(settings_of(study.parameters, {}, "lift"), 1, out), lambda *_: None)
    return study, out, report_page([(study, {str(out): study.read(out)})])


def rows(page: Page) -> dict[str, dict[str, object]]:
    (table,) = (
        p for s in page.sections for p in s.pieces if isinstance(p, Table) and p.title.startswith("Transitions")
    )
    heads = [column.name for column in table.columns]
    return {str(row[1]): {**dict(zip(heads, row, strict=True)), "anchor": anchor}
            for row, anchor in zip(table.rows, table.anchors, strict=True)}  # fmt: skip


def test_what_broke_is_failing_and_what_passing_cases_took_is_covered(
    broken: tuple[ComponentStudy, Path, Page],
) -> None:
    found = rows(broken[2])
    states = {id: row["state"].value for id, row in found.items() if isinstance(row["state"], Marked)}
    assert states["c2"] == states["d2"] == "failing"
    assert states["p1"] == states["p2"] == "covered"
    assert found["p1"]["passed"] == 4 and found["d2"]["passed"] == 0


def test_a_click_on_a_transition_leads_to_its_cases_and_from_there_to_the_first_that_failed(
    broken: tuple[ComponentStudy, Path, Page],
) -> None:
    row, document = rows(broken[2])["d2"], to_html(broken[2])
    assert f'<a href="#{row["anchor"]}">' in document and f'<tr id="{row["anchor"]}">' in document
    first = row["first failing case"]
    assert isinstance(first, Marked) and f'<tr id="{first.link}">' in document


def test_every_state_has_a_line_of_its_own_and_a_hostile_anchor_ends_nothing() -> None:
    model = find(str(LIFT)).model  # type: ignore[attr-defined]
    machine = model.component("Cabin").machines[0]
    states: tuple[PaintState, ...] = ("covered", "uncovered", "infeasible", "failing")
    painted = {one.id: Paint(state, "words", '"><b>') for one, state in zip(machine.transitions, states, strict=True)}
    drawn = to_svg(machine, "", painted)
    assert all(drawn.count(f">{state}<") == 1 for state in states), "the key names each state"
    assert len({drawn.split(f'stroke="{ink}"')[1].split("/>")[0] for ink in ("#00664a", "#7a4a00", "#6b7280")}) == 3
    assert "<b>" not in drawn
    assert "covered" not in to_svg(machine)


def test_a_replay_shows_messages_in_their_order_and_marks_where_it_went_wrong(
    broken: tuple[ComponentStudy, Path, Page],
) -> None:
    study, out, page = broken
    case = str(rows(page)["d2"]["first failing case"].value)  # type: ignore[attr-defined]
    (chart,) = (p for s in study.read(out).replay(case).sections for p in s.pieces if isinstance(p, Figure))
    assert chart.alt.startswith("environment to Cabin#0: request; Cabin#0: c1; Cabin#0 to Door#1: close; Door#1: d1")
    assert "expected c2, got c3" in chart.alt
    assert 'stroke-dasharray="5 3"' in chart.svg, "what was held back is dashed"


def test_an_abstract_case_is_drawn_and_a_long_chart_keeps_its_end() -> None:
    study = find(str(LIFT))
    assert isinstance(study, ComponentStudy)
    case = next(iter(study.abstracts.values()))
    steps = steps_to_be(study.model, serialise(case))
    assert [step.text for step in steps if step.kind == "deed"] == [event.transition for event in serialise(case)]
    senders = {(step.at.partition("#")[0], step.to.partition("#")[0]) for step in steps if step.to}
    assert ("Panel", "Cabin") in senders
    chart = sequence_chart(
        "long", [*(ChartRow("deed", "<a>", f"t{k}") for k in range(MOST)), ChartRow("wrong", "<a>", "<b>")]
    )
    assert "&lt;b&gt;" in chart.svg and "<b>" not in chart.svg and f"The last {MOST} of {MOST + 1} steps" in chart.note
    assert ">t0<" not in chart.svg
