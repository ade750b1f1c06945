"""`record`: from a role to rows on the disk, and what a case and its requirements make of them."""
