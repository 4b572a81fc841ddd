"""The studio in a real browser: every view, and the way from an edit to a run watched and a case stepped through."""

from __future__ import annotations

import shutil
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from urllib.parse import quote

import pytest

from parcours.study.finding import find
from parcours.study.parameters import settings_of
from parcours.study.protocol import Request
from studio_server import Server, start

EXAMPLES = Path(__file__).parents[1] / "examples"
HOSTILE = "<img src=x onerror=window.caught=1>.yaml"
CASE = "ITP1-tp21.tp11.tp21-0.0.0"
# Address of a view, and what has come when it is complete
VIEWS = {
    "browse": ("#/", "#before"),
    "model": ("#/file/lift%2Fmodel.yaml", ".drawing svg"),
    "study": ("#/file/lift%2Fstudy.yaml", ".drawing svg"),
    "findings": ("#/file/wrong.yaml", ".error-word"),
    "hostile": (f"#/file/{quote(HOSTILE)}", ".drawing svg"),
    "binding": ("#/file/ros2_python%2Fbinding.yaml", ".drawing svg"),
    "world": ("#/file/yard.yaml", ".drawing svg"),
    "step a study": (f"#/step/lift%2Fstudy.yaml/{CASE}", "ol.events li.lit"),
    "step a model": (f"#/step/lift%2Fmodel.yaml/{CASE}", "ol.events li.lit"),
    "run of components": ("#/run/out%2Flift", "tbody tr"),
    "run with failures": ("#/run/out%2Fparking-1", "p code"),
    "compare": ("#/compare/out%2Fparking-1/out%2Fparking-2", "tbody tr"),
    "compare others": ("#/compare/out%2Flift/out%2Fparking-2", "tbody tr"),
}


@pytest.fixture(scope="module")
def studio(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    """A folder with studies, files of every kind, finished runs, and names that are HTML."""
    root = tmp_path_factory.mktemp("studio")
    for name in ("lift", "parking", "ros1_python", "ros2_python"):
        shutil.copytree(EXAMPLES / name, root / name)
    shutil.copy(EXAMPLES / "ros2_navigation/yard.yaml", root)
    text = (root / "lift/model.yaml").read_text()
    (root / HOSTILE).write_text(text.replace("dark", "'<script>window.caught=1</script>'"))
    (root / "wrong.yaml").write_text(text.replace("initial:", "initiall:").replace("to: lit", "to: litt"))
    for name, seed, cases, run in (
        ("lift", 1, None, "lift"),
        ("parking", 1, 60, "parking-1"),
        ("parking", 2, 60, "parking-2"),
    ):
        study = find(str(root / name))
        study.run(Request(settings_of(study.parameters, {}, name), seed, root / "out" / run, cases), lambda *_: None)
    found = start(root)
    yield found
    found.process.send_signal(signal.SIGTERM)
    assert found.process.wait(10) == 0


def test_every_view_is_quiet_fits_its_screen_and_has_no_violation_of_axe(
    studio: Server, visit: Callable[..., Any], look_over: Callable[..., None]
) -> None:
    host = f"http://127.0.0.1:{studio.port}/"
    with visit(f"{host}?token={studio.token}", bypass_csp=True) as tab:
        tab.locator("nav a").first.wait_for()
        for address, complete in VIEWS.values():
            tab.evaluate("(to) => { document.querySelector('main').replaceChildren(); location.hash = to; }", address)
            tab.locator("main").locator(complete).first.wait_for()
            for size, scheme in (("phone", "dark"), ("1280", "light"), ("desk", "dark")):
                look_over(tab, size, scheme)
        assert tab.evaluate("window.caught") is None


def test_a_view_that_was_left_draws_no_more(studio: Server, visit: Callable[..., Any]) -> None:
    with visit(f"http://127.0.0.1:{studio.port}/?token={studio.token}#/file/lift%2Fmodel.yaml") as tab:
        tab.locator(".drawing svg").first.wait_for()
        held: list[Any] = []
        tab.route("**/api/files*", lambda route: held.append(route))
        with tab.expect_request("**/api/files*"):
            tab.get_by_role("link", name="Parcours studio").click()  # which asks what runs there are
        tab.evaluate(f"location.hash = '#/step/lift%2Fmodel.yaml/{CASE}'")
        tab.locator("ol.events li.lit").wait_for()
        tab.evaluate("document.querySelector('nav').replaceChildren()")
        held.pop().continue_()
        tab.locator("nav a").first.wait_for()
        assert tab.locator("main h2").all_inner_texts() == [CASE]


def test_a_study_in_python_is_run_and_read_only_when_it_is_wanted(
    studio: Server, visit: Callable[..., Any], look_over: Callable[..., None]
) -> None:
    (studio.root / "own.py").write_text(
        "from dataclasses import replace\nfrom parcours.study.finding import find\n"
        "STUDY = replace(find('parking'), where='')\n"
    )
    with visit(f"http://127.0.0.1:{studio.port}/?token={studio.token}#/", bypass_csp=True) as tab:
        tab.get_by_text("Run a registered study, or one in Python").click()
        tab.get_by_label("study").fill("own.py:STUDY")
        tab.get_by_label("settings").fill("delay=0.2")
        tab.get_by_label("cases").fill("8")
        look_over(tab, "phone", "dark")
        look_over(tab, "1280", "light")
        tab.get_by_role("button", name="Run", exact=True).click()
        tab.locator("[data-finished='8']").wait_for()
        tab.reload()
        tab.get_by_text("looking does not run").wait_for()
        look_over(tab, "phone", "light")
        tab.get_by_role("button", name="Run its code").click()
        tab.locator("[data-finished='8']").wait_for()


def test_edit_run_watch_and_step(visit: Callable[..., Any], look_over: Callable[..., None], tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "lift", tmp_path / "lift")
    text = (tmp_path / "lift/model.yaml").read_text()
    server = start(tmp_path)
    try:
        with visit(
            f"http://127.0.0.1:{server.port}/?token={server.token}#/file/lift%2Fmodel.yaml", "phone", bypass_csp=True
        ) as page:
            page.locator(".drawing svg").first.wait_for()
            assert "token" not in page.url

            page.locator("textarea").fill(text.replace("initial:", "initiall:", 1))
            assert "unknown-key" in page.locator(".findings").get_by_text("initiall").inner_text()
            page.locator("textarea").fill(text.replace("doc: one cabin", "doc: a cabin"))
            page.locator(".findings .good").wait_for()
            page.locator("textarea").press("Control+s")
            page.get_by_text("saved lift/model.yaml").wait_for()
            assert "doc: a cabin" in (tmp_path / "lift/model.yaml").read_text()

            page.get_by_role("link", name="lift/study.yaml").click()
            page.get_by_role("button", name="Run", exact=True).click()
            page.locator("[data-finished='8']").wait_for()
            assert "100.0 %" in page.locator("main").inner_text()
            page.get_by_text("ended with exit code 0").wait_for()
            look_over(page, "phone", "dark")

            page.get_by_role("link", name="lift/study.yaml").click()
            page.get_by_role("button", name="Abstract cases").click()
            page.locator("main td a").first.wait_for()
            look_over(page, "phone", "light")
            page.locator("main td a").first.click()
            page.locator("ol.events li.lit").wait_for()
            page.locator("ol.events").press("End")
            assert page.locator("ol.events li.lit").inner_text() == page.locator("ol.events li").last.inner_text()
            assert page.locator("ellipse.lit").count() == 3  # each machine is in one state
    finally:
        server.process.send_signal(signal.SIGTERM)
    assert server.process.wait(10) == 0
