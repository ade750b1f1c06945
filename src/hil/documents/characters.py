"""From bytes to text: encoding, line ends, and characters that would show one thing and mean another."""

from __future__ import annotations

import re

from hil.documents.findings import Findings
from hil.documents.node import Place

__all__ = ["MOST_BYTES", "decode", "forbidden_character"]

MOST_BYTES = 5_000_000
_BYTE_ORDER_MARK = "\ufeff"
_FORBIDDEN = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f"  # controls; NEL is a line end to some readers and none to others
    "\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff"  # marks that reorder or hide text, line separators
    "\ud800-\udfff]"
)


def forbidden_character(text: str) -> re.Match[str] | None:
    """Return the first control, bidirectional or invisible character of `text`, or None."""
    return _FORBIDDEN.search(text)


def decode(data: bytes, shown: str, findings: Findings) -> str | None:
    """Return the text of `data` without byte order mark and with plain line ends.

    Anything that cannot be read safely becomes a finding, and the text is None.
    """
    if len(data) > MOST_BYTES:
        findings.add(Place(path=shown), f"the file is larger than {MOST_BYTES} bytes")
        return None
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        findings.add(
            _place_of_byte(data, error.start, shown), f"not UTF-8 at byte {error.start}, save the file as UTF-8"
        )
        return None
    text = text.removeprefix(_BYTE_ORDER_MARK).replace("\r\n", "\n").replace("\r", "\n")
    before = len(findings)
    for number, line in enumerate(text.split("\n"), 1):
        match = forbidden_character(line)
        if match:
            place = Place(path=shown, line=number, column=match.start() + 1)
            findings.add(place, f"character U+{ord(match[0]):04X} is not allowed, remove it")
    return text if len(findings) == before else None


def _place_of_byte(data: bytes, offset: int, shown: str) -> Place:
    line_start = data.rfind(b"\n", 0, offset) + 1
    column = len(data[line_start:offset].decode("utf-8", errors="replace")) + 1
    return Place(path=shown, line=data.count(b"\n", 0, offset) + 1, column=column)
