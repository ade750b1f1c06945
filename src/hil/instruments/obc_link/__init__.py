"""The OBC link: the board that plays the on-board computer, and the bus behind it."""
