"""Kit for simulated sensors on an I2C bus: registers, power, samples, FIFO, interrupt; a chip adds its own."""
