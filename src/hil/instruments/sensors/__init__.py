"""What sensors on an I2C bus share: registers, samples, FIFO; a chip is a table and what is peculiar to it."""
