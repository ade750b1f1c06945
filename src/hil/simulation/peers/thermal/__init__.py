"""What simulated temperature controllers have in common, whatever their registers."""
