"""Calibration of photodiodes that are read as the voltage at a load, over temperature."""
