"""Journaling of a running run: events, rows, and their upkeep."""
