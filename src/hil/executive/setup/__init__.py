"""What a run is made of: workspace, configuration, software, and what is frozen of them."""
