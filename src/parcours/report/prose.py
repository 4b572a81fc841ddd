"""Paragraphs with a few marks of emphasis, as HTML in which everything else is escaped, or as plain text.

The marks are a part of Markdown: **strong**, *stressed*, `code`, [words](#anchor), lists of lines "- item".
"""

from __future__ import annotations

import re

from markupsafe import Markup, escape

_MARK = re.compile(
    r"`(?P<code>[^`\n]+)`"
    r"|\*\*(?P<strong>[^*\n]+)\*\*"
    r"|\*(?P<em>[^\s*][^*\n]*)\*"
    r"|\[(?P<words>[^\]\n]+)\]\(#(?P<anchor>[A-Za-z0-9_-]+)\)"
)


def inline_html(text: str) -> Markup:
    """Return one run of text as HTML.

    >>> print(inline_html("**3** of `a<b`, *as* [below](#why); 2 * 3 * 4 <script>"))
    <strong>3</strong> of <code>a&lt;b</code>, <em>as</em> <a href="#why">below</a>; 2 * 3 * 4 &lt;script&gt;
    """
    html, end = Markup(), 0
    for mark in _MARK.finditer(text):
        html += escape(text[end : mark.start()]) + _marked(mark)
        end = mark.end()
    return html + escape(text[end:])


def _marked(mark: re.Match[str]) -> Markup:
    if mark["anchor"]:
        return Markup('<a href="#{}">{}</a>').format(mark["anchor"], mark["words"])
    kind = mark.lastgroup or "em"
    return Markup("<{0}>{1}</{0}>").format(Markup(kind), mark[kind])


def html(text: str) -> Markup:
    """Return paragraphs and lists as HTML.

    >>> print(html("Two ways:" + chr(10) * 2 + "- keep" + chr(10) + "- drop"))
    <p>Two ways:</p><ul><li>keep</li><li>drop</li></ul>
    """
    blocks = []
    for block in re.split(r"\n\s*\n", text.strip()):
        lines = [line.strip() for line in block.splitlines() if line.strip()]
        if lines and all(line.startswith("- ") for line in lines):
            items = Markup().join(Markup("<li>{}</li>").format(inline_html(line[2:])) for line in lines)
            blocks.append(Markup("<ul>{}</ul>").format(items))
        elif lines:
            blocks.append(Markup("<p>{}</p>").format(inline_html(" ".join(lines))))
    return Markup().join(blocks)


def plain(text: str) -> str:
    """Return the text without its marks.

    >>> plain("**3** of `n`, see [below](#why)")
    '3 of n, see below'
    """
    return _MARK.sub(lambda mark: next(mark[name] for name in _SHOWN if mark[name]), text)


_SHOWN = ("code", "strong", "em", "words")
