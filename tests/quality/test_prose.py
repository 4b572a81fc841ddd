"""English that reads translated is found in the README, the pages, docstrings, comments, help texts and messages."""

from __future__ import annotations

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]

BETTER = {
    "foreign nodes, third-party code": "nodes of others/code of others/planners of others/packages of others",
    "observed": "watched on",
    "the goal was not reached": "never arrived",
    "discarded, dropped, omitted": "is forgotten/are forgotten/was forgotten",
    "caused a collision": "closed the gap/contact closed/robot closed/obstacle closed",
    "start": "at its begin/at the begin/from the begin/at begin/its begin/their begin",
    "again": "anew",
    "for good, without end": "for ever",
    "is not one": "is none/are none",
    "this many": "so many",
    "no matter who, the one who": "whoever",
    "happen to": "befall/befalls",
    "reported, known": "is told of/are told of/told by its",
    "corrupted": "spoilt",
    "impossible": "nobody could",
    "wrong usage": "question was wrong",
    "failed before": "once hurt",
    "must, will": "shall",
    "bit for bit": "to the bit/to the last bit",
    "significantly": "beyond chance",
    "separated by": "parted by",
    "by default": "if nothing is said",
    "reported, given, described": "is said/are said",
    "its content": "what is there",
    "one per run": "a line a run/line a case/row a case",
    "one per line": "one a line/id a line/object a line/step a line/visit a line/entry a line",
    "one per case": "one a case/value a case/test a case/item a case/instance a case/outcome a case",
    "one per file": "subcommand a file/graph a file/kernel a file",
    "as usual": "as ever",
    "duplicated": "lost or doubled/lost, doubled/doubled messages/doubled keys",
    "recently": "second of late",
    "at random": "weights by chance/turns away by chance",
    "generated, worded, written": "makes up/made up/making up",
    "very many": "results are many/cases are many",
    "serves, hands out, yields": "gives out/given out",
    "without success": "in vain",
    "headings": "heads are repeated/its heads sort",
    "words of this century": "thrice/thereof/hitherto/henceforth/wherefore/whence",
}
GAP = re.compile(r"""(?:[\s"'#>*|]|\bf["'])+""")  # between words of a phrase, also at the end of a line


def complaints(text: str) -> list[str]:
    """Return `line: phrase -> better words` for each phrase that reads translated."""
    plain = GAP.sub(" ", text).lower()
    found = []
    for better, phrases in BETTER.items():
        for phrase in phrases.split("/"):
            if phrase in plain:  # quick, and rarely true
                words = (
                    rf"(?<!there\s)\b[{phrase[0]}{phrase[0].upper()}]" + phrase[1:].replace(" ", GAP.pattern) + r"\b"
                )
                found += [
                    f"{text.count(chr(10), 0, hit.start()) + 1}: {phrase} -> {better}"
                    for hit in re.finditer(words, text)
                ]
    return found


def test_the_english_is_idiomatic() -> None:
    files = [*ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("bench/*.*"), *ROOT.glob("src/**/*.py")]
    files += [*ROOT.glob("src/**/*.js"), *ROOT.glob("src/**/*.html")]
    found = [
        f"{file.relative_to(ROOT)}:{complaint}"
        for file in sorted(files)
        if file.name != "CHANGELOG.md"  # a record of what was written then
        for complaint in complaints(file.read_text(encoding="utf-8"))
    ]
    assert len(files) > 300 and not found, "\n".join(found)


def test_a_phrase_is_found_across_lines_and_quotes() -> None:
    text = 'f(\n    "nodes of "\n    f"others"\n)\n# a plan that is watched\n# on, for every case'
    assert [complaint.partition(":")[0] for complaint in complaints(text)] == ["2", "5"]
    assert complaints("for every case there is none; 3 are left for everyone") == []
