"""Noise of sensors at exact levels: generated in blocks, addressed by the index of the sample."""
