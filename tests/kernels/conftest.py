"""Properties are tried on the same examples in every run, and may take long where a kernel is compiled first."""

from __future__ import annotations

from hypothesis import settings

settings.register_profile("compiled", deadline=None, derandomize=True)
settings.load_profile("compiled")
