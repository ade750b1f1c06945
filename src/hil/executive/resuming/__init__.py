"""Running again what was run before: an interrupted run that is resumed, and a package that is replayed."""
