"""A run in progress, from its own files: how far it is, how long it will take, and its latest readings."""
