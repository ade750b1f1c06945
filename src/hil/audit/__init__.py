"""The audit: the status of every requirement over all packages, computed and never typed in."""
