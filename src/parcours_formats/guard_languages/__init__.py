"""Translates guards and actions in JavaScript or UPPAAL's C to our language, or refuses them by name."""

from parcours_formats.guard_languages.foreign_texts import Branch, branches, condition, guard, performed, variables
from parcours_formats.guard_languages.foreign_tokens import ForeignTokens
from parcours_formats.guard_languages.translation import Scope, Translation, refusal, sized

__all__ = ["Branch", "ForeignTokens", "Scope", "Translation", "branches", "condition", "guard", "performed"]
__all__ += ["refusal", "sized", "variables"]
