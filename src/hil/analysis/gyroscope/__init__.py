"""Calibration of gyroscopes over temperature, with readings from a rotation table."""
