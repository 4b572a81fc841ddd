"""The pages of the documentation hang together: what `make docs` would refuse, found without building the site."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").glob("*.md"))
CODE = re.compile(r"^( *)```.*?^\1```$", re.DOTALL | re.MULTILINE)


def targets(page: Path) -> set[str]:
    """Return what a link to a page may name after its `#`: its headings as Git servers spell them, and its anchors."""
    text = CODE.sub("", page.read_text(encoding="utf-8"))
    headings = re.findall(r"^#+ (.*)$", text, re.MULTILINE)
    spelled = {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}
    return spelled | set(re.findall(r'<a id="([\w-]+)"></a>', text))


def test_every_link_leads_somewhere() -> None:
    lost = []
    for page in [*PAGES, *ROOT.glob("*.md"), ROOT / "bench/README.md"]:
        text = re.sub(r"`[^`]*`", "", CODE.sub("", page.read_text(encoding="utf-8")))
        for link in re.findall(r"\]\(([^)\s]+)\)", text):
            name, _, anchor = link.partition("#")
            target = page.parent / name if name else page
            if "://" not in link and (not target.exists() or (anchor and anchor not in targets(target))):
                lost.append(f"{page.name}: {link}")
    assert lost == []


def test_the_home_page_lists_every_page_once() -> None:
    listed = re.findall(r"\]\(([\w-]+\.md)\)", (ROOT / "docs/index.md").read_text(encoding="utf-8"))
    assert sorted(listed) == [page.name for page in PAGES if page.name != "index.md"]


def test_the_modules_of_the_api_page_exist() -> None:
    named = re.findall(r"automodule:: (\S+)", (ROOT / "docs/api.md").read_text(encoding="utf-8"))
    assert named and [name for name in named if importlib.util.find_spec(name) is None] == []


def test_the_readme_can_be_read_in_five_minutes() -> None:
    assert len((ROOT / "README.md").read_text(encoding="utf-8").splitlines()) <= 120
