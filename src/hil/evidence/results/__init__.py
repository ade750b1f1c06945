"""Results: derived from events and what was frozen, with reasons why a run cannot close a requirement."""
