"""A run that goes on, told from its own files: how far it is, how long it will take, and what it reads now."""
