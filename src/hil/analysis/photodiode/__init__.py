"""Calibration over temperature of photodiodes read as the voltage across a load resistor."""
