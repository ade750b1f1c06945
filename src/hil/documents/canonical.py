"""JSON that is the same bytes for the same meaning, and a reader that lets nothing slip."""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter

import rfc8785

from hil.model.errors import HilError

__all__ = ["JsonError", "canonical", "digest", "parse_strict"]

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


def canonical(value: object) -> bytes:
    """Return the canonical JSON of `value` (RFC 8785).

    Raises:
        JsonError: for NaN and infinities, for integers beyond 2**53 - 1, and for what JSON does not have.
    """
    try:
        return rfc8785.dumps(value)  # type: ignore[arg-type]  # it checks every value itself
    except rfc8785.FloatDomainError as error:
        raise JsonError("NaN and infinity are not allowed in JSON", "write null where there is no number") from error
    except (rfc8785.CanonicalizationError, RecursionError, UnicodeEncodeError) as error:
        raise JsonError(f"this cannot be written as canonical JSON: {error}") from error


def digest(value: object) -> str:
    """Return the SHA-256 of the canonical JSON of `value`, as hexadecimal digits."""
    return hashlib.sha256(canonical(value)).hexdigest()


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
