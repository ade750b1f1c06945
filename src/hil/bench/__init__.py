"""The bench file, and everything that follows from it: binding, clamps, envelope, safe-off, lease."""
