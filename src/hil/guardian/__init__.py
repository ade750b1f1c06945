"""The guardian: a small process that leaves the bench safe when the executive cannot."""
