"""Verification of published tables: which cells follow from their source tables, within rounding."""
