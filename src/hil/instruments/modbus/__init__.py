"""Modbus RTU for drivers: frames on a line, sessions with one unit, and exchanges as bytes alone."""
