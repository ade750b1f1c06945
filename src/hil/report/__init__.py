"""Pages derived from a package alone: HTML report, JUnit, procedure."""
