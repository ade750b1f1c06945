"""The end of a run: stop requests, signals, and the acknowledgement by a named person."""
