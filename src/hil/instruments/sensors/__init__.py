"""Kit for sensors on an I2C bus: registers, samples, FIFO; a chip adds only its tables and its peculiarities."""
