"""Guards and actions in JavaScript or UPPAAL's C-like language to our syntax trees, or a refusal by name."""

from parcours_formats.foreign.refusing import refusal, sized
from parcours_formats.foreign.texts import Branch, actions, branches, condition, guard, performed, variables
from parcours_formats.foreign.tokens import Language, Tokens
from parcours_formats.foreign.translation import Scope, Translation

__all__ = [
    "Branch",
    "Language",
    "Scope",
    "Tokens",
    "Translation",
    "actions",
    "branches",
    "condition",
    "guard",
    "performed",
    "refusal",
    "sized",
    "variables",
]
