"""Calibration of gyroscopes over temperature, and averaging of their readings."""
