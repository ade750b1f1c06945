"""Recordings: row files while they grow, HDF5 once they have ended."""
