"""The journal: written event by event, read line by line."""
