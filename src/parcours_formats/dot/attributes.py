"""The attributes by which Graphviz draws nodes and edges (graphviz.org, Attributes): they say nothing of behaviour."""

from __future__ import annotations

import re

DRAWN = frozenset(
    re.findall(
        r"\w+",
        """URL area arrowhead arrowsize arrowtail class color colorscheme comment constraint decorate dir distortion
        edgeURL edgehref edgetarget edgetooltip fillcolor fixedsize fontcolor fontname fontsize gradientangle group
        headURL head_lp headclip headhref headlabel headport headtarget headtooltip height href id image imagepos
        imagescale label labelURL labelangle labeldistance labelfloat labelfontcolor labelfontname labelfontsize
        labelhref labeljust labelloc labeltarget labeltooltip layer len lhead lp ltail margin minlen nojustify ordering
        orientation penwidth peripheries pin pos radius rects regular root samehead samepoints sametail sampoints
        shape shapefile showboxes sides skew sortv style tailURL tail_lp tailclip tailhref taillabel tailport
        tailtarget tailtooltip target tooltip vertices weight width xdotversion xlabel xlp z""",
    )
)
"""Names of attributes of nodes and edges."""
