"""What an instrument can do beyond its role: a driver's `capabilities`, which bench checks may ask for."""

from __future__ import annotations

__all__ = ["OVER_VOLTAGE_LEVEL", "offers"]

OVER_VOLTAGE_LEVEL = "over-voltage-level"
"""A supply whose over-voltage protection has a level of its own, apart from the voltage that is set."""


def offers(driver: type, capability: str) -> bool:
    """Return whether a driver says that its instrument has a capability; one that says nothing has none."""
    return capability in getattr(driver, "capabilities", frozenset())
