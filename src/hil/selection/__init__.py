"""Selection: which of several sensors is the best in what, computed from sealed packages."""
