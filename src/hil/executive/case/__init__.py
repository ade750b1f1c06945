"""One case while it runs: effects, steps, recordings, checks, and the operator."""
