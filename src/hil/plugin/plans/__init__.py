"""What the files of a plan hold: cases, their fixtures and names, and what is wrong with them."""
