"""The OBC link: the board that plays the on-board computer, and its bus."""
