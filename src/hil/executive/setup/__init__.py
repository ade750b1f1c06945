"""Setup of a run: workspace, configuration, software, and what is frozen of them."""
