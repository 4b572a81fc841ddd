"""How Sphinx makes the site: `make docs` writes it to out/docs, to be read from disk, without a network."""

import re

project = "Parcours"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click"]
html_theme = "furo"
html_title = "Parcours"
html_copy_source = False
html_show_sphinx = False
myst_heading_anchors = 4  # links to headings, as on a Git server
autodoc_member_order = "groupwise"
autodoc_typehints = "description"


def _as_myst(app, docname, source):
    """Turn an `<a id>` above a paragraph into a target that the build knows, so that links to it are checked."""
    source[0] = re.sub(r'^<a id="([\w-]+)"></a>$', r"(\1)=", source[0], flags=re.MULTILINE)


def _as_rst(app, ctx, lines):
    """Escape asterisks in a command's help, which is plain text, not reStructuredText."""
    lines[:] = [re.sub(r"(?<![\w`])\*", r"\\*", line) for line in lines]


def setup(app):
    """Connect the two changes of text."""
    app.connect("source-read", _as_myst)
    app.connect("sphinx-click-process-description", _as_rst)
    app.connect("sphinx-click-process-options", _as_rst)
