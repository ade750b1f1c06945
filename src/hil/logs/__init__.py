"""Readers of logs written by other tools."""
