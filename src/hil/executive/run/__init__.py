"""One run: workspace, session, scheduling, stopping, replay."""
