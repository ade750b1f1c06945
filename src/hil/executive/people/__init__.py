"""The people of a run: those who answer, are on call, or are notified."""
