"""Cycles of rechargeable cells: steps, capacity and energy, incremental capacity, fade, and gates that doubt them."""
