"""The pytest side: options, markers, fixtures, outcomes."""
