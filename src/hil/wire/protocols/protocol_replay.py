"""The `replay://` scheme; pyserial finds this module by its name."""

from __future__ import annotations

from hil.wire.protocols import UrlPort

__all__ = ["Serial"]


class Serial(UrlPort):
    """A port of a recorded instrument."""

    scheme = "replay"
