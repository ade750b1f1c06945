"""Texts as markup: nothing in them is obeyed, whatever a catalogue or a package holds; and the pages' own files."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from urllib.parse import quote

__all__ = ["anchor", "asset", "escaped", "link", "plain", "quoted"]

# Controls, and marks that reorder or hide text: they are shown by their number, never obeyed.
_UNSAFE = re.compile(
    "[&<>\"'\x00-\x08\x0b-\x1f\x7f-\x9f\xad\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff]"
)
_ESCAPED = {"&": "&amp;", "<": "&lt;", ">": "&gt;", '"': "&quot;", "'": "&#39;"}


def escaped(text: str) -> str:
    """Return a text that is no markup; a mark that hides or reorders text is shown by its number."""
    return _UNSAFE.sub(_number_of, text)


def _number_of(match: re.Match[str]) -> str:
    mark = match[0]
    return _ESCAPED.get(mark) or f'<span class="unseen">U+{ord(mark):04X}</span>'


def plain(text: str) -> str:
    """Return a text for an attribute or a title, in which no element may stand."""
    return _UNSAFE.sub(lambda match: _ESCAPED.get(match[0]) or f"U+{ord(match[0]):04X}", text)


def quoted(text: str) -> str:
    """Return a text for a link."""
    return quote(text, errors="surrogatepass")  # a folder may have any bytes for a name


def anchor(name: str) -> str:
    """Return the id of a requirement's row."""
    return f"r-{quoted(name)}"


def link(name: str) -> str:
    """Return the link to a requirement's row."""
    return f'<a href="#{quoted(anchor(name))}">{escaped(name)}</a>'


@cache
def asset(name: str) -> str:
    """Return what a file beside this one holds: `page.css`, which every page has, or `page.js`."""
    return (Path(__file__).parent / name).read_text(encoding="utf-8").strip()
