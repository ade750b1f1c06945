"""The bench file and the register of devices under test: read and checked, all findings at once."""
