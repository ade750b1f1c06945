"""Simulated instruments: bytes in, bytes out, each written from its protocol description."""
