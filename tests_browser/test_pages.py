"""Reports in a real browser: each view on a phone and on a desk, and what a reader does with it."""

from __future__ import annotations

import csv
import io
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pypdfium2
import pytest

from parcours.report.exporting import together
from parcours.report.page import to_html
from parcours.report.pieces import Page
from parcours.study.components.study import ComponentStudy
from parcours.study.finding import find
from parcours.study.journal import Journal, write_question
from parcours.study.mutation.fork_server import MutantOutcome
from parcours.study.mutation.mutant import Mutant
from parcours.study.mutation.results import MutationResults, mutation_page
from parcours.study.parameters import settings_of
from parcours.study.protocol import FaultRequest, Request
from parcours.study.provenance import provenance
from parcours.study.reporting import report_page
from parcours.study.reproducing import Reruns
from parcours.verdict.judgement import Judgement, Verdict
from parcours_navigation.comparison.analysis import analyse
from parcours_navigation.comparison.page import compare_page
from parcours_navigation.comparison.running import run_comparison
from parcours_navigation.foreign.cases import abstract_scenes
from parcours_navigation.foreign.door import RosStudy
from parcours_navigation.foreign.judging import JudgedCase
from parcours_navigation.foreign.results import Result
from parcours_ramp.faults.catalogue import catalogue
from parcours_ramp.faults.judging import CaseOutcome
from parcours_ramp.faults.reporting import SHOWN, fault_page
from parcours_ramp.faults.running import FaultResults, FaultRow
from whole_page import HOSTILE, whole_page

LONG = "\u202e" + "\u05d0bc" * 100
"""A name without a break, that says of itself that it runs from right to left."""

EXAMPLES = Path(__file__).parents[1] / "examples"
TITLES = "[...document.querySelectorAll('h2, .piece > h3, .lead p, .cases .cause th')].map((one) => one.innerText)"
UNFOLD = "for (const fold of document.querySelectorAll('details:not(.cases details)')) fold.open = true"
AT = "document.querySelector('.cases tr:target').getBoundingClientRect().top"
A4 = {"format": "A4", "margin": dict.fromkeys(("top", "bottom", "left", "right"), "15mm")}


def reported(where: str, n_cases: int, folder: Path) -> Page:
    """The report on a short run of a study."""
    study = find(where)
    study.run(Request(settings_of(study.parameters, {}, where), 1, folder, n_cases), lambda *_: None)
    return report_page([(study, {str(folder): study.read(folder)})])


def bound(folder: Path) -> Page:
    """The report on foreign nodes, with the results of a run: half of its cases pass."""
    study = find(str(EXAMPLES / "ros1_python"))
    assert isinstance(study, RosStudy)
    write_question(folder, study.name, study.where, {"seed": 1, "settings": {}})
    with Journal(folder) as journal:
        for k, scene in enumerate(itertools.islice(abstract_scenes(study.binding, 1), 8)):
            judgement = Judgement(Verdict.FAIL if k % 2 else Verdict.PASS, f"{HOSTILE} {k}")
            sent = {"obstacles": k, "plan": 2}
            journal.add(scene.id, Result(scene.id, "abstract", JudgedCase(judgement), 0.5, scene.id, sent=sent).entry())
    return report_page([(study, {str(folder): study.read(folder)})])


def ramp_under_faults() -> FaultResults:
    """Results made up: each outcome of two cases, under the whole catalogue."""
    rows = []
    for k, entry in enumerate(catalogue()):
        ended = [CaseOutcome(n, SHOWN[(k + n) % len(SHOWN)], rest_after=10**9, silent=("Planner",)) for n in range(2)]
        rows.append(FaultRow("guarded", entry, tuple(ended)))
    return FaultResults(1, (0, 1), tuple(rows), {"guarded": (9, 9)})


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> dict[str, str]:
    """Addresses of pages: with every piece and hostile words, of a campaign, of components, of a robot with replays."""
    folder = tmp_path_factory.mktemp("views")
    pages = {
        "hostile": whole_page(HOSTILE),
        "long": whole_page(LONG),
        "campaign": reported(str(EXAMPLES / "parking"), 60, folder / "parking"),
        "components": reported(str(EXAMPLES / "lift"), 12, folder / "lift"),
        "robot": reported("ramp_system", 12, folder / "ramp"),
        "binding": bound(folder / "bound"),
    }
    compared = run_comparison(["orca", "dwa", "stand-still"], folder / "compared", n_cases=8, workers=1)
    pages["compared"] = compare_page(analyse(compared))
    lift = find(str(EXAMPLES / "lift"))
    settings = settings_of(lift.parameters, {}, "lift")
    assert isinstance(lift, ComponentStudy)
    struck = lift.faults(FaultRequest(settings, frozenset(), 1, 1, "Door", 1), lambda *_: None)
    assert struck.page is not None
    pages["faults"] = struck.page
    mutants = tuple(Mutant(f"{HOSTILE}:{k}", "stale", f"{HOSTILE}.py", k, HOSTILE) for k in range(3))
    seen = {one.id: MutantOutcome("ended", {"golden twin": ("c", HOSTILE)}, 1, {}, 0, 0) for one in mutants}
    asked = ["parcours", "mutate", HOSTILE]
    pages["mutants"] = mutation_page(
        MutationResults("lift", "code", mutants, seen), provenance(), asked, Reruns("noticed mutants", 2, 3, 3)
    )
    pages["ramp-faults"] = fault_page(ramp_under_faults())
    for name, page in pages.items():
        (folder / f"{name}.html").write_text(to_html(page), encoding="utf-8")
    return {name: (folder / f"{name}.html").as_uri() for name in pages}


@pytest.mark.parametrize(
    "view",
    ["hostile", "long", "campaign", "components", "robot", "binding", "compared", "faults", "mutants", "ramp-faults"],
)
def test_a_view_is_quiet_fits_its_screen_and_has_no_violation_of_axe(
    view: str, visit: Callable[..., Any], look_over: Callable[..., None], views: dict[str, str]
) -> None:
    with visit(views[view], bypass_csp=True) as tab:
        tab.evaluate(UNFOLD)
        look_over(tab, "1280", "light")
        look_over(tab, "tablet", "light")
        look_over(tab, "phone", "dark")


def test_filters_filter_sorting_sorts_and_a_link_shows_its_case(
    visit: Callable[..., Any], views: dict[str, str]
) -> None:
    with visit(views["hostile"]) as tab:
        cases = tab.locator(".cases")
        shown = cases.locator("tbody tr[id]:visible")
        assert shown.count() == 6
        tab.get_by_label("Verdict").select_option("error")
        assert shown.count() == 2 and "2 of 6 shown" in tab.locator(".controls output").inner_text()
        tab.get_by_label("Verdict").select_option("")
        tab.get_by_label("Cause").select_option("cause_2")
        assert shown.count() == 1
        tab.get_by_label("Cause").select_option("")
        tab.get_by_label("Search").fill("/3")
        assert shown.count() == 1

        tab.get_by_label("Search").fill("")
        figures = cases.locator("tbody").first.locator("td[data-head]")
        head = cases.get_by_role("button", name="figure")
        head.press("Enter")  # by keyboard
        assert figures.all_inner_texts() == ["−10.0", "−2.5", "9.0", "10.0", "–"]
        head.click()
        assert figures.all_inner_texts() == ["10.0", "9.0", "−2.5", "−10.0", "–"]
        assert cases.locator("th[aria-sort=descending]").count() == 1

        wanted = cases.locator("tr[id]").nth(1)
        anchor = wanted.get_attribute("id")
        tab.get_by_label("Search").fill("nothing has this")
        assert shown.count() == 0
        tab.evaluate("(anchor) => { location.hash = anchor; }", anchor)
        tab.wait_for_function("document.querySelectorAll('.cases details[open]').length === 1")
        assert wanted.is_visible() and wanted.locator("details code").is_visible()


def test_a_stranger_finds_the_worst_case_and_a_colleague_opens_its_link(
    visit: Callable[..., Any], views: dict[str, str]
) -> None:
    with visit(views["campaign"]) as tab:
        tab.locator(".advice a").click()
        worst = tab.locator(".cases tr:target")
        name = worst.locator("td a").first.inner_text()
        assert worst.bounding_box()["y"] < 100 and worst.locator("details code").first.is_visible()
        assert f"parcours replay {Path(views['campaign'][7:]).parent / 'parking'} {name}" in tab.inner_text(".advice")
        last = tab.locator(".cases tbody tr[id] td:first-child a").last
        last.click()
        link = tab.url
    with visit(link, "phone") as colleague:
        sent = colleague.locator(".cases tr:target")
        assert colleague.evaluate(AT) < 100 and sent.locator("details code").first.is_visible()


def test_a_table_is_saved_as_csv_and_a_figure_as_svg(
    visit: Callable[..., Any], views: dict[str, str], tmp_path: Path
) -> None:
    with visit(views["hostile"]) as tab:
        with tab.expect_download() as table:
            tab.locator(".failures .save").click()
        table.value.save_as(tmp_path / "cases.csv")
        head, first, *rest = csv.reader(io.StringIO((tmp_path / "cases.csv").read_text(encoding="utf-8")))
        assert head == ["case", "verdict", "why", "figure [m]", "again", "cause"] and len(rest) == 5
        assert first == [f"{HOSTILE}/0", "fail", f"{HOSTILE} 0", "10.0", HOSTILE, HOSTILE]
        with tab.expect_download() as drawing:
            tab.locator("figure .save").first.click()
        drawing.value.save_as(tmp_path / "figure.svg")
        assert (
            (tmp_path / "figure.svg").read_text(encoding="utf-8").startswith('<svg xmlns="http://www.w3.org/2000/svg"')
        )
        tab.goto((tmp_path / "figure.svg").as_uri())
        assert tab.locator("svg desc").count() == 1


def test_a_replay_plays_and_a_failing_case_leads_to_it(visit: Callable[..., Any], views: dict[str, str]) -> None:
    with visit(views["robot"]) as tab:
        tab.locator(".cases").get_by_role("link", name="replay").first.click()
        replay = tab.locator("figure.replay:target")
        assert replay.is_visible()
        start = float(replay.get_by_label("Time").input_value())
        replay.get_by_role("button", name="Play").click()
        tab.wait_for_function(
            "(start) => Number(document.querySelector('figure.replay:target input[type=range]').value) > start",
            arg=start,
        )
        replay.get_by_role("button", name="Pause").click()
        assert "clearance" in replay.locator("output").inner_text() and "speed" in replay.locator("output").inner_text()
        before = float(replay.get_by_label("Time").input_value())
        replay.get_by_label("Step back").click()
        replay.get_by_label("Step back").click()
        assert before - 0.2 < float(replay.get_by_label("Time").input_value()) < before
        assert "held: collision imminent" in replay.locator(".legend").inner_text()
        with tab.expect_download() as still:
            replay.locator(".save").click()
        assert '"halts":' in Path(still.value.path()).read_text(encoding="utf-8")  # with what it was drawn from
        replay.get_by_role("button", name="Full screen").click()
        tab.wait_for_function("document.fullscreenElement !== null")


def test_recordings_of_one_case_move_together(
    visit: Callable[..., Any], look_over: Callable[..., None], tmp_path: Path
) -> None:
    folders = [tmp_path / planner for planner in ("orca", "stand-still")]
    study = find("navigation")
    for folder in folders:
        settings = settings_of(
            study.parameters, {"planner": folder.name, "require": "arrives: eventually goal_distance < 0.2"}, ""
        )
        study.run(Request(settings, 1, folder, 2), lambda *_: None)
    page = together([study.read(folder).replay("1") for folder in folders])
    (tmp_path / "both.html").write_text(to_html(page), encoding="utf-8")
    with visit((tmp_path / "both.html").as_uri(), bypass_csp=True) as tab:
        first, second = tab.get_by_label("Time").all()
        first.press("Shift+ArrowRight")
        assert first.input_value() == second.input_value() != "0"
        second.press("End")
        assert "violated arrives" in tab.locator("output").nth(1).inner_text()
        look_over(tab, "1280", "light")
        look_over(tab, "phone", "dark")


def test_paper_shows_everything_and_no_controls(visit: Callable[..., Any], views: dict[str, str]) -> None:
    with visit(views["hostile"]) as tab:
        tab.emulate_media(media="print")
        tab.evaluate("dispatchEvent(new Event('beforeprint'))")
        assert tab.locator("details.piece:not([open])").count() == 0
        for control in ("nav", ".controls", ".save", ".player"):
            assert tab.locator(f"{control}:visible").count() == 0, control
        assert tab.locator("figure.replay .still svg").first.is_visible()
        assert tab.evaluate("getComputedStyle(document.querySelector('thead')).display") == "table-header-group"
        assert len(tab.pdf(format="A4")) > 10_000


def words(text: str) -> str:
    return "".join(text.split())


@pytest.mark.parametrize("name", ["campaign", "components", "robot", "binding", "compared", "faults", "mutants"])
def test_no_page_ends_with_a_title_or_within_a_lead(
    name: str, views: dict[str, str], visit: Callable[..., Any]
) -> None:
    with visit(views[name]) as tab:
        titles = [words(title) for title in tab.evaluate(TITLES)]
        printed = pypdfium2.PdfDocument(tab.pdf(**A4))
    pages = [words(page.get_textpage().get_text_range()) for page in printed]
    for page in pages[:-1]:
        for title in titles:
            assert not page.endswith(title), title
            assert not any(page.endswith(title[:n]) for n in range(12, len(title))), title


def test_heads_of_tables_are_repeated(views: dict[str, str], visit: Callable[..., Any]) -> None:
    with visit(views["campaign"]) as tab:
        printed = pypdfium2.PdfDocument(tab.pdf(**A4))
    pages = [words(page.get_textpage().get_text_range()) for page in printed]
    going_on = [page for page in pages[1:] if page.count("parking/cases/") > 3]
    assert going_on
    for page in going_on:
        assert page.startswith("caseverdictwhy")
