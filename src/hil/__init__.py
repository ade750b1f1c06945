"""Hardware-in-the-loop test executive for CubeSat sensors and power parts."""
