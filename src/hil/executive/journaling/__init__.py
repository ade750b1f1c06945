"""What a run writes down while it runs: events, rows and the upkeep of both."""
