"""The page: one file, nothing loaded, nothing let through, the same bytes every time."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.report.page import to_html
from parcours.report.pieces import (
    Page,
    Section,
)
from parcours.report.writing import write_text
from whole_page import HOSTILE, recording, whole_page

VOID = {"meta", "link", "input", "br", "img", "hr"}


class Elements(HTMLParser):
    """Collects the elements of a document, with attributes, the text within and the path to each."""

    def __init__(self, document: str) -> None:
        super().__init__(convert_charrefs=True)
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, list[str]] = {}
        self.open: list[str] = []
        self.feed(document)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)
            self.texts.setdefault(tag, []).append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open and self.open[-1] == tag, f"</{tag}> closes {self.open[-3:]}"
        self.open.pop()

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts[self.open[-1]][-1] += data

    def named(self, tag: str) -> list[dict[str, str | None]]:
        return [attributes for name, attributes in self.found if name == tag]


def test_the_same_page_gives_the_same_bytes() -> None:
    assert to_html(whole_page()) == to_html(whole_page())


def test_the_page_is_well_formed_and_no_id_stands_twice() -> None:
    elements = Elements(to_html(whole_page()))
    assert elements.open == []
    ids = [attributes["id"] for _, attributes in elements.found if "id" in attributes]
    assert len(ids) == len(set(ids))


def test_every_reference_inside_the_page_has_its_target() -> None:
    document = to_html(whole_page())
    elements = Elements(document)
    ids = {attributes.get("id") for _, attributes in elements.found}
    targets = {
        value[1:] for _, a in elements.found for k, value in a.items() if "href" in k and value and value[0] == "#"
    }
    targets |= set(re.findall(r"url\(#([^)]+)\)", document))
    assert targets and targets <= ids


def test_nothing_is_loaded_from_anywhere() -> None:
    document = to_html(whole_page())
    loading = ("src", "href", "xlink:href", "srcset", "data", "poster", "action", "background")
    for tag, attributes in Elements(document).found:
        for name in loading:
            value = attributes.get(name)
            assert value is None or value.startswith(("#", "data:")), f"<{tag} {name}={value}>"
    assert not re.search(r"https?:|@import|url\((?!#)|\bfetch\(|XMLHttpRequest|\bimport\(", document)


def test_the_policy_admits_our_script_and_no_other() -> None:
    elements = Elements(to_html(whole_page()))
    (policy,) = (a["content"] for a in elements.named("meta") if a.get("http-equiv") == "Content-Security-Policy")
    scripts = [text for text in elements.texts["script"] if not text.lstrip().startswith('{"t"')]
    digests = [base64.b64encode(hashlib.sha256(text.encode()).digest()).decode() for text in scripts]
    assert len(digests) == 1
    assert policy is not None
    assert policy.startswith("default-src 'none'")
    assert re.findall(r"script-src ([^;]*)", policy) == [f"'sha256-{digests[0]}'"]


def test_the_script_of_animations_stands_once_and_only_where_one_is_played() -> None:
    two = Section("a", "", (recording(), recording(), recording(script="other();")))
    document = to_html(Page("p", "", (), (two,)))
    assert (document.count("(() => {})();"), document.count("other();")) == (1, 1)
    assert "other" not in to_html(Page("p", "", (), (Section("a", "", (recording(),)),)))


def test_a_hostile_word_adds_no_element_wherever_it_stands() -> None:
    tame, hostile = Elements(to_html(whole_page())), Elements(to_html(whole_page(HOSTILE)))
    assert [tag for tag, _ in hostile.found] == [tag for tag, _ in tame.found]
    assert all(not name.startswith("on") for _, attributes in hostile.found for name in attributes)
    assert HOSTILE in hostile.texts["h1"][0]


@given(st.text(st.characters(exclude_categories=["Cs"]), max_size=30))
def test_any_title_comes_out_as_it_went_in(title: str) -> None:
    elements = Elements(to_html(Page(title, "", (), ())))
    # HTML reads any line end as one kind, and a null as a replacement character
    assert elements.texts["title"][0].replace("\r\n", "\n").replace("\r", "\n") == title.replace("\r\n", "\n").replace(
        "\r", "\n"
    )


def test_each_animation_carries_its_data_and_a_still_for_readers_without_scripts() -> None:
    elements = Elements(to_html(whole_page(HOSTILE)))
    data = [json.loads(text) for text in elements.texts["script"] if text.startswith('{"t"')]
    assert data == [{"t": HOSTILE}] * 2
    stills = [a for tag, a in elements.found if tag == "div" and a.get("class") == "still"]
    assert len(stills) == 2


def test_an_unwritable_place_is_one_clear_error_and_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("in the way")
    for path in (tmp_path / "file" / "report.html", tmp_path):
        with pytest.raises(BadRequest, match=r"must be writable.*\[folder-unwritable\]"):
            write_text(path, "text")
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_a_report_replaces_the_one_before_and_leaves_no_other_file(tmp_path: Path) -> None:
    path = tmp_path / "new" / "report.html"
    write_text(path, "first, and longer")
    write_text(path, "second \ud800")
    assert path.read_bytes() == b"second ?"
    assert [entry.name for entry in path.parent.iterdir()] == ["report.html"]
