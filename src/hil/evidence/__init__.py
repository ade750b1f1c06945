"""Write down and verify: journal, recordings, the sealed package."""
