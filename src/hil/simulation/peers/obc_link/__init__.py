"""The simulated board that plays the on-board computer, written from the page about the OBC link."""
