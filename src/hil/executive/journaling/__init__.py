"""What a run writes down while it goes on: events, rows and the upkeep of both."""
