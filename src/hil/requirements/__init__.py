"""What must be verified: catalogue, lock, units, parameters and the decision rule."""
