"""Running cases: what a case is given, what it does, and its verdict."""
