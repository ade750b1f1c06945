"""An IIM-42652 gyroscope and accelerometer at register level."""
