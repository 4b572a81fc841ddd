"""The way from an edit to a run that is watched and a case that is stepped through, in a real browser."""

from __future__ import annotations

import shutil
import signal
from pathlib import Path

from playwright.sync_api import sync_playwright

from studio_server import start

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
EXAMPLES = Path(__file__).parents[1] / "examples"
HOSTILE = "<img src=x onerror=window.caught=1>.yaml"


def test_edit_run_watch_and_step(tmp_path: Path) -> None:
    shutil.copytree(EXAMPLES / "lift", tmp_path / "lift")
    text = (tmp_path / "lift/model.yaml").read_text()
    (tmp_path / HOSTILE).write_text(text.replace("dark", "'<script>window.caught=1</script>'"))
    server = start(tmp_path)
    said: list[str] = []
    try:
        with sync_playwright() as engine:
            browser = engine.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
            page = browser.new_page(viewport={"width": 390, "height": 800})
            page.on("console", lambda message: said.append(message.text))
            page.on("pageerror", lambda error: said.append(str(error)))
            page.goto(f"http://127.0.0.1:{server.port}/?token={server.token}#/file/lift%2Fmodel.yaml")
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

            page.get_by_role("link", name="lift/study.yaml").click()
            page.get_by_role("button", name="Abstract cases").click()
            page.locator("main td a").first.click()
            page.locator("ol.events li.lit").wait_for()
            page.locator("ol.events").press("End")
            assert page.locator("ol.events li.lit").inner_text() == page.locator("ol.events li").last.inner_text()
            assert page.locator("ellipse.lit").count() == 3  # each machine is in one state
            assert page.evaluate("document.documentElement.scrollWidth") <= 390

            page.get_by_role("link", name=HOSTILE).click()
            page.locator(".drawing svg").first.wait_for()
            assert page.evaluate("window.caught") is None
            browser.close()
    finally:
        server.process.send_signal(signal.SIGTERM)
    assert server.process.wait(10) == 0
    assert said == []
