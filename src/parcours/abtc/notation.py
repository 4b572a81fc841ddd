"""An abstract test case -> the text that the paper prints for it (Table V, ABTC1).

The paper draws the double bar above the arrow between two references: they run concurrently, in this order.
Here that arrow is `-||->`; paths that share a visit stand in braces.
"""

from __future__ import annotations

from parcours.abtc.combining import Combination
from parcours.abtc.serialising import AbstractCase
from parcours.paths.internal import InternalPath


def spelled(path: InternalPath) -> str:
    """Return a path with its states and transitions, as inside the brackets of Table V.

    >>> from parcours.model.structure import Transition
    >>> spelled(InternalPath("tp1", "Lamp", "light", (
    ...     Transition("p1", "off", "on"), Transition("p2", "on", "off"))))
    'tp1[off -p1-> on -p2-> off]'
    """
    arrows = "".join(f" -{transition.id}-> {transition.target}" for transition in path.transitions)
    return f"{path.name}[{path.states[0] if path.states else ''}{arrows}]"


def notation(of: AbstractCase | Combination, title: str = "") -> str:
    """Return a combination in the notation of Table V, one visit a line.

    Args:
        of: an abstract case, or only its combination; of a case the start vector is added where it is not
        all zero. title: what the paper calls the case, e.g. ABTC1; left out when empty.

    >>> from importlib.resources import files
    >>> from parcours.model import read_model
    >>> ramp = read_model(files("parcours_ramp") / "components" / "model.yaml")
    >>> from parcours.abtc.serialising import abstract_cases
    >>> print(notation(next(abstract_cases(ramp)), "ABTC1").splitlines()[0])
    Combination ITP1 (tp12, tp21, tp12) = ABTC1:
    """
    combination = of.combination if isinstance(of, AbstractCase) else of
    head = f"Combination {combination.interaction.name} {combination}{f' = {title}' if title else ''}:"
    between = "\n || " if not combination.meetings else "\n -||-> "
    visits = [" || ".join(spelled(path) for path in paths) for paths in combination.visits]
    grouped = [
        f"{{{text}}}" if len(paths) > 1 else text for text, paths in zip(visits, combination.visits, strict=True)
    ]
    body = f"({between.join(grouped)})"
    if isinstance(of, AbstractCase) and any(of.start_vector):
        return f"{head}\n{body}\nstarting at ({', '.join(map(str, of.start_vector))})"
    return f"{head}\n{body}"
