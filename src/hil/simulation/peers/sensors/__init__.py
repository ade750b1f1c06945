"""What simulated sensors on an I2C bus share: registers, power, samples, FIFO, interrupt; a chip adds its own."""
