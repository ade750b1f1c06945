"""Base of simulated temperature controllers, whatever their registers."""
