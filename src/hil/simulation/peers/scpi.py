"""The grammar of SCPI as an instrument reads it: headers, parameters, channel lists, errors.

IEEE 488.2-1992 and SCPI-1999 volume 1. A program message is split at `;`; a header without a leading
colon continues from the level of the one before it (SCPI-1999 vol. 1, 6.2.4).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence

from hil.wire.checkpoint import Kept, Stateful

__all__ = [
    "ErrorQueue",
    "ScpiError",
    "channel_list",
    "choice",
    "keyword",
    "leading_channel",
    "no_channel",
    "none",
    "number",
    "one",
    "split",
    "switch",
    "units",
    "value",
    "word",
]

_QUEUE = 20
_ON_OFF = {"ON": True, "1": True, "OFF": False, "0": False}
_MESSAGES = {
    0: "No error",
    -102: "Syntax error",
    -104: "Data type error",
    -108: "Parameter not allowed",
    -109: "Missing parameter",
    -113: "Undefined header",
    -131: "Invalid suffix",
    -213: "Init ignored",
    -221: "Settings conflict",
    -222: "Data out of range",
    -224: "Illegal parameter value",
    -230: "Data corrupt or stale",
    -350: "Error queue overflow",
    -363: "Input buffer overrun",
}


_WORDS = re.compile(r"(MIN)(?:IMUM)?|(MAX)(?:IMUM)?|(DEF)(?:AULT)?")
_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:E[+-]?\d{1,3})?)\s*([A-Z]*)")


class ScpiError(Exception):
    """A message cannot be executed; `code` goes into the error queue."""

    def __init__(self, code: int) -> None:
        super().__init__(_MESSAGES[code])
        self.code = code


class ErrorQueue(Stateful):
    """First in, first out, 20 entries; when it is full the last becomes `Error queue overflow`."""

    codes: Kept[list[int]]

    def __init__(self) -> None:
        self.codes = []

    def push(self, code: int) -> None:
        """Note an error."""
        if len(self.codes) < _QUEUE:
            self.codes.append(code)
        else:
            self.codes[-1] = -350

    def pop(self, form: str) -> str:
        """Return the oldest error as the instrument prints it, number and text in this form, and forget it."""
        code = self.codes.pop(0) if self.codes else 0
        return form.format(code, _MESSAGES[code])


def keyword(header: str) -> re.Pattern[str]:
    """Compile a header as manuals print it: `[SOURce:]VOLTage[:LEVel]`, `ISUMmary<n>`."""
    text = header.replace("<n>", r"(\d*)").replace("[", "(?:").replace("]", ")?")
    text = re.sub(r"([A-Z]+)([a-z]+)", lambda word: f"(?:{word[1]}(?:{word[2].upper()})?)", text)
    return re.compile(rf"\{text}" if header.startswith("*") else text)


def split(message: str) -> list[str]:
    """Split a program message at `;` outside of quotes."""
    return [unit.strip() for unit in re.findall(r"(?:\"[^\"]*\"|'[^']*'|[^;\"']|[\"'])+", message) if unit.strip()]


def units(message: str) -> Iterator[tuple[str, bool, tuple[str, ...]]]:
    """Yield full header in capitals, whether it is a question, and parameters of every unit of a message."""
    level = ""
    for text in split(message):
        header, *rest = text.split(maxsplit=1)
        name = header.removesuffix("?").upper()
        common = name.startswith("*")
        full = name if common else name[1:] if name.startswith(":") else level + name
        level = level if common else full[: full.rfind(":") + 1]
        yield full, header.endswith("?"), _parameters("".join(rest))


def word(text: str) -> str | None:
    """Return MIN, MAX or DEF where the text is that, long or short."""
    match = _WORDS.fullmatch(text.upper())
    return next(found for found in match.groups() if found) if match else None


def number(text: str, factors: Mapping[str, float]) -> float:
    """Return a number with a suffix or without.

    Args:
        text: a parameter.
        factors: of the suffixes that are known; if there are none, a suffix is not a number at all.

    Raises:
        ScpiError: with -104 for what is not a number, -131 for a suffix that is not known.
    """
    match = _NUMBER.fullmatch(text.upper())
    if match is None or (match[2] and not factors):
        raise ScpiError(-104)
    if match[2] and match[2] not in factors:
        raise ScpiError(-131)
    return float(match[1]) * factors.get(match[2], 1.0)


def channel_list(text: str) -> list[int] | None:
    """Return the channels of `(@1)`, `(@1,3)`, `(@1:3)` or `CH2`, or None if the text is not a channel list.

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


def leading_channel(parameters: Sequence[str]) -> tuple[list[str], list[int] | None]:
    """Split a leading `CH1` off parameters."""
    match = re.fullmatch(r"CH(\d)", parameters[0].upper()) if parameters else None
    return list(parameters[1:] if match else parameters), [int(match[1])] if match else None


def no_channel(parameters: Sequence[str]) -> tuple[list[str], list[int] | None]:
    """Leave parameters as they are: none of them names an output."""
    return list(parameters), None


def one(given: Sequence[str]) -> str:
    """Return the one parameter of a command."""
    if len(given) != 1:
        raise ScpiError(-108 if given else -109)
    return given[0]


def none(given: Sequence[str], result: str | None = None) -> str | None:
    """Return a result, where nothing was given."""
    if given:
        raise ScpiError(-108)
    return result


def value(text: str, low: float, high: float) -> float:
    """Return a number within bounds, which MIN and MAX name."""
    bound = {"MIN": low, "MAX": high}.get(word(text) or "")
    found = number(text, {}) if bound is None else bound
    if not low <= found <= high:
        raise ScpiError(-222)
    return found


def choice(text: str, *words: str) -> str:
    """Return the short form of a word that manuals print as `POSitive`."""
    for word in words:
        short = "".join(letter for letter in word if not letter.islower())
        if text.upper() in {short, word.upper()}:
            return short
    raise ScpiError(-224)


def switch(text: str) -> bool:
    """Return whether a word is ON."""
    on = _ON_OFF.get(text.upper())
    if on is None:
        raise ScpiError(-224)
    return on


def _parameters(text: str) -> tuple[str, ...]:
    parts = [part.strip() for part in re.split(r",(?![^(]*\))", text)]
    return tuple(part for part in parts if part) if any(parts) else ()
