"""A run again: replayed, gone on with, or entered once more."""
