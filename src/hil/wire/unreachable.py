"""The far end of a byte stream or a bus that could not be opened: whoever asks it anything is told why."""

from __future__ import annotations

from typing import NoReturn

from hil.model.errors import HilError

__all__ = ["Unreachable"]


class Unreachable:
    """Stands in for an end, so that what is behind the other ends can be reached; it has the interface of all of them.

    Args:
        error: why it could not be opened; everything but opening and closing raises it.
    """

    def __init__(self, error: HilError) -> None:
        self._error = error

    def opened(self) -> None:
        """Do nothing."""

    def closed(self) -> None:
        """Do nothing."""

    def __getattr__(self, name: str) -> NoReturn:
        raise self._error
