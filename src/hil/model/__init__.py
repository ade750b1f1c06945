"""Frozen data and errors that every room speaks of: figures, verdicts, faults."""
