"""What a live bench asks for: a machine that stays awake, latches that somebody clears, and people within reach."""
