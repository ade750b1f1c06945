"""Watching the bench: scheduling points, monitors, holds, the outputs, and the host machine."""
