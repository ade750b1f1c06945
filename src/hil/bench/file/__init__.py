"""The bench file and the register of devices under test: read, checked, every finding at once."""
