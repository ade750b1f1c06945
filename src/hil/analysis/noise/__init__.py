"""Noise of sensors at exact levels: generated in blocks by index of the sample, or as a whole record."""
