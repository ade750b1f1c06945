"""Evidence: journal, recordings, the sealed package and its verification."""
