"""What a case says, as every file can hold and every terminal can show it."""

from __future__ import annotations

import unicodedata

__all__ = ["one_line", "writable"]

_CONTROLS = frozenset({"Cc", "Cs"})
"""Unicode's categories of control characters, and of Python's stand-ins for bytes that are no UTF-8."""


def writable(text: str) -> str:
    """Return a text in which whatever would move a cursor, clear a screen or fail to be written is written out.

    The ends of its lines stay.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(each if each == "\n" or unicodedata.category(each) not in _CONTROLS else _out(each) for each in text)


def one_line(text: str) -> str:
    """Return the same with the ends of its lines written out, too: for what stands in a line of its own."""
    return writable(text).replace("\n", "\\n")


def _out(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")
