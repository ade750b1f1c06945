"""Running cases: what a case is given, what it does, and what comes of it."""
