"""The audit: the status of every requirement over all packages, computed, never entered by hand."""
