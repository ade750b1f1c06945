"""Cycling of rechargeable cells: steps, capacity and energy, incremental capacity, fade, and plausibility gates."""
