"""Every message that Parcours can raise is explained in docs/messages.md."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


def test_every_slug_in_the_source_has_an_anchor_in_the_docs() -> None:
    explained = set(re.findall(r'<a id="([a-z0-9-]+)"></a>', (ROOT / "docs/messages.md").read_text(encoding="utf-8")))
    raised = set()
    for source in (ROOT / "src").rglob("*.py"):
        raised |= set(re.findall(r'slug="([a-z0-9-]+)"', source.read_text(encoding="utf-8")))
    assert len(raised) > 80
    assert raised - explained == set()


def test_no_slug_is_explained_twice() -> None:
    anchors = re.findall(r'<a id="([a-z0-9-]+)"></a>', (ROOT / "docs/messages.md").read_text(encoding="utf-8"))
    assert len(anchors) == len(set(anchors))
