"""How many examples properties are tried with: some, the same each time; in a soak many, and others each time."""

from __future__ import annotations

import sweeps
from hypothesis import settings

settings.register_profile("sample", max_examples=sweeps.examples(100), derandomize=True, deadline=None)
settings.register_profile("soak", max_examples=sweeps.examples(100), deadline=None)
settings.load_profile(sweeps.chosen("sample", "soak"))
