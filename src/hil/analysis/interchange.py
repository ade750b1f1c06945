"""Shared by calibration exports: documents with a fingerprint, and number formats for C and JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import TypeAlias, TypeVar

from hil.documents.canonical import JsonError, digest, parse_strict
from hil.model.errors import Refused

__all__ = [
    "Matrix",
    "as_text",
    "dof",
    "finite",
    "labelled_rows",
    "literal",
    "matrix",
    "number",
    "opened",
    "parsed",
    "printable",
    "rows",
    "sealed",
    "short",
]

Matrix: TypeAlias = tuple[tuple[float, ...], ...]

_DIGITS = 9  # of a coefficient: more than any float32 holds
_HINT = "give the JSON that an export wrote"
_Made = TypeVar("_Made")


def short(value: float) -> float:
    """Return a number rounded as in every export, to 9 significant digits."""
    return float(f"{value:.{_DIGITS}g}")


def sealed(document: Mapping[str, object]) -> dict[str, object]:
    """Return a document with a `fingerprint`, the SHA-256 of everything else in it."""
    return {**document, "fingerprint": digest(dict(document))}


def as_text(document: Mapping[str, object]) -> str:
    """Return a document as canonical JSON text."""
    return json.dumps(document, indent=2, allow_nan=False) + "\n"


def parsed(text: str) -> Mapping[str, object]:
    """Parse a document from JSON text.

    Raises:
        Refused: the text is not a JSON object.
    """
    try:
        document = parse_strict(text.encode("utf-8"))
    except JsonError as error:
        raise Refused(f"this is no calibration: {error.message}", _HINT) from None
    if not isinstance(document, Mapping):
        raise Refused("this is no calibration: not an object", _HINT)
    return document


def opened(document: Mapping[str, object], schema: str, read: Callable[[Mapping[str, object]], _Made]) -> _Made:
    """Verify a document, and return the calibration that it contains.

    Args:
        document: the document with its fingerprint.
        schema: the required format.
        read: builds the calibration; KeyError, TypeError, ValueError and AttributeError mean an incomplete document.

    Raises:
        Refused: the document has another format, does not match its fingerprint, or is incomplete.
    """
    if document.get("schema") != schema:
        raise Refused(f"this is no calibration in the format {schema}", _HINT)
    rest = {key: value for key, value in document.items() if key != "fingerprint"}
    if digest(rest) != document.get("fingerprint"):
        raise Refused(
            "the calibration does not match its fingerprint: it was changed after it was exported",
            "export it again, or take the original",
        )
    try:
        return read(document)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise Refused(f"this calibration is incomplete: {error}", _HINT) from None


def finite(freedom: float) -> float | None:
    """Return degrees of freedom as a JSON value: null if infinite."""
    return freedom if math.isfinite(freedom) else None


def dof(value: object) -> float:
    """Return degrees of freedom from a JSON value.

    Raises:
        TypeError: it is neither a number nor null.
    """
    return math.inf if value is None else number(value)


def rows(values: Matrix | None) -> list[list[float]] | None:
    """Return a matrix as a JSON value."""
    return None if values is None else [list(row) for row in values]


def matrix(values: object) -> Matrix:
    """Return a matrix from a JSON value.

    Raises:
        TypeError: it is none.
    """
    if not isinstance(values, list):
        raise TypeError("a list of numbers is missing")
    return tuple(tuple(number(each) for each in row) for row in values)


def number(value: object) -> float:
    """Return a number from a JSON value.

    Raises:
        TypeError: it is none.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise TypeError(f"'{value}' is not a number")
    return float(value)


def printable(names: Iterable[str]) -> None:
    """Refuse names that would terminate a C comment or string.

    Raises:
        Refused: a name is not safe in C.
    """
    for name in names:
        if not name.isprintable() or "*/" in name or '"' in name or "\\" in name:
            raise Refused(f"'{name}' is not allowed in a C header", "rename the axis or the unit")


def labelled_rows(names: Sequence[str], values: Sequence[Sequence[float]]) -> str:
    """Return the rows of a C array, zero-padded to one length, each with its name as a comment."""
    longest = max(map(len, values))
    filled = [[*row, *(0.0,) * (longest - len(row))] for row in values]
    return "\n".join(
        f"    {{{', '.join(map(literal, row))}}}, /* {name} */" for name, row in zip(names, filled, strict=True)
    )


def literal(value: float) -> str:
    """Return a number as a C literal."""
    return repr(float(value))
