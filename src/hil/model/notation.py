"""Notations of values in the files of a workspace, as the field types of declared models.

A model is a frozen dataclass (or a pydantic model) whose field types define their notation: `Number` is a decimal
number in quotes, `Seconds` a duration such as `10 ms`. `hil.documents.declared` reads files into such models. The
types need no validation library, so the code that drives and guards a bench uses the same models without loading one.

    @dataclass(frozen=True, kw_only=True)
    class Heater:
        power: Number
        delay_s: Seconds = field(default=0.0, metadata={"alias": "delay"})
"""

from __future__ import annotations

import dataclasses
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from functools import partial
from itertools import pairwise
from typing import Annotated, Any, TypeVar, get_args

__all__ = [
    "NAMED",
    "UNREADABLE",
    "UNWRITTEN",
    "AnyText",
    "ByName",
    "Complaint",
    "DecimalText",
    "Flag",
    "Hertz",
    "Nanoseconds",
    "NotNegative",
    "Notation",
    "Number",
    "Path",
    "Plain",
    "Positive",
    "Seconds",
    "SomeNanoseconds",
    "Text",
    "matching",
    "measured",
    "number",
    "one_of",
    "read_number",
    "seconds",
    "slug",
    "vector",
    "whole",
]

Path = tuple[str | int, ...]
"""Where a value stands in a document: keys and list positions from its root."""

UNREADABLE = "\0"
"""Placeholder for an unreadable value; no file can contain it. Every notation reads it as its blank value."""

NAMED = {"alias": "\0name"}
"""Metadata of the field for an entry's name, for `ByName`: the name is the entry's key, not part of it."""

UNWRITTEN = {"alias": "\0"}
"""Metadata of a field that is never in a file, but filled in by the code that reads it."""

_Real = TypeVar("_Real", int, float)

_LONGEST_NUMBER = 100
_NANO = 10**9
_CENTURY_S = 100 * 366 * 86_400
_DECIMAL = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
_INTEGER = re.compile(r"[-+]?(0|[1-9][0-9]{0,17})")
_HEXADECIMAL = re.compile(r"0[xX][0-9a-fA-F]{1,16}")
_QUANTITY = re.compile(r"([0-9]+(?:\.[0-9]+)?)\s*([^\s0-9.]+)")
_SECONDS = {
    "us": Decimal("1e-6"),
    "µs": Decimal("1e-6"),
    "ms": Decimal("1e-3"),
    "s": Decimal(1),
    "min": Decimal(60),
    "h": Decimal(3600),
    "d": Decimal(86400),
}
_HERTZ = {
    "mHz": Decimal("1e-3"),
    "Hz": Decimal(1),
    "kHz": Decimal("1e3"),
    "MHz": Decimal("1e6"),
    "GHz": Decimal("1e9"),
}


class Complaint(ValueError):
    """An invalid value, with a message that follows the key's name: `must be text`.

    Args:
        expected: the message.
        quote: whether quoting the value would fix it.
        found: whether the value found is appended to the message.
        known: the valid values, of which the nearest is suggested.
        inner: complaints about parts of the value, by their path below it; the message is then empty.
    """

    def __init__(
        self,
        expected: str = "",
        *,
        quote: bool = False,
        found: bool = True,
        known: Sequence[str] = (),
        inner: Mapping[Path, Complaint] | None = None,
    ) -> None:
        super().__init__(expected)
        self.expected = expected
        self.quote = quote
        self.found = found
        self.known = known
        self.inner = inner or {}


@dataclass(frozen=True, slots=True)
class Notation:
    """Notation of one kind of value: the annotation of a field.

    Attributes:
        read: returns the value of what a file holds there (text, whole number, flag, list or mapping), or raises
            `Complaint`, or any other ValueError with words that follow the key's name.
        blank: replaces an unreadable value, so that everything else can still be checked.
    """

    read: Callable[[object], object]
    blank: object

    def __get_pydantic_core_schema__(self, source: object, handler: Callable[[object], object]) -> dict[str, object]:
        # Files provide the written form, code the value itself.
        written = {"type": "function-plain", "function": {"type": "no-info", "function": self._value}}
        return {"type": "json-or-python", "json_schema": written, "python_schema": handler(source)}

    def _value(self, value: object) -> object:
        return self.blank if value == UNREADABLE else self.read(value)


class ByName:
    """Reads a mapping of names to entries into a tuple of entries, each with a field of metadata `NAMED`."""

    def __get_pydantic_core_schema__(self, source: object, handler: Any) -> dict[str, object]:  # noqa: ANN401 - pydantic's
        entries = handler.generate_schema(dict[str, get_args(source)[0]])  # type: ignore[misc]  # known at run time
        return {"type": "function-after", "function": {"type": "no-info", "function": self._named}, "schema": entries}

    @staticmethod
    def _named(entries: Mapping[str, Any]) -> tuple[object, ...]:
        return tuple(dataclasses.replace(entry, **{_name_of(type(entry)): name}) for name, entry in entries.items())


def _name_of(entry: type[Any]) -> str:
    return next(field.name for field in dataclasses.fields(entry) if field.metadata.get("alias") == NAMED["alias"])


def matching(pattern: str, words: str) -> Notation:
    """Return the notation of a text that matches a whole pattern; `words` describe it, such as `a date`."""
    return Notation(partial(_text, pattern=pattern, words=words), "")


def slug(mark: str) -> Notation:
    """Return the notation of a short name: lower-case letters, digits and one mark, such as `_`, between them."""
    return matching(f"[a-z][a-z0-9{mark}]*", f"lower-case letters, digits and '{mark}', beginning with a letter")


def one_of(*choices: str, blank: str = "") -> Notation:
    """Return the notation of a choice between texts, such as members of an enumeration."""
    return Notation(partial(_text, choices=choices), blank)


def measured(
    unit: str = "",
    *,
    minimum: float = -math.inf,
    maximum: float = math.inf,
    above: float = -math.inf,
    choices: Sequence[float] = (),
) -> Notation:
    """Return the notation of a number with optional unit, `5.5` or `5.5 V`, within bounds or from `choices`."""
    bounds = (minimum, maximum, above)
    return Notation(partial(_measured, unit=unit, bounds=bounds, choices=choices), max(0.0, minimum))


def number(minimum: float = -math.inf, maximum: float = math.inf, *, above: float = -math.inf) -> Notation:
    """Return the notation of a decimal number in quotes within bounds, in the unit of its field."""
    return Notation(partial(read_number, minimum=minimum, maximum=maximum, above=above), max(0.0, minimum))


def seconds(minimum: float = 0.0, *, above: float = -math.inf) -> Notation:
    """Return the notation of a duration within bounds [s], see `Seconds`."""
    return Notation(partial(_seconds, minimum=minimum, above=above), minimum)


def vector(size: int, *, minimum: float = -math.inf, above: float = -math.inf, rising: bool = False) -> Notation:
    """Return the notation of a list of `size` quoted decimal numbers, within bounds, ascending if `rising`."""
    each = partial(read_number, minimum=minimum, above=above)
    return Notation(partial(_vector, size=size, each=each, rising=rising), (0.0,) * size)


def whole(minimum: int | None = None, maximum: int | None = None) -> Notation:
    """Return the notation of an integer, decimal or with 0x, quoted or not."""
    return Notation(partial(_whole, minimum=minimum, maximum=maximum), minimum or 0)


def _text(value: object, pattern: str = "", words: str = "", choices: Sequence[str] = ()) -> str:
    if not isinstance(value, str):
        raise Complaint("must be text", quote=isinstance(value, bool | int))
    if choices and value not in choices:
        raise Complaint(f"must be one of {', '.join(filter(None, choices))}", known=choices)
    if pattern and not re.fullmatch(pattern, value):
        raise Complaint(f"must be {words}")
    return next((choice for choice in choices if choice == value), value)


def _filled_text(value: object) -> str:
    text = _text(value)
    if not text.strip():
        raise Complaint("must not be empty", found=False)
    return text


def _decimal(value: object) -> str:
    if not isinstance(value, str):
        raise Complaint("must be a number in quotes", quote=type(value) is int)
    if not _DECIMAL.fullmatch(value):
        raise Complaint("must be a decimal number in quotes")
    if len(value) > _LONGEST_NUMBER or not math.isfinite(float(value)):
        raise Complaint("is too large for a number, or too long")
    if abs(float(value)) < sys.float_info.min and re.search("[1-9]", re.split("[eE]", value)[0]):
        raise Complaint("is too small for a number")  # a limit would silently be zero, or keep a digit or two
    return value


def read_number(
    value: object, minimum: float = -math.inf, maximum: float = math.inf, above: float = -math.inf
) -> float:
    """Parse a quoted decimal number.

    Raises:
        Complaint: it is not a number, or outside the bounds.
    """
    return _within(float(_decimal(value)), minimum, maximum, above)


def _whole(value: object, minimum: int | None = None, maximum: int | None = None) -> int:
    found: int | None = None
    if type(value) is int:
        found = value
    elif isinstance(value, str) and _INTEGER.fullmatch(value):
        found = int(value)
    elif isinstance(value, str) and _HEXADECIMAL.fullmatch(value):
        found = int(value, 16)
    if found is None:
        raise Complaint("must be a whole number, decimal or with 0x")
    return _within(found, -math.inf if minimum is None else minimum, math.inf if maximum is None else maximum)


def _within(value: _Real, minimum: float, maximum: float, above: float = -math.inf, unit: str = "") -> _Real:
    if value < minimum:
        raise Complaint(f"must be at least {minimum:.15g} {unit}".rstrip())
    if value > maximum:
        raise Complaint(f"must be at most {maximum:.15g} {unit}".rstrip())
    if not value > above:
        raise Complaint(f"must be above {above:.15g} {unit}".rstrip())
    return value


def _vector(value: object, size: int, each: Callable[[object], float], rising: bool) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != size:
        raise Complaint(f"must be a list of {size} numbers", found=False)
    numbers: list[float] = []
    wrong: dict[Path, Complaint] = {}
    for place, item in enumerate(value):
        try:
            numbers.append(each(item))
        except Complaint as complaint:
            wrong[place,] = complaint
    if wrong:
        raise Complaint(inner=wrong)
    if rising and any(after <= before for before, after in pairwise(numbers)):
        raise Complaint("must be rising numbers", found=False)
    return tuple(numbers)


def _measured(value: object, unit: str, bounds: tuple[float, float, float], choices: Sequence[float]) -> float:
    number = value.strip().removesuffix(unit).strip() if isinstance(value, str) else ""
    if not _DECIMAL.fullmatch(number) or not math.isfinite(float(number)):
        raise Complaint(f"must be a number in {unit}, like '5.5 {unit}'" if unit else "must be a number")
    if choices and float(number) not in choices:
        raise Complaint(f"must be one of {', '.join(f'{choice:g}' for choice in choices)} {unit}".rstrip())
    return _within(float(number), *bounds, unit)


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise Complaint("must be true or false without quotes")
    return value


def _seconds(value: object, minimum: float = 0.0, above: float = -math.inf) -> float:
    found = _quantity(value, _SECONDS, "a duration such as 10 ms, 4 h or 90 d")
    if found < minimum:
        raise Complaint(f"must be at least {minimum:g} s")
    if not found > above:
        raise Complaint(f"must be longer than {above:g} s")
    return found


def _nanoseconds(value: object, minimum: int = 0) -> int:
    nanoseconds = round(_seconds(value) * _NANO)
    if nanoseconds > _CENTURY_S * _NANO:
        raise Complaint("must be at most a century")
    if nanoseconds < minimum:
        raise Complaint("must be longer than zero")
    return nanoseconds


def _hertz(value: object) -> float:
    hertz = _quantity(value, _HERTZ, "a frequency such as 100 Hz or 400 kHz")
    if not hertz > 0:
        raise Complaint("must be a frequency above zero")
    return hertz


def _quantity(value: object, units: Mapping[str, Decimal], expected: str) -> float:
    match = _QUANTITY.fullmatch(value) if isinstance(value, str) else None
    if match is None or len(match[0]) > _LONGEST_NUMBER:
        raise Complaint(f"must be {expected}")
    number, unit = match.groups()
    if unit not in units:
        raise Complaint(f"must be {expected}; the unit '{unit}' is not one of {', '.join(units)}", found=False)
    amount = float(Decimal(number) * units[unit])
    if not math.isfinite(amount):
        raise Complaint("is too large")
    return amount


def _plain(value: object) -> object:
    wrong = dict(_not_plain(value, ()))
    if wrong:
        raise Complaint(inner=wrong)
    return value


def _not_plain(value: object, path: Path) -> list[tuple[Path, Complaint]]:
    # Documents are at most 20 levels deep, so this may recurse.
    if isinstance(value, Mapping):
        return [found for key, item in value.items() for found in _not_plain(item, (*path, key))]
    if isinstance(value, list):
        return [found for index, item in enumerate(value) for found in _not_plain(item, (*path, index))]
    return [(path, Complaint("must be text", quote=True))] if type(value) is int else []


Text = Annotated[str, Notation(_filled_text, "")]
"""A non-blank text."""

AnyText = Annotated[str, Notation(_text, "")]
"""A text, possibly empty."""

Number = Annotated[float, Notation(read_number, 0.0)]
"""The value of a decimal number in quotes."""

Positive = Annotated[float, number(above=0)]
"""A decimal number in quotes, above zero."""

NotNegative = Annotated[float, number(0)]
"""A decimal number in quotes, zero or more."""

DecimalText = Annotated[str, Notation(_decimal, "0")]
"""A decimal number in quotes, kept as text."""

Flag = Annotated[bool, Notation(_flag, False)]
"""An unquoted true or false."""

Seconds = Annotated[float, Notation(_seconds, 0.0)]
"""Seconds, written as `10 ms`, `4 h`, `90 d`."""

Nanoseconds = Annotated[int, Notation(_nanoseconds, 0)]
"""Whole nanoseconds, written like seconds."""

SomeNanoseconds = Annotated[int, Notation(partial(_nanoseconds, minimum=1), 1)]
"""Whole nanoseconds, at least one."""

Hertz = Annotated[float, Notation(_hertz, 1.0)]
"""Hertz, written as `100 Hz`, `400 kHz`."""

Plain = Annotated[object, Notation(_plain, "")]
"""Texts and flags, nested in lists and mappings; numbers are quoted texts. The owner of the part parses it further."""
