"""A page with every kind of piece, and one word of choice wherever a study may set a text."""

from __future__ import annotations

import json

from parcours.report.pieces import (
    Animation,
    Cause,
    Code,
    Column,
    Failing,
    Failures,
    Findings,
    KeyFigure,
    Marked,
    Page,
    Piece,
    Section,
    Summary,
    Table,
    Text,
)
from parcours.report.rates import shares
from parcours.report.timings import TimingCase, timing_figure
from parcours.verdict.judgement import Judgement, Verdict
from parcours.verdict.timing import Bound

HOSTILE = '</script><script>alert("1")</script><img src=x onerror=alert(2)>\'"&'


def recording(word: str = "word", script: str = "(() => {})();\n") -> Animation:
    """An animation whose picture is plain and whose data is `word`."""
    return Animation(word, word, "<svg><circle r='1'/></svg>", json.dumps({"t": word}), script, word)


def whole_page(word: str = "word") -> Page:
    """A page with every kind of piece, and `word` in every text that a study may set."""
    table = Table(
        word, (Column(word, code=True), Column("n", ".1%", group=word, unit=word)),
        ((word, 0.25), (Marked(word, "bad", why=word), None)), note=word,
    )  # fmt: skip
    failing = tuple(
        Failing(f"{word}/{k}", Marked("error" if k % 2 else "fail", "bad", word), f"{word} {k}", (value,), (word,))
        for k, value in enumerate((10.0, -2.5, None, 9.0, -10.0))
    )
    causes = Cause(word, 5, failing), Cause("other", 9, failing[:1])
    pieces: tuple[Piece, ...] = (
        Text(word),
        Failures(word, causes, (Column("figure", ".1f", unit="m"),), note=word),
        Findings((KeyFigure(word, word, word, "good"),)),
        table,
        Table(word, (Column(word),), ((word,),), folded=True),
        Code(word, word),
        Code(word, word, folded=True),
        shares(word, [word, "rest"], {word: [3, 1]}, ["good", "bad"], note=word),
        timing_figure(
            word, [TimingCase(word, (1_000_000, 2_000_000), Bound(5_000_000), Judgement(Verdict.PASS, word))]
        ),
        recording(word),
        recording(word),
    )
    summary = Summary(word, word, "bad", (word,), word)
    return Page(word, word, ((word, word),), (Section(word, word, pieces), Section("last", "", ())), summary)
