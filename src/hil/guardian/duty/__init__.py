"""What the guardian's process does: watch, act once, write down."""
