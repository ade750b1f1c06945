"""Recordings of a package for other programs: text tables and MATLAB files, with their facts."""
