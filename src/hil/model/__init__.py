"""Shared frozen data types and errors: figures, verdicts, faults."""
