"""What a person sees of a run, and how questions are answered."""
