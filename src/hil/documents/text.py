"""Trustworthy text: decoding files, and finding hidden characters and terminal control sequences."""

from __future__ import annotations

import re
import textwrap
import unicodedata
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from hil.documents.snapshot import current_snapshot
from hil.model.errors import Finding, Refused

if TYPE_CHECKING:  # every command prints text, but few read documents
    from hil.documents.findings import Findings

__all__ = [
    "MOST_BYTES",
    "counted",
    "decoded",
    "fitting",
    "hidden_character",
    "is_there",
    "name_problem",
    "named_wrongly",
    "one_line",
    "read_bytes",
    "require_name",
    "visible",
    "writable",
]

MOST_BYTES = 5_000_000
"""The largest file that is read."""

_LONGEST_NAME = 200
_LONGEST_PART = 100
_PLAIN = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
_DEVICE = re.compile(r"(con|prn|aux|nul|com[0-9]|lpt[0-9])(\..*)?", re.IGNORECASE)
_BYTE_ORDER_MARK = "\ufeff"
_REORDERING = "\u061c\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff"
"""Marks that reorder or hide text, and separators that only some readers take as line ends."""

_HIDDEN = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f"  # controls; NEL is a line end to some readers and none to others
    f"{_REORDERING}\ud800-\udfff]"
)
_UNSAFE = re.compile(f"[\x00-\x08\x0b-\x1f\x7f-\x9f{_REORDERING}]")
_CONTROLS = frozenset({"Cc", "Cs"})
"""Unicode categories of control characters, and of Python's surrogates for bytes that are not UTF-8."""


def hidden_character(text: str) -> re.Match[str] | None:
    """Return the first control, bidirectional or invisible character of `text`, or None."""
    return _HIDDEN.search(text)


def counted(count: int, word: str) -> str:
    """Return a number with its noun."""
    return f"{count} {word}{'' if count == 1 else 's'}"


def visible(text: str) -> str:
    r"""Return a text without effect on a terminal: what would move the cursor or reorder text becomes an escape.

    The escape of ESC is `\u001b`, which means the same inside a JSON string. Tabs and line feeds stay.
    """
    if text.isascii() and text.isprintable():
        return text
    return _UNSAFE.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def writable(text: str) -> str:
    """Return a text in which whatever would move a cursor, clear a screen or fail to be encoded is escaped.

    Line ends are kept.
    """
    if text.isascii() and text.isprintable():
        return text
    return "".join(each if each == "\n" or unicodedata.category(each) not in _CONTROLS else _out(each) for each in text)


def one_line(text: str) -> str:
    """Return the same with line ends escaped, too, for text on a line of its own."""
    return writable(text).replace("\n", "\\n")


def fitting(lines: Iterable[str], width: int) -> list[str]:
    """Return lines that are not wider than a terminal, broken between words, and indented like their beginning.

    Args:
        lines: what is to be shown.
        width: of the terminal in columns; 0 leaves the lines as they are, for a file or a pipe.
    """
    if width <= 0:
        return list(lines)
    words = textwrap.TextWrapper(width=width, break_long_words=False, break_on_hyphens=False)
    found: list[str] = []
    for line in lines:
        words.initial_indent = " " * (len(line) - len(line.lstrip()))  # a first word that is too long has it, too
        words.subsequent_indent = f"{words.initial_indent}  "
        found += words.wrap(line.lstrip()) or [""]
    return found


def _out(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


def name_problem(name: object, *, file: bool = False) -> str:
    """Return why this cannot name a part of a run, empty if it can: the one rule for all names that cases choose.

    Args:
        name: the name of a recording, a channel or a file.
        file: whether it becomes the name of a file, which other systems must be able to store.
    """
    if not isinstance(name, str):
        return f"a name is a text, and this is a {type(name).__name__}"
    hidden = re.search(r"[\t\r\n]", name) or hidden_character(name)
    if hidden:
        return f"a name has no character U+{ord(hidden[0]):04X}"
    rules = (
        (len(name.strip()) > 0 and len(name) <= _LONGEST_PART, f"a name has 1 to {_LONGEST_PART} characters"),
        (name == name.strip() and not name.endswith("."), "a name has no space at its ends, and no dot at its end"),
        ("/" not in name and "\\" not in name, "a name has no slash"),
        (not file or _PLAIN.fullmatch(name), "a file's name has letters, digits, '.', '_' and '-', no dot first"),
        (not file or not _DEVICE.fullmatch(name), "Windows has a device of this name"),
    )
    return next((text for holds, text in rules if not holds), "")


def require_name(option: str, name: str) -> None:
    """Refuse what cannot name a person or a thing in evidence.

    Raises:
        Refused: for a blank name, a very long one, and one with invisible characters.
    """
    if problem := named_wrongly(name):
        raise Refused(f"{option} {problem[0]}", problem[1])


def named_wrongly(name: str) -> tuple[str, str] | None:
    """Return why a text cannot name a person or a thing in evidence, and what to do; None if it can."""
    if not name.strip():
        return "is empty", "give a name"
    if len(name) > _LONGEST_NAME:
        return f"has {len(name)} characters, and may have {_LONGEST_NAME}", "shorten it"
    if any("\ud800" <= character <= "\udfff" for character in name):
        return "is not text in the encoding of this terminal", "type it again"
    if found := re.search(r"[\t\r\n]", name) or hidden_character(name):
        return f"contains the character U+{ord(found[0]):04X}", "type it again without it"
    return None


def is_there(file: Path) -> bool:
    """Return whether the file exists; in a snapshot it always does."""
    snapshot = current_snapshot()
    return (snapshot is not None and file in snapshot) or file.exists()


def read_bytes(file: Path, shown: str, findings: Findings) -> bytes | None:
    """Return the contents of a file, one byte beyond the limit if it is too large; None if it cannot be read.

    Where there is a snapshot, its content is from there, or is held there from now on.

    Args:
        file: where it is.
        shown: its path as shown to a person, relative to the workspace.
        findings: where the reason is noted.
    """
    snapshot = current_snapshot()
    try:
        if snapshot is not None and file in snapshot:
            return snapshot.take(file)
        if not file.is_file():
            message = "the file is missing" if not file.exists() else "this is not a file"
            findings.repeat(Finding(shown, 0, 0, message))
            return None
        with file.open("rb") as stream:
            data = stream.read(MOST_BYTES + 1)
        return data if snapshot is None else snapshot.keep(file, data)
    except OSError as error:
        findings.repeat(Finding(shown, 0, 0, f"cannot be read: {error.strerror}"))
        return None


def decoded(data: bytes, shown: str, findings: Findings) -> str | None:
    """Return the text of `data` without byte order mark and with plain line ends.

    Anything that cannot be read safely becomes a finding, and the text is None.
    """
    if len(data) > MOST_BYTES:
        findings.repeat(Finding(shown, 0, 0, f"the file is larger than {MOST_BYTES} bytes"))
        return None
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        message = f"not UTF-8 at byte {error.start}, save the file as UTF-8"
        findings.repeat(Finding(shown, *_place_of_byte(data, error.start), message))
        return None
    text = text.removeprefix(_BYTE_ORDER_MARK).replace("\r\n", "\n").replace("\r", "\n")
    if not hidden_character(text):
        return text
    for number, line in enumerate(text.split("\n"), 1):
        match = hidden_character(line)
        if match:
            message = f"character U+{ord(match[0]):04X} is not allowed, remove it"
            findings.repeat(Finding(shown, number, match.start() + 1, message))
    return None


def _place_of_byte(data: bytes, offset: int) -> tuple[int, int]:
    """Return line and column of a byte, from 1 on."""
    line_start = data.rfind(b"\n", 0, offset) + 1
    column = len(data[line_start:offset].decode("utf-8", errors="replace")) + 1
    return data.count(b"\n", 0, offset) + 1, column
