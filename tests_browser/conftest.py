"""Debian's Chromium, driven by Playwright: one for all tests, a fresh visit for each page."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Dialog, sync_playwright
from playwright.sync_api import Page as Tab

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
SIZES = {"phone": (390, 844), "tablet": (768, 1024), "1280": (1280, 900), "desk": (1920, 1080)}
# Columns that are cut: no table is wider than its place, but on small screens those that may be scrolled by keyboard,
# in a region with a name; cases that did not pass never are.
CUT = """[...document.querySelectorAll('main table')].filter((table) => {
    const place = table.parentElement, scrolls = getComputedStyle(place).overflowX === 'auto';
    const named = place.tabIndex === 0 && place.getAttribute('aria-label') && place.getAttribute('role');
    const cut = table.scrollWidth > place.clientWidth + 1;
    return cut && !(innerWidth < 1000 && !table.matches('.cases') && scrolls && named);
}).map((table) => `${table.dataset.name}: ${table.scrollWidth} px`)"""
# Text of drawings below 11 px, as it is on the screen: its size times the scale of the drawing.
SMALL = """[...document.querySelectorAll('main svg text, main svg tspan')].flatMap((text) => {
    const to = (text.closest('text') ?? text).getScreenCTM(), shown = text.getBoundingClientRect().width;
    if (!shown || !to) return [];
    const size = parseFloat(getComputedStyle(text).fontSize) * Math.sqrt(Math.abs(to.a * to.d - to.b * to.c));
    return size < 10.95 ? [`${text.textContent}: ${size.toFixed(1)} px`] : [];
}).slice(0, 5)"""

# What a page does when its window is resized is done with the next frame; the one after that shows it.
DRAWN = "() => new Promise((drawn) => requestAnimationFrame(() => requestAnimationFrame(drawn)))"

# From file://, axe cannot load style sheets by itself, and would say so on the console; what passes is of no interest.
AXE = {"preload": False, "resultTypes": ["violations"]}


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with sync_playwright() as engine:
        started = engine.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield started
        started.close()


class Visit:
    """A page opened in the browser; when it is left, its console must have said nothing."""

    def __init__(self, browser: Browser, address: str, size: str = "1280", **options: Any) -> None:
        width, height = SIZES[size]
        context = browser.new_context(viewport={"width": width, "height": height}, **options)
        self.tab: Tab = context.new_page()
        self.said: list[str] = []
        self.tab.on("console", lambda message: self.said.append(message.text))
        self.tab.on("pageerror", lambda error: self.said.append(str(error)))
        self.tab.on("dialog", self._refuse)
        self.tab.goto(address)

    def _refuse(self, dialog: Dialog) -> None:
        self.said.append(dialog.message)
        dialog.dismiss()

    def __enter__(self) -> Tab:
        return self.tab

    def __exit__(self, *error: object) -> None:
        self.tab.context.close()
        assert error[0] is not None or not self.said, self.said


@pytest.fixture(scope="session")
def visit(browser: Browser) -> Callable[..., Visit]:
    """Opens an address: `with visit(address, size, **options of the context) as tab`."""
    return lambda address, size="1280", **options: Visit(browser, address, size, **options)


@pytest.fixture(scope="session")
def look_over() -> Callable[[Tab, str, str], None]:
    """Looks at a page as it is, on a screen of a size, light or dark, for what a reader would stumble over."""
    axe = Axe()

    def look(tab: Tab, size: str, scheme: str) -> None:
        width, height = SIZES[size]
        tab.set_viewport_size({"width": width, "height": height})
        tab.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
        tab.evaluate(DRAWN)
        said = f"{tab.url}, {size}, {scheme}"
        assert tab.evaluate("document.documentElement.scrollWidth") <= width, f"{said}: the page scrolls sideways"
        assert tab.evaluate(CUT) == [], f"{said}: a column of a table is cut"
        assert tab.evaluate(SMALL) == [], f"{said}: text of a drawing is too small to read"
        found = axe.run(tab, options=AXE)
        assert found.violations_count == 0, f"{said}: {found.generate_report()[:3000]}"

    return look
