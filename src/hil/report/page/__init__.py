"""The page: from the evidence of one run to one HTML file."""
