"""The workspace's registers: units under test, and instruments with their certificates."""
