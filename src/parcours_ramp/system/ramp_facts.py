"""What one run of a system case leaves behind: plain facts, on which the verdicts are rules."""

from __future__ import annotations

import numpy as np

from parcours_navigation.facts import FACTS as BASE
from parcours_navigation.measures.table import MEASURES

TRANSITIONS = (
    *(f"p1{k}" for k in range(1, 10)),
    *(f"p2{k}" for k in range(1, 6)),
    *(f"p3{k}" for k in range(1, 6)),
    *(f"p4{k}" for k in range(1, 10)),
    *(f"p5{k}" for k in range(1, 6)),
    *(f"p6{k}" for k in range(1, 5)),
)  # The transitions of the component model (Table II), in the order of FACTS.transitions

FACTS = np.dtype([*BASE.descr, ("n_track", "i8"), ("transitions", "i8", (len(TRANSITIONS),)), ("measures", MEASURES)])
"""Facts of one case: the judge's, the entries of its track, how often each transition of the model was taken, and the
measures of its way up to the end."""
