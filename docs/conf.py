"""How Sphinx makes the site: `make docs` writes it to out/docs, to be read from disk, without a network."""

import re
from pathlib import Path

README = Path(__file__).parents[1] / "README.md"

project = "Parcours"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click"]
html_theme = "furo"
html_static_path = ["site.css", "site.js"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_title = "Parcours"
html_copy_source = False
html_show_search_summary = False  # it would fetch pages, which a browser refuses from disk
html_show_sphinx = False
html_show_copyright = False
myst_heading_anchors = 4  # links to headings, as on a Git server
autodoc_member_order = "groupwise"
autodoc_typehints = "signature"
maximum_signature_line_length = 100
default_role = "code"
smartquotes = False  # of --out it would make –out

# What a screen reader misses in the pages of Sphinx and furo. What was repaired is not matched again.
ACCESSIBLE = {
    '<aside class="sidebar-drawer">': '<aside class="sidebar-drawer" aria-label="All pages">',
    '<aside class="toc-drawer': '<aside aria-label="On this page" class="toc-drawer',
    '<p class="caption" role="heading">': '<p class="caption" role="heading" aria-level="2">',
    '<th class="head"><p></p></th>': '<td class="head"></td>',
    "<dl>\n<dd>": '<dl role="presentation">\n<dd>',  # the parameters of a long signature
    '</noscript>\n\n<div id="search-results">': '</noscript>\n<h1>Search</h1>\n<div id="search-results">',
}


def _home(app, docname, source):
    """Put the README in front of the home page, with links as seen from docs/; make the contents of its lists."""
    source[0] = source[0].replace("](../README.md", "](index.md")
    if docname == "index":
        for section in re.split(r"^### ", source[0], flags=re.MULTILINE)[1:]:
            pages = "\n".join(re.findall(r"\]\(([\w-]+)\.md\)", section))
            source[0] += f"\n```{{toctree}}\n:hidden:\n:caption: {section.splitlines()[0]}\n{pages}\n```\n"
        readme = README.read_text(encoding="utf-8").replace("](docs/", "](")
        no_page = r"\[([^]]*)\]\((?:[A-Z]\w+\.md|bench/[^)]*)\)"
        source[0] = re.sub(no_page, r"\1", readme) + "\n" + source[0]
        app.env.note_dependency(README)


def _as_myst(app, docname, source):
    """Turn an `<a id>` above a paragraph into a target that the build knows, so that links to it are checked."""
    source[0] = re.sub(r'^<a id="([\w-]+)"></a>$', r"(\1)=", source[0], flags=re.MULTILINE)


def _in_words(app, what, name, obj, options, lines):
    """Keep napoleon from reading the text before a colon in the first line as the type of an attribute."""
    if what in ("attribute", "data", "property"):
        lines[:0] = ["..", ""]  # an empty comment


def _as_rst(app, ctx, lines):
    """Escape asterisks in a command's help, which is plain text; spell a path as a user does."""
    lines[:] = [re.sub(r"(?<![\w`])\*", r"\\*", line) for line in lines]
    lines[:] = [re.sub(r"PosixPath\('([^']*)'\)", r"\1", line) for line in lines]


def _accessible(app, error):
    """Repair the pages that were written."""
    for page in Path(app.outdir).glob("*.html"):
        written = page.read_text(encoding="utf-8")
        repaired = written
        for wrong, right in ACCESSIBLE.items():
            repaired = repaired.replace(wrong, right)
        if repaired != written:
            page.write_text(repaired, encoding="utf-8")


def setup(app):
    """Connect the changes of text."""
    app.connect("source-read", _home)
    app.connect("source-read", _as_myst)
    app.connect("autodoc-process-docstring", _in_words, priority=400)
    app.connect("sphinx-click-process-description", _as_rst)
    app.connect("sphinx-click-process-options", _as_rst)
    app.connect("build-finished", _accessible)
