"""A Newport ESP301 motion controller with a rotation stage on its first axis, as its command set describes it."""
