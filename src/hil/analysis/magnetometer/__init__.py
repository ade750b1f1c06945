"""Calibration of magnetometers from readings in many unknown attitudes."""
