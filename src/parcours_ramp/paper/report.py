"""Results of the paper's study -> one page."""

from __future__ import annotations

from parcours import __version__
from parcours.report.pieces import Page, Section, Text
from parcours_ramp.paper.component_chapters import abstract_chapter, models_chapter, paths_chapter, results_chapter
from parcours_ramp.paper.delays_chapter import delays_chapter
from parcours_ramp.paper.outcomes_chapter import outcomes_chapter, replays_chapter
from parcours_ramp.paper.results import PaperResults
from parcours_ramp.paper.system_chapters import (
    coverage_chapter,
    headline,
    inputs_chapter,
    measures_chapter,
    time_left_chapter,
    vectors_chapter,
)

_READING = """\
**Paper** means a number printed in the paper or computed from its authors' public raw results. **Reconstructed** means
that the paper names a result but not how it comes about: the serialisation algorithm behind the 67 abstract cases, the
contents of the ten message blocks, and the published planner's latencies, which are fitted to its public logs.

Known gaps of the paper are shown, not smoothed over: 67 is not 19 + 49; two messages have no receiver; the share of
robots that paused and moved again is 18 % in the text and 23.1 % in the data; the domains of v and w are open while
their blocks are closed.

By how much `original` differs from the published rates, and why we think so, stands in the outcomes chapter.
"""


def compose(results: PaperResults) -> Page:
    """Return the whole report."""
    campaign = results.system["table-vii", "original"]
    facts = (
        ("Parcours", __version__),
        ("seed", str(results.seed)),
        ("system cases", f"{len(campaign.facts)} per schedule"),
        ("component cases", f"{len(results.functional)} functional, {len(results.timing)} timing"),
    )
    sections: tuple[Section, ...] = (
        headline(results),
        replays_chapter(results),
        outcomes_chapter(results),
        vectors_chapter(results),
        time_left_chapter(results),
        measures_chapter(results),
        delays_chapter(results.delays),
        inputs_chapter(results),
        models_chapter(),
        paths_chapter(),
        abstract_chapter(),
        results_chapter(results),
        coverage_chapter(results),
        Section("How to read this report", "", (Text(_READING),), "reading"),
    )
    return Page(
        "Model-based testing of RAMP, repeated",
        "Abdelgawad, McLeod, Andrews, Xiao: *Model-based Testing of Real-time Adaptive Motion Planning*",
        facts,
        sections,
    )
