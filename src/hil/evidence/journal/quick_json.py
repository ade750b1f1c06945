"""Canonical JSON as `hil.documents.canonical` writes it, several times faster for what events hold."""

from __future__ import annotations

from json.encoder import encode_basestring

from hil.documents.canonical import canonical

__all__ = ["quick_canonical"]

_LARGEST = 2**53 - 1


class _Unusual(Exception):
    """Something that only the complete writer knows how to write, or refuses."""


def quick_canonical(value: object) -> bytes:
    """Return the canonical JSON of `value`, the same bytes as `canonical`.

    The journal writes a line per effect, and hashing it must not be what a simulated run spends its time on.

    Raises:
        JsonError: for what has no canonical JSON.
    """
    try:
        return _text(value).encode()
    except (_Unusual, RecursionError, TypeError, UnicodeEncodeError):
        return canonical(value)


def _text(value: object) -> str:  # noqa: PLR0911 - one return per kind of value
    kind = type(value)
    if kind is str:
        return encode_basestring(value)  # type: ignore[arg-type]  # it is a str, by its type
    if kind is float:
        return _float(repr(value))
    if value is None:
        return "null"
    if kind is bool:
        return "true" if value else "false"
    if kind is int:
        return _integer(value)  # type: ignore[arg-type]  # it is an int, by its type
    if kind is dict:
        return _object(value)  # type: ignore[arg-type]  # it is a dict, by its type
    if kind is list or kind is tuple:
        return "[" + ",".join([_text(item) for item in value]) + "]"  # type: ignore[attr-defined]  # a list or tuple
    if isinstance(value, str):
        return encode_basestring(value)
    raise _Unusual


def _float(written: str) -> str:
    if "e" in written or "n" in written:
        raise _Unusual
    if written.endswith(".0"):
        return "0" if written == "-0.0" else written[:-2]
    return written


def _integer(value: int) -> str:
    if not -_LARGEST <= value <= _LARGEST:
        raise _Unusual
    return str(value)


def _object(value: dict[object, object]) -> str:
    members = []
    for key in sorted(value):  # type: ignore[type-var]  # keys that do not compare are refused below
        if type(key) is not str or not key.isascii():  # others are ordered by UTF-16
            raise _Unusual
        members.append(encode_basestring(key) + ":" + _text(value[key]))
    return "{" + ",".join(members) + "}"
