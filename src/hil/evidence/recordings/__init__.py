"""Recordings: rows while they grow, HDF5 for good."""
