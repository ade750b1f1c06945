"""The terminal: a run's progress, and the answers to its questions."""
