"""How many examples properties are tried with: some, the same each time; in a soak many, and others each time."""

from __future__ import annotations

import sweeps
from hypothesis import settings
from hypothesis.internal.conjecture import providers
from quick_disk import nothing_waits_for_the_disk  # noqa: F401 - a fixture

settings.register_profile("sample", max_examples=sweeps.examples(100), derandomize=True, deadline=None)
settings.register_profile("soak", max_examples=sweeps.examples(100), deadline=None)
settings.load_profile(sweeps.chosen("sample", "soak"))

if not sweeps.chosen(few=False, whole=True) and hasattr(providers, "_get_local_constants"):
    # It reads every module that happens to be loaded, for seconds, to try its constants: then no two runs are the same.
    providers._get_local_constants = providers.Constants
