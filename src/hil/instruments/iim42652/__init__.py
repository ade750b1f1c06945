"""TDK InvenSense IIM-42652 gyroscope on an I2C bus, of the host or behind an OBC."""
