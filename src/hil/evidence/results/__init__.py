"""Results: derived from events and frozen files, with the reasons why a run cannot close a requirement."""
