"""The grammar of SCPI as an instrument reads it: headers, parameters, channel lists, error queue.

IEEE 488.2-1992 and SCPI-1999 volume 1. A program message is split at `;`; a header without a leading
colon goes on from the level of the one before it (SCPI-1999 vol. 1, 6.2.4).
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass

__all__ = ["Command", "ErrorQueue", "ScpiError", "channel_list", "find", "keyword", "split"]

_QUEUE = 20
_MESSAGES = {
    0: "No error",
    -102: "Syntax error",
    -104: "Data type error",
    -108: "Parameter not allowed",
    -109: "Missing parameter",
    -113: "Undefined header",
    -131: "Invalid suffix",
    -221: "Settings conflict",
    -222: "Data out of range",
    -224: "Illegal parameter value",
    -350: "Error queue overflow",
    -363: "Input buffer overrun",
}


class ScpiError(Exception):
    """A message cannot be executed; `code` goes into the error queue."""

    def __init__(self, code: int) -> None:
        super().__init__(_MESSAGES[code])
        self.code = code


class ErrorQueue:
    """First in, first out, 20 entries; when it is full the last becomes `Error queue overflow`."""

    def __init__(self) -> None:
        self.codes: list[int] = []

    def push(self, code: int) -> None:
        """Note an error."""
        if len(self.codes) < _QUEUE:
            self.codes.append(code)
        else:
            self.codes[-1] = -350

    def pop(self) -> str:
        """Return the oldest error as the instrument prints it, and forget it."""
        code = self.codes.pop(0) if self.codes else 0
        return f'{code:+d},"{_MESSAGES[code]}"'


@dataclass(frozen=True, slots=True)
class Command:
    """One command of an instrument: what its header looks like, and what it does.

    Attributes:
        pattern: the compiled header.
        query: whether it is the asking form.
        action: what it does; the first argument is the header's numeric suffix, 1 where it has none.
    """

    pattern: re.Pattern[str]
    query: bool
    action: Callable[[int, Sequence[str]], str | None]


def keyword(header: str) -> re.Pattern[str]:
    """Compile a header as manuals print it: `[SOURce:]VOLTage[:LEVel]`, `ISUMmary<n>`."""
    text = header.replace("<n>", r"(\d*)").replace("[", "(?:").replace("]", ")?")
    text = re.sub(r"([A-Z]+)([a-z]+)", lambda word: f"(?:{word[1]}(?:{word[2].upper()})?)", text)
    return re.compile(rf"\{text}" if header.startswith("*") else text)


def split(message: str) -> list[str]:
    """Split a program message at `;` outside of quotes."""
    return [unit.strip() for unit in re.findall(r"(?:\"[^\"]*\"|'[^']*'|[^;\"']|[\"'])+", message) if unit.strip()]


def find(text: str, level: str, commands: Sequence[Command]) -> tuple[Command, int, tuple[str, ...], str]:
    """Find the command of one message unit.

    Args:
        text: the message unit.
        level: where the unit before it left off, such as `VOLT:`.
        commands: what the instrument knows.

    Returns:
        The command, the header's numeric suffix (1 where it has none), the parameters, and the level for the next one.

    Raises:
        ScpiError: with -113 for a header that the instrument does not know.
    """
    header, *rest = text.split(maxsplit=1)
    query = header.endswith("?")
    name = header.removesuffix("?").upper()
    common = name.startswith("*")
    full = name if common else name[1:] if name.startswith(":") else level + name
    for command in commands:
        match = command.pattern.fullmatch(full) if command.query == query else None
        if match:
            suffix = next((int(digits) for digits in match.groups() if digits), 1)
            next_level = level if common else full[: full.rfind(":") + 1]
            return command, suffix, _parameters("".join(rest)), next_level
    raise ScpiError(-113)


def channel_list(text: str) -> list[int] | None:
    """Return the channels of `(@1)`, `(@1,3)`, `(@1:3)` or `CH2`, or None if the text is no channel list.

    Raises:
        ScpiError: with -102 for a list that cannot be read, -222 for a range that is far too long.
    """
    bare = re.sub(r"\s", "", text).upper()
    if match := re.fullmatch(r"CH(\d)", bare):
        return [int(match[1])]
    if not bare.startswith("(@"):
        return None
    if not re.fullmatch(r"\(@\d{1,3}([,:]\d{1,3})*\)", bare):
        raise ScpiError(-102)
    channels: list[int] = []
    for part in bare[2:-1].split(","):
        ends = [int(number) for number in part.split(":")]
        if len(ends) > 2:
            raise ScpiError(-102)
        channels += range(ends[0], ends[-1] + 1)
    return channels


def _parameters(text: str) -> tuple[str, ...]:
    parts = [part.strip() for part in re.split(r",(?![^(]*\))", text)]
    return tuple(part for part in parts if part) if any(parts) else ()
