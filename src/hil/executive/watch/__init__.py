"""The bench while a run goes on: scheduling points, monitors, holds, and the keeper of its outputs."""
