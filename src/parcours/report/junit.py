"""Writes judged cases as JUnit XML, the form in which build servers read test results.

There is no one schema; this keeps to what Jenkins (junit-10.xsd), GitLab and Maven Surefire all read.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from parcours.errors import BadRequest
from parcours.verdict.judgement import Verdict

# All but the characters of XML 1.0, section 2.2: nothing can stand for these in XML, not even a reference. A pattern
# that takes longer to compile than the rest of this module: compiled when a result is written.
_FORBIDDEN = "[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]"

_ELEMENT = {Verdict.FAIL: "failure", Verdict.ERROR: "error", Verdict.INCONCLUSIVE: "skipped"}


@dataclass(frozen=True, slots=True)
class CaseResult:
    """What became of one case.

    Attributes:
        id: the case's stable id, study/abstract case/row: its last two parts are its name, what stands before them is
            the class it is listed under.
        verdict: what the judge says; inconclusive cases are listed as skipped.
        seconds: how long it took [s].
        why: the judge's reason, in words.
    """

    id: str
    verdict: Verdict
    seconds: float
    why: str = ""


def to_junit(suite: str, results: Iterable[CaseResult]) -> str:
    """Return the results as a JUnit XML document.

    Args:
        suite: what was run.
        results: one per case, in the order to list them.

    Raises:
        BadRequest: a duration is negative or not finite.
    """
    listed = list(results)
    for result in listed:
        if not (math.isfinite(result.seconds) and result.seconds >= 0.0):
            rule = f"its duration must be finite and not negative, but is {result.seconds} s"
            raise BadRequest(f"case {result.id!r}", rule, slug="junit-seconds")
    count = {verdict: sum(result.verdict is verdict for result in listed) for verdict in Verdict}
    total = sum(result.seconds for result in listed)
    counts = f'tests="{len(listed)}" failures="{count[Verdict.FAIL]}" errors="{count[Verdict.ERROR]}"'
    name, time = _attribute(suite), f'time="{total:.3f}"'
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f"<testsuites name={name} {counts} {time}>",
        f'  <testsuite name={name} {counts} skipped="{count[Verdict.INCONCLUSIVE]}" {time}>',
        *(_case(result, suite) for result in listed),
        "  </testsuite>",
        "</testsuites>",
    ]
    return "\n".join(lines) + "\n"


def _case(result: CaseResult, suite: str) -> str:
    """Return the testcase element of one result."""
    parts = result.id.split("/")
    name, dotted = "/".join(parts[-2:]), ".".join(parts[:-2]) or suite
    head = f'    <testcase classname={_attribute(dotted)} name={_attribute(name)} time="{result.seconds:.3f}"'
    element = _ELEMENT.get(result.verdict)
    if element is None:
        return f"{head}/>"
    first = result.why.strip().partition("\n")[0] or str(result.verdict)
    # a skipped element has a message only: the schemas give it neither type nor content
    if element == "skipped":
        body = f"<skipped message={_attribute(first)}/>"
    else:
        kind = f'type="{result.verdict}"'
        body = f"<{element} message={_attribute(first)} {kind}>{_escaped(_legal(result.why))}</{element}>"
    return f"{head}>\n      {body}\n    </testcase>"


def _legal(text: str) -> str:
    r"""Return the text with what XML cannot hold spelled out.

    >>> print(_legal("a\x1b[31mb"))
    a\x1b[31mb
    """
    return re.sub(_FORBIDDEN, lambda match: match[0].encode("unicode_escape").decode("ascii"), text)


def _escaped(text: str) -> str:
    # As xml.sax.saxutils does, which would load all of HTTP, for a parser.
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _attribute(text: str) -> str:
    quoted = _escaped(_legal(text)).replace("\n", "&#10;").replace("\r", "&#13;").replace("\t", "&#9;")
    if '"' in quoted and "'" not in quoted:
        return f"'{quoted}'"
    return f'"{quoted.replace(chr(34), "&quot;")}"'
