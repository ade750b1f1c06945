"""Physics behind the peers: stepped on an absolute grid, whoever looks."""
