"""All errors in a set of files, gathered before any is reported."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TypeVar

from hil.documents.node import Place
from hil.model.errors import ConfigurationError, Finding

__all__ = ["Findings", "shown"]

_Read = TypeVar("_Read")

_LONGEST = 500
"""The maximum length of a message, which may quote megabytes of a file."""


class Findings:
    """Findings in the order in which they were made; each is kept once."""

    def __init__(self) -> None:
        self._findings: dict[Finding, None] = {}

    def add(self, place: Place, message: str) -> None:
        """Note an error at a node or place; an endless message is truncated."""
        if len(message) > _LONGEST:
            message = f"{message[:_LONGEST]}..."
        self.repeat(Finding(path=place.path, line=place.line, column=place.column, message=message))

    def repeat(self, finding: Finding) -> None:
        """Add a finding that was made elsewhere."""
        self._findings[finding] = None

    def has(self, place: Place) -> bool:
        """Return whether there is an error at exactly this place; its consequences would be reported twice."""
        return any((each.path, each.line, each.column) == (place.path, place.line, place.column) for each in self)

    def raise_if_any(self) -> None:
        """Raise ConfigurationError with every finding, if there is one."""
        if self._findings:
            raise ConfigurationError(tuple(self._findings))

    def require(self, read: _Read | None) -> _Read:
        """Return what was read.

        Raises:
            ConfigurationError: with every finding, if there is one, or if nothing was read.
        """
        if self._findings or read is None:
            raise ConfigurationError(tuple(self._findings))
        return read

    def __iter__(self) -> Iterator[Finding]:
        return iter(self._findings)

    def __len__(self) -> int:
        return len(self._findings)


def shown(file: Path, root: Path) -> str:
    """Return a path as shown to a person: relative to the workspace where it is inside."""
    return file.relative_to(root).as_posix() if file.is_relative_to(root) else str(file)
