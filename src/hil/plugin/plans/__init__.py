"""The content of a plan's files: cases, their fixtures and names, and what is wrong with them."""
