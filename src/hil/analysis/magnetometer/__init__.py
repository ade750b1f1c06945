"""Calibration of magnetometers from readings in many attitudes that nobody needs to know."""
