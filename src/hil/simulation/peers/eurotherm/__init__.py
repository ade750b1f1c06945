"""A Eurotherm 3216 temperature controller as its Modbus line sees it."""
