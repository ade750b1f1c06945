"""Simulated benches: plants with a known truth, and peers that speak the real protocols."""
