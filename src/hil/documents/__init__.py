"""Strict YAML with places, canonical JSON, and nearest-name suggestions."""
