"""Gates that a recording must pass before anything is concluded from it."""
