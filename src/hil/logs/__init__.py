"""Readers of logs that other tools wrote."""
