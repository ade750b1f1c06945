"""Drawings for the page: inline SVG, small, and the same bytes for the same numbers wherever they are made."""
