"""The `live://` ports: a serial device or socket, with the same interface as a simulated or replayed end."""

from __future__ import annotations

from hil.wire.protocols import UrlPort

__all__ = ["Serial"]


class Serial(UrlPort):
    """A port on an instrument outside this process; pyserial finds the class by this module's name."""

    scheme = "live"
