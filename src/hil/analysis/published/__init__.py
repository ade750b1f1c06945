"""Published tables against the tables they were computed from: which cells follow, as far as rounding lets one say."""
