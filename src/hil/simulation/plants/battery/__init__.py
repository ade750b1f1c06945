"""A lithium cell on its tester: chemistry, wires, heat and age."""
