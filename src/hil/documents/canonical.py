"""JSON with the same bytes for the same meaning, and a strict reader."""

from __future__ import annotations

import hashlib
import json
import math
import re
from collections import Counter
from collections.abc import Callable
from json.encoder import encode_basestring
from typing import Any

import msgspec
import rfc8785

from hil.model.errors import HilError

__all__ = ["JsonError", "Unusual", "canonical", "digest", "library_text", "parse_strict", "quick_text"]

_LARGEST = 2**53 - 1
_DIGITS = len(str(_LARGEST))


class JsonError(HilError, ValueError):
    """JSON that cannot be written canonically, or must not be read.

    Args:
        message: what is wrong, with its line where the text has several.
        hint: what to do next.
        line: the line where it is, from 1; 0 is unknown.
        column: the column where it is, from 1; 0 is unknown.
        bare: what is wrong, without the place; `message` if that has none.
    """

    def __init__(self, message: str, hint: str = "", *, line: int = 0, column: int = 0, bare: str = "") -> None:
        super().__init__(message, hint)
        self.line = line
        self.column = column
        self.bare = bare or message


class Unusual(Exception):
    """Something that only the complete writer can write, or refuses."""


def _no_other(_: object) -> str:
    raise Unusual


def quick_text(value: Any, other: Callable[[Any], str] = _no_other) -> str:  # noqa: ANN401, PLR0911 - one return per kind of value
    """Return the canonical JSON of a value, the same text as `canonical`, in simple cases.

    Args:
        value: the value.
        other: writes what JSON does not have, such as structs.

    Raises:
        Unusual: for what only `canonical` can write or refuse.
    """
    kind = type(value)
    if kind is str:
        return encode_basestring(value)
    if kind is float:
        return _float(repr(value))
    if value is None:
        return "null"
    if kind is bool:
        return "true" if value else "false"
    if kind is int:
        return _integer(value)
    if kind is dict:
        return _object(value, other)
    if kind is list or kind is tuple:
        return "[" + ",".join([quick_text(item, other) for item in value]) + "]"
    if isinstance(value, str):
        return encode_basestring(value)
    return other(value)


def _float(written: str) -> str:
    if "e" in written or "n" in written:
        raise Unusual
    if written.endswith(".0"):
        return "0" if written == "-0.0" else written[:-2]
    return written


def _integer(value: int) -> str:
    if not -_LARGEST <= value <= _LARGEST:
        raise Unusual
    return str(value)


def _object(value: dict[Any, Any], other: Callable[[Any], str]) -> str:
    members = []
    for key in sorted(value):  # keys that do not compare are refused by the complete writer
        if not isinstance(key, str) or not key.isascii():  # others are ordered by UTF-16
            raise Unusual
        members.append(encode_basestring(key) + ":" + quick_text(value[key], other))
    return "{" + ",".join(members) + "}"


def canonical(value: object) -> bytes:
    """Return the canonical JSON of `value` (RFC 8785).

    Raises:
        JsonError: for NaN and infinities, for integers beyond 2**53 - 1, and for what JSON does not have.
    """
    try:
        return quick_text(value).encode()
    except (Unusual, RecursionError, TypeError, UnicodeEncodeError):
        return _complete(value)


def _complete(value: object) -> bytes:
    try:
        return rfc8785.dumps(value)  # type: ignore[arg-type]  # it checks every value itself
    except rfc8785.FloatDomainError as error:
        raise JsonError("NaN and infinity are not allowed in JSON", "write null where there is no number") from error
    except (rfc8785.CanonicalizationError, RecursionError, UnicodeEncodeError) as error:
        raise JsonError(f"this cannot be written as canonical JSON: {error}") from error


def digest(value: object, *, finite: bool = False) -> str:
    """Return the SHA-256 of the canonical JSON of `value`, as hexadecimal digits.

    Args:
        value: the value.
        finite: whether it is known that all numbers are finite, as in what was read from JSON; then it is quicker.
    """
    return hashlib.sha256((finite and _told_by_library(value)) or canonical(value)).hexdigest()


def _told_by_library(value: object) -> bytes:
    """Return the canonical JSON of a value whose numbers are finite; nothing where the library may write another."""
    try:
        text, canonical_too = library_text(value)
    except (TypeError, UnicodeEncodeError, RecursionError):
        return b""
    return text if canonical_too and b"\\" not in text else b""


def library_text(value: object) -> tuple[bytes, bool]:
    """Return the library's JSON of a value, and whether that is canonical, apart from character escapes.

    The library writes ten times as fast. Its text is the canonical one, too, where no number in it is one that RFC 8785
    writes in a form of its own, and no key one that it orders otherwise; whether one may be is seen without reading the
    text. NaN and infinities become null.
    """
    text = _ENCODE(value)
    if b".0" in text:
        text = _WHOLE.sub(rb'":\1', text)
    return text, not _in_doubt(text)


_ENCODE = msgspec.json.Encoder(order="sorted").encode
_WHOLE = re.compile(rb'":(?<=[0-9A-Za-z]":)(-?[1-9][0-9]*|0)\.0(?=[,}])')
"""A whole number; where no key ends before it, it stands in a text that begins with a colon."""
_ZEROS = bytes.maketrans(b"123456789", b"000000000")
_LONG = b"0" * 16
_LONG_INTEGER = re.compile(b"(?:^|[:,[-])0{16}")
"""One of the largest integers of JSON, alone or after what may stand before it; a fraction may have as many digits."""
_BEYOND = re.compile(b"[\xf0-\xf7]")
"""How characters begin by which RFC 8785 orders keys otherwise."""


def _in_doubt(text: bytes) -> bool:
    """Return whether a text of the library may hold what RFC 8785 writes otherwise: looked at with all digits 0."""
    if b".0," in text or b".0}" in text or b".0]" in text or text.endswith(b".0"):  # a whole number that is no member
        return True
    zeros = text.translate(_ZEROS)
    if b"0e0" in zeros or b"0e-" in zeros or (_LONG in zeros and _LONG_INTEGER.search(zeros) is not None):
        return True
    return not text.isascii() and _BEYOND.search(text) is not None


def parse_strict(data: bytes) -> object:
    """Return what the JSON in `data` says.

    Raises:
        JsonError: for anything but UTF-8 JSON with unique keys and finite numbers.
    """
    try:
        return _parse(data.decode("utf-8"))
    except JsonError:
        raise
    except UnicodeDecodeError as error:
        raise JsonError(f"not UTF-8 at byte {error.start}") from error
    except json.JSONDecodeError as error:
        line, column, bare = error.lineno, error.colno, f"not JSON: {error.msg}"
        raise JsonError(
            f"not JSON at line {line}, column {column}: {error.msg}", line=line, column=column, bare=bare
        ) from error
    except RecursionError as error:
        raise JsonError("JSON nested too deeply") from error
    except ValueError as error:
        raise JsonError(f"not JSON: {error}") from error


def _unique(pairs: list[tuple[str, object]]) -> dict[str, object]:
    unique = dict(pairs)
    if len(unique) < len(pairs):
        counted = Counter(key for key, _ in pairs)
        raise JsonError(f"duplicate key {next(key for key in counted if counted[key] > 1)!r}")
    return unique


def _refuse_constant(name: str) -> object:
    raise JsonError(f"{name} is not allowed in JSON")


def _exact(text: str) -> int | float:
    if len(text) < _DIGITS or (len(text) <= _DIGITS + 1 and abs(int(text)) <= _LARGEST):
        return int(text)
    # Canonical JSON writes large floats without point or exponent; any other integer would lose digits.
    number = _finite(text)
    if canonical(number) != text.encode():
        raise JsonError(f"{text[:40]} has more digits than a number can hold")
    return number


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise JsonError(f"{text[:40]} is too large for a number")
    return number


_parse = json.JSONDecoder(
    object_pairs_hook=_unique, parse_constant=_refuse_constant, parse_float=_finite, parse_int=_exact
).decode
