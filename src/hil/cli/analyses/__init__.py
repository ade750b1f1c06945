"""The analyses of `hil analyse`, one command each."""
