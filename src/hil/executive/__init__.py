"""Arm, run, safe, seal: the one place where acting and evidence meet."""
