"""The page: one file, nothing loaded, nothing let through, the same bytes every time."""

from __future__ import annotations

import base64
import hashlib
import json
import re
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from parcours.errors import BadRequest
from parcours.report.page import to_html
from parcours.report.pieces import (
    Code,
    Column,
    Finding,
    Findings,
    Marked,
    Page,
    Piece,
    Replay,
    Section,
    Table,
    Text,
)
from parcours.report.rates import shares
from parcours.report.recording import embedded, steps
from parcours.report.still import moments, stays, still
from parcours.report.timings import Timed, timing_figure
from parcours.report.writing import write_text
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import Bound

HOSTILE = '</script><script>alert("1")</script><img src=x onerror=alert(2)>\'"&'
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


def run(title: str = "case", n: int = 41, halted_from: int = 20) -> Replay:
    """A robot that goes up the diagonal and halts, past an obstacle that comes down the side."""
    times = np.linspace(0.0, 2.0, n)
    x = np.minimum(times, times[halted_from])
    return Replay(
        title, title, times, x, x, np.full(n, 0.785), np.arange(n) >= halted_from,
        np.full((n, 1), 1.6), 2.0 - times[:, None], 0.125, (0.1,), (2.0, 2.0), (2.0, 2.0), 0.2,
    )  # fmt: skip


def whole_page(word: str = "word") -> Page:
    """A page with every kind of piece, and `word` in every text that a study may set."""
    table = Table(
        word, (Column(word, code=True), Column("n", ".1%", group=word, unit=word)),
        ((word, 0.25), (Marked(word, "bad", why=word), None)), note=word,
    )  # fmt: skip
    pieces: tuple[Piece, ...] = (
        Text(word),
        Findings((Finding(word, word, word, "good"),)),
        table,
        Table(word, (Column(word),), ((word,),), folded=True),
        Code(word, word),
        Code(word, word, folded=True),
        shares(word, [word, "rest"], {word: [3, 1]}, ["good", "bad"], note=word),
        timing_figure(word, [Timed(word, (1_000_000, 2_000_000), Bound(5_000_000), Judgement(Verdict.PASS, word))]),
        run(word),
        run(word, halted_from=5),
    )
    return Page(word, word, ((word, word),), (Section(word, word, pieces), Section("last", "", ())))


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


def test_each_replay_carries_its_data_and_a_still_for_readers_without_scripts() -> None:
    elements = Elements(to_html(whole_page()))
    data = [json.loads(text) for text in elements.texts["script"] if text.startswith('{"t"')]
    assert [record["halts"] for record in data] == [[20], [5]]
    stills = [a for tag, a in elements.found if tag == "div" and a.get("class") == "still"]
    assert len(stills) == 2


def test_a_replays_data_holds_no_word_of_its_author() -> None:
    assert embedded(run(HOSTILE)) == embedded(run("case"))


def test_embedded_numbers_are_the_recorded_ones_to_half_a_millimetre() -> None:
    replay = run()
    record = json.loads(embedded(replay))
    for key, values in (("x", replay.x), ("y", replay.y), ("h", replay.heading), ("t", replay.times)):
        assert np.abs(np.cumsum(record[key]) / 1000 - values).max() <= 0.5e-3 + 1e-12
    assert np.abs(np.cumsum(record["oy"][0]) / 1000 - replay.obstacle_y[:, 0]).max() <= 0.5e-3 + 1e-12


def test_the_least_clearance_is_that_of_the_run_not_of_its_rounded_copy() -> None:
    replay = run()
    at, least = json.loads(embedded(replay))["least"]
    assert least == pytest.approx(replay.clearance().min(), abs=0.5e-4)
    assert replay.clearance()[at] == replay.clearance().min()


@given(st.lists(st.floats(-50.0, 50.0), min_size=1, max_size=200))
def test_steps_do_not_add_up_rounding_errors(values: list[float]) -> None:
    array = np.array(values)
    assert np.abs(np.cumsum(steps(array, 1000)) - array * 1000).max() <= 0.5 + 1e-6


@given(st.lists(st.booleans(), min_size=2, max_size=60))
def test_halts_say_exactly_when_the_robot_was_held(held: list[bool]) -> None:
    n = len(held)
    zero, times = np.zeros(n), np.linspace(0.0, 1.0, n)
    replay = Replay(
        "t", "", times, zero, zero, zero, np.array(held), np.zeros((n, 0)), np.zeros((n, 0)),
        0.1, (), (1.0, 1.0), (1.0, 1.0), 0.1,
    )  # fmt: skip
    changes = json.loads(embedded(replay))["halts"]
    assert [sum(change <= i for change in changes) % 2 == 1 for i in range(n)] == held


def test_a_still_shows_each_second_and_the_last_sample() -> None:
    replay = run(n=41)
    assert [replay.times[i] for i in moments(replay)] == pytest.approx([0.0, 1.0, 2.0])
    assert stays(replay.x, replay.y, moments(replay)) == [(0, 0), (20, 40)]
    picture = still(replay)
    assert "1–2 s" in picture
    assert picture.count("var(--c0") > 0, "a halted robot has the colour of halts"


@pytest.mark.parametrize(
    ("field", "value", "slug"),
    [
        ("x", np.zeros(3), "replay-shape"),
        ("obstacle_x", np.zeros((41, 2)), "replay-shape"),
        ("y", np.full(41, np.nan), "replay-values"),
        ("times", np.zeros(41), "replay-values"),
        ("robot_radius", 0.0, "replay-values"),
        ("arena", (2.0, -1.0), "replay-values"),
        ("goal", (np.inf, 0.0), "replay-values"),
    ],
)
def test_a_replay_that_cannot_be_drawn_is_refused(field: str, value: object, slug: str) -> None:
    good = run()
    fields = {name: getattr(good, name) for name in Replay.__slots__}
    with pytest.raises(BadRequest, match=rf"replay 'case': .*\[{slug}\]"):
        Replay(**{**fields, field: value})


def test_clearance_is_the_gap_between_the_edges() -> None:
    replay = run()
    assert replay.clearance()[0] == pytest.approx(np.hypot(1.6, 2.0) - 0.225)


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
