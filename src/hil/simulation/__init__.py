"""Simulated benches: plants with their truth, and peers that speak the real protocols."""
