"""Re-execution: resuming an interrupted run, and replaying a package."""
