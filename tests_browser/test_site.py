"""The documentation as `make docs` wrote it: axe on a page of each kind, its usual finds on all pages."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

SITE = Path(__file__).parents[1] / "out/docs"
KINDS = ("index", "search", "concept-models", "tutorial-failure", "cluster", "evidence", "repair")
WRONG = """[
    ...document.querySelectorAll('[role=heading]:not([aria-level]), th:empty, dl:not([role]) > dd:first-child'),
    ...document.querySelectorAll('aside:not([aria-label]), img:not([alt])'),
    ...[...document.querySelectorAll('pre, .table-wrapper')]
        .filter((region) => region.scrollWidth > region.clientWidth && region.tabIndex < 0),
].map((wrong) => wrong.outerHTML.slice(0, 80))"""


@pytest.mark.parametrize("page", KINDS)
def test_a_page_of_the_site_is_quiet_fits_its_screen_and_has_no_violation_of_axe(
    page: str, visit: Callable[..., Any], look_over: Callable[..., None]
) -> None:
    with visit((SITE / f"{page}.html").as_uri()) as tab:
        look_over(tab, "1280", "light")
        look_over(tab, "phone", "dark")


def test_all_pages_of_the_site_are_quiet_and_fit_a_phone(visit: Callable[..., Any]) -> None:
    pages = sorted(SITE.glob("*.html"))
    assert len(pages) > 50
    with visit(pages[0].as_uri(), "phone") as tab:
        for page in pages:
            tab.goto(page.as_uri())
            assert tab.evaluate("document.documentElement.scrollWidth") <= 390, page.name
            assert tab.locator("h1").count() == 1, page.name
            assert tab.evaluate(WRONG) == [], page.name


def test_the_site_is_searched_without_a_server(visit: Callable[..., Any]) -> None:
    with visit((SITE / "search.html").as_uri() + "?q=rendezvous") as tab:
        tab.locator("#search-results li a").first.wait_for()
