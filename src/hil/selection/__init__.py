"""Selection: which of several sensors is best by which criterion, computed from sealed packages."""
