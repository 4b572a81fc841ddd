"""Guards and actions in JavaScript or UPPAAL's C-like language to our syntax trees, or a refusal by name."""

from parcours_formats.guard_languages.foreign_texts import (
    Branch,
    actions,
    branches,
    condition,
    guard,
    performed,
    variables,
)
from parcours_formats.guard_languages.foreign_tokens import Language, Tokens
from parcours_formats.guard_languages.translation import Scope, Translation, refusal, sized

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
