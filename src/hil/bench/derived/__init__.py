"""Derived quantities of the envelope: computed row by row from the readings."""
