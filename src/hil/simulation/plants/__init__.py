"""Physics that the peers measure: stepped on an absolute grid, independent of observers."""
