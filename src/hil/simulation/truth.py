"""Truth sections of a bench file: what a simulated article really is, read strictly."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from math import inf
from typing import TypeVar

from hil.documents.declared import Invalid, validated
from hil.documents.suggest import did_you_mean

__all__ = ["Path", "Truth", "TruthError", "UnknownPlant", "declared", "suggestion"]

Path = tuple[str | int, ...]
_Model = TypeVar("_Model")

_NUMBER = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")
_DURATION = re.compile(r"(\d+(?:\.\d+)?)\s*(us|ms|s|min|h)")
_NANOSECONDS = {"us": 1_000, "ms": 1_000_000, "s": 1_000_000_000, "min": 60_000_000_000, "h": 3_600_000_000_000}
_LONGEST_NS = 100 * 366 * 24 * _NANOSECONDS["h"]


class TruthError(ValueError):
    """One thing that is wrong in the simulated part of a bench file.

    Args:
        path: where it is, as keys and list positions below `simulated`.
        message: what is wrong, in one sentence without a full stop.
        others: more of the same section, so that all can be told at once.
    """

    def __init__(self, path: Path, message: str, others: tuple[TruthError, ...] = ()) -> None:
        super().__init__(f"{'.'.join(str(part) for part in path)}: {message}")
        self.path = path
        self.message = message
        self.others = others


class UnknownPlant(TruthError):
    """A terminal, or what the person knows, names a plant that there is not.

    Attributes:
        plant: its name; where that one has errors of its own, they alone are told.
    """

    def __init__(self, path: Path, plant: str, known: Sequence[str]) -> None:
        super().__init__(path, f"unknown plant '{plant}'{suggestion(plant, known)}")
        self.plant = plant


def declared(model: type[_Model], values: Mapping[str, object], what: str, path: Path) -> _Model:
    """Return a section as its model declares it; see `hil.model.notation`.

    Args:
        model: a frozen dataclass.
        values: the section as read.
        what: what it is, for messages.
        path: where it stands.

    Raises:
        TruthError: with everything that is wrong.
    """
    try:
        return validated(model, values, what, path)
    except Invalid as error:
        first, *others = (TruthError(each.path, each.message) for each in error.problems)
        raise TruthError(first.path, first.message, tuple(others)) from error


def suggestion(word: str, known: Sequence[str]) -> str:
    """Return `, did you mean 'x'?` for the nearest known word, or what is known."""
    return did_you_mean(word, known) or (f"; known are {', '.join(sorted(known))}" if known else "")


class Truth:
    """One section. Every getter notes what is wrong and goes on; `finish` raises all of it.

    Numbers are decimal strings, as everywhere in the files of a bench.

    Args:
        values: the section as read.
        path: where it stands, for messages.
    """

    def __init__(self, values: object, path: Path, errors: list[TruthError] | None = None) -> None:
        self.path = path
        self._errors: list[TruthError] = [] if errors is None else errors
        self._asked: list[str] = []
        self._children: list[Truth] = []
        self._values: Mapping[str, object] = {}
        if isinstance(values, Mapping):
            self._values = values
        else:
            self._wrong((), f"expected a mapping, not {values!r}")

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        minimum: float = -inf,
        maximum: float = inf,
        above: float = -inf,
    ) -> float:
        """Return a number within the bounds; without a default it is required."""
        value = self._get(key, required=default is None)
        if value is None:
            return 1.0 if default is None else default
        return self._number((key,), value, minimum, maximum, above)

    def integer(self, key: str, default: int | None = None, *, minimum: int = 0, maximum: int = 2**31) -> int:
        """Return a whole number within the bounds; without a default it is required."""
        number = self.number(key, default, minimum=minimum, maximum=maximum)
        if number != int(number):
            self._wrong((key,), f"expected a whole number, not {number}")
        return int(number)

    def vector(self, key: str, size: int, default: tuple[float, ...] | None = None) -> tuple[float, ...]:
        """Return `size` numbers; without a default they are required."""
        value = self._get(key, required=default is None)
        if value is None:
            return (1.0,) * size if default is None else default
        if not isinstance(value, list | tuple) or len(value) != size:
            self._wrong((key,), f"expected a list of {size} numbers, not {value!r}")
            return (1.0,) * size
        return tuple(self._number((key, place), item, -inf, inf, -inf) for place, item in enumerate(value))

    def integers(self, key: str, *, minimum: int, maximum: int) -> tuple[int, ...]:
        """Return a list of whole numbers within the bounds, empty where the key is absent."""
        value = self._get(key, required=False)
        if value is None:
            return ()
        if not isinstance(value, list | tuple):
            self._wrong((key,), f"expected a list of numbers, not {value!r}")
            return ()
        numbers = [self._number((key, place), item, minimum, maximum, -inf) for place, item in enumerate(value)]
        return tuple(int(number) for number in numbers)

    def text(self, key: str, default: str | None = None, *, choices: Sequence[str] = ()) -> str:
        """Return a text, one of the choices where there are any; without a default it is required."""
        value = self._get(key, required=default is None)
        if value is None:
            return default or ""
        if not isinstance(value, str):
            self._wrong((key,), f"expected a text, not {value!r}")
        elif choices and value not in choices:
            self._wrong((key,), f"unknown value '{value}'{suggestion(value, choices)}")
        return str(value)

    def flag(self, key: str, default: bool) -> bool:
        """Return a truth value."""
        value = self._get(key, required=False)
        if value is None:
            return default
        if not isinstance(value, bool):
            self._wrong((key,), f"expected true or false, not {value!r}")
        return bool(value)

    def duration_ns(self, key: str, default: int | None = None) -> int:
        """Return a duration written as `12 s`, in nanoseconds; units are us, ms, s, min and h."""
        value = self._get(key, required=default is None)
        if value is None:
            return default or 0
        match = _DURATION.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            self._wrong((key,), f"expected a duration such as '12 s', not {value!r}")
            return 0
        duration_ns = float(match[1]) * _NANOSECONDS[match[2]]
        if duration_ns > _LONGEST_NS:
            self._wrong((key,), f"expected a duration of a century at most, not {value}")
            return 0
        return round(duration_ns)

    def part(self, model: type[_Model]) -> _Model:
        """Return what a section says of one part, by the keys that its model declares; see `hil.model.notation`.

        Every other key is for somebody else. What is wrong is noted, and the part is then as by default.

        Args:
            model: a frozen dataclass; every field has a default.
        """
        keys = [str(each.metadata.get("alias", each.name)) for each in fields(model)]  # type: ignore[arg-type]  # one is
        self._asked += keys
        try:
            values = {key: value for key, value in self._values.items() if key in keys}
            return declared(model, values, str(self.path[-1]) if self.path else "truth", self.path)
        except TruthError as error:
            self._errors += (error, *error.others)
            return model()

    def sections(self, key: str) -> dict[str, Truth]:
        """Return the named sections below a key, empty where the key is absent."""
        value = self._get(key, required=False)
        if value is None:
            return {}
        if not isinstance(value, Mapping):
            self._wrong((key,), f"expected a mapping, not {value!r}")
            return {}
        children = {str(name): Truth(item, (*self.path, key, str(name)), self._errors) for name, item in value.items()}
        self._children += children.values()
        return children

    def wrong(self, key: str, message: str) -> None:
        """Note something wrong with a key that only its reader can see."""
        self._wrong((key,), message)

    def finish(self) -> None:
        """Refuse unknown keys.

        Raises:
            TruthError: if anything was wrong in this section or below.
        """
        for section in (self, *self._children):
            section.refuse_unknown()
        if self._errors:
            first, *others = self._errors
            raise TruthError(first.path, first.message, tuple(others))

    def refuse_unknown(self) -> None:
        """Note keys that nobody asked for; `finish` does so for the whole section."""
        for key in self._values:
            if key not in self._asked:
                self._wrong((key,), f"unknown key '{key}'{suggestion(str(key), self._asked)}")

    def _get(self, key: str, *, required: bool) -> object:
        self._asked.append(key)
        value = self._values.get(key)
        if value is None and required:
            self._wrong((key,) if key in self._values else (), f"'{key}' is missing")
        return value

    def _number(self, key: Path, value: object, minimum: float, maximum: float, above: float) -> float:
        if not isinstance(value, str) or not _NUMBER.fullmatch(value):
            self._wrong(key, f"expected a number in quotes, not {value!r}")
            return 1.0
        number = float(value)
        if not minimum <= number <= maximum or not number > above:
            bound = f"above {above:g}" if above > -inf else f"from {minimum:g} to {maximum:g}"
            self._wrong(key, f"expected a number {bound}, not {value}")
            return 1.0
        return number

    def _wrong(self, key: Path, message: str) -> None:
        self._errors.append(TruthError((*self.path, *key), message))
