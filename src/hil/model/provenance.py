"""Provenance of a value: what was read, recorded or answered, and how it was processed."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from numbers import Real
from threading import local
from types import TracebackType
from typing import Any, Self

from hil.model.errors import Misused

__all__ = [
    "BY_ITSELF",
    "TEMPERATURES",
    "TIMES_ZERO",
    "Count",
    "Number",
    "Provenance",
    "RecordedUnit",
    "Word",
    "answer_to",
    "merged",
    "provenance_of",
    "provenances_in",
    "stamped",
    "within_library",
]

Issued = tuple[float, str, float | None, float, str]
"""The numbers of one figure: value, unit, uncertainty, degrees of freedom, status."""


TEMPERATURES = frozenset({"degC", "°C", "degreeC"})
"""Units with an offset, whose differences are in K."""


@dataclass(frozen=True, slots=True)
class RecordedUnit:
    """The unit in which values were recorded, valid while numbers are only added or subtracted.

    Attributes:
        text: the unit.
        same: returns whether two units are equivalent; its third argument is true for differences.
        difference: whether something was added or subtracted, so that degC may have become K.
    """

    text: str
    same: Callable[[str, str, bool], bool]
    difference: bool = False

    def require(self, stated: str, *, difference: bool = False) -> None:
        """Refuse a different unit for these values.

        Args:
            stated: the unit stated by the plan.
            difference: whether only their differences matter.

        Raises:
            Misused: if it is not the unit in which they were recorded.
        """
        if not self.same(self.text, stated, difference or self.difference):
            known = f"{self.text}, or K if it is a difference" if self.text in TEMPERATURES else self.text
            raise Misused(
                f"the values are in {self.text} as recorded, not in {stated}",
                f"state {known}; to convert them, multiply them first",
            )


@dataclass(frozen=True, slots=True)
class Provenance:
    """Provenance of a value.

    The executive assigns it to readings, recordings and answers; functions of `hil.analysis` propagate it.

    Attributes:
        instruments: names of the instruments that were read.
        sources: what was read, recorded, answered or given, such as `supply.load.current`.
        by: processing steps, such as `resistance`.
        unproven: why it proves nothing, one sentence each.
        uncovered: what no certificate covers, one sentence each.
        doubts: why the data cannot be trusted, one sentence each; a check of them is INCONCLUSIVE.
        numbers: the plan's own numbers in the computation, at most `MOST_NUMBERS`.
        issued: the numbers of the figure that it was issued for; a modified copy of that figure has others.
        recorded: the unit of the samples and numbers of a recording, None if not or no longer known.
    """

    instruments: tuple[str, ...] = ()
    sources: tuple[str, ...] = ()
    by: tuple[str, ...] = ()
    unproven: tuple[str, ...] = ()
    uncovered: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    numbers: tuple[float, ...] = ()
    issued: Issued | None = None
    recorded: RecordedUnit | None = None

    @property
    def measured(self) -> bool:
        """Whether it includes an observation by an instrument or a person."""
        return bool(self.instruments) or any(source.startswith(_ANSWER) for source in self.sources)

    def through(self, name: str) -> Provenance:
        """Return the provenance of the result of a function of this name."""
        return self if name in self.by else replace(self, by=(*self.by, name))

    def without_unit(self) -> Provenance:
        """Return the provenance of a result in an unknown unit, such as a product."""
        return self if self.recorded is None else replace(self, recorded=None)

    def of_difference(self) -> Provenance:
        """Return the provenance of the result of an addition or subtraction."""
        if self.recorded is None or self.recorded.difference:
            return self
        return replace(self, recorded=replace(self.recorded, difference=True))

    def with_number(self, number: float) -> Provenance:
        """Return the provenance of a computation with one of the plan's own numbers."""
        if not number or number in self.numbers or math.isnan(number):
            return self
        if len(self.numbers) == MOST_NUMBERS:
            return self.but(_TOO_MANY)
        return replace(self, numbers=(*self.numbers, float(number)))

    def with_numbers(self, *operands: object) -> Provenance:
        """Return the provenance of a computation with these operands, adding those without provenance."""
        made = self
        for each in operands:
            if isinstance(each, Real) and not hasattr(each, "provenance"):
                made = made.with_number(float(each))
        return made

    @property
    def told(self) -> tuple[str, ...]:
        """Sources, processing and numbers of the plan, as reported with a check."""
        if not self.numbers:
            return (*self.sources, *self.by)
        named = ", ".join(f"{each:.12g}" for each in self.numbers[:_MOST_TOLD])
        more = " and more" if len(self.numbers) > _MOST_TOLD else ""
        return (*self.sources, *self.by, f"numbers of the plan: {named}{more}")

    def but(self, *sentences: str) -> Provenance:
        """Return it with further reasons why it proves nothing."""
        return replace(self, unproven=_union(self.unproven, sentences))


_ANSWER = "answer to "
_MOST_TOLD = 8
MOST_NUMBERS = 64
_TOO_MANY = f"it was computed with more than {MOST_NUMBERS} different numbers of the plan, more than anybody reads"


def answer_to(question: str) -> str:
    """Return the source name of a person's answer."""
    return f"{_ANSWER}{question}"


def merged(*several: Provenance | None) -> Provenance | None:
    """Return the combined provenance of several things, None if none has one."""
    found: Provenance | None = None
    for each in several:
        if each is not None and each is not found:
            found = each if found is None else _both(found, each)
    return found


@lru_cache(maxsize=4096)
def _both(one: Provenance, other: Provenance) -> Provenance:
    numbers = tuple(dict.fromkeys((*one.numbers, *other.numbers)))
    too_many = (_TOO_MANY,) if len(numbers) > MOST_NUMBERS else ()
    return Provenance(
        instruments=tuple(sorted({*one.instruments, *other.instruments})),
        sources=_union(one.sources, other.sources),
        by=_union(one.by, other.by),
        unproven=_union(_union(one.unproven, other.unproven), too_many),
        uncovered=_union(one.uncovered, other.uncovered),
        doubts=_union(one.doubts, other.doubts),
        numbers=numbers[:MOST_NUMBERS],
        recorded=_common_unit(one, other),
    )


def _common_unit(one: Provenance, other: Provenance) -> RecordedUnit | None:
    """Return the common recorded unit of two, if any; the plan's parameters adapt to any unit."""
    first, second = one.recorded, other.recorded
    if first is None or second is None:
        known, unknown = (second, one) if first is None else (first, other)
        return None if unknown.instruments else known
    if first.text != second.text:
        return None
    return first if first.difference else second


def _union(one: tuple[str, ...], other: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(dict.fromkeys((*one, *other)))


class _Library(local):
    depth = 0


_LIBRARY = _Library()


class within_library:  # noqa: N801 - used as a statement
    """Context in which numbers and arrays are plain: the library function itself assigns the result's provenance."""

    def __enter__(self) -> Self:
        _LIBRARY.depth += 1
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        _LIBRARY.depth -= 1

    @staticmethod
    def active() -> bool:
        """Return whether a library function is running in this thread."""
        return _LIBRARY.depth > 0


_ARITHMETIC = "arithmetic of the plan"
_VANISHING = frozenset({"__mul__", "__pow__"})
_CANCELLING = frozenset({"__sub__", "__rsub__", "__truediv__", "__rtruediv__"})
_SHIFTING = frozenset({"__add__", "__sub__", "__rsub__"})
_SAME_UNIT = frozenset({"__neg__", "__abs__"})
TIMES_ZERO = "what was read was multiplied by zero, so that nothing of it is left"
BY_ITSELF = "what was read was subtracted from itself, or divided by itself, so that nothing of it is left"


def _arithmetic(name: str) -> Callable[..., Any]:
    operation = getattr(float, name)

    def compute(self: Number, *others: object) -> object:
        result = operation(self, *others)
        if result is NotImplemented or type(result) is not float or _LIBRARY.depth:
            return result
        found = merged(self.provenance, *(getattr(each, "provenance", None) for each in others))
        made = (found or self.provenance).through(_ARITHMETIC).with_numbers(*others)
        if name not in _SAME_UNIT:
            made = made.of_difference() if name in _SHIFTING else made.without_unit()
        if name in _VANISHING and others == (0,):
            made = made.but(TIMES_ZERO)
        elif name in _CANCELLING and others[0] is self:
            made = made.but(BY_ITSELF)
        return Number(result, made)

    compute.__name__ = name
    return compute


class Number(float):
    """A number from a recording or the library, with a provenance that arithmetic preserves."""

    __slots__ = ("provenance",)

    provenance: Provenance

    def __new__(cls, value: float, provenance: Provenance) -> Self:
        """Return a number with its provenance."""
        made = super().__new__(cls, value)
        made.provenance = provenance
        return made

    def __getnewargs__(self) -> tuple[float, Provenance]:  # type: ignore[override]  # a copy needs both
        return float(self), self.provenance

    __add__ = __radd__ = _arithmetic("__add__")
    __mul__ = __rmul__ = _arithmetic("__mul__")
    __sub__ = _arithmetic("__sub__")
    __rsub__ = _arithmetic("__rsub__")
    __truediv__ = _arithmetic("__truediv__")
    __rtruediv__ = _arithmetic("__rtruediv__")
    __pow__ = _arithmetic("__pow__")
    __neg__ = _arithmetic("__neg__")
    __abs__ = _arithmetic("__abs__")


class Count(int):
    """An integer with its provenance; results of arithmetic are bare numbers."""

    provenance: Provenance

    def __new__(cls, value: int, provenance: Provenance) -> Self:
        """Return a whole number with its provenance."""
        made = super().__new__(cls, value)
        made.provenance = provenance
        return made

    def __getnewargs__(self) -> tuple[int, Provenance]:  # type: ignore[override]  # a copy needs both
        return int(self), self.provenance


class Word(str):
    """A text chosen by a person or reported by a device, with its provenance."""

    __slots__ = ("provenance",)

    provenance: Provenance

    def __new__(cls, text: str, provenance: Provenance) -> Self:
        """Return a word with its provenance."""
        made = super().__new__(cls, text)
        made.provenance = provenance
        return made

    def __getnewargs__(self) -> tuple[str, Provenance]:  # type: ignore[override]  # a copy needs both
        return str(self), self.provenance


_PLAIN = frozenset({float, int, str, bool, bytes, type(None)})


def provenance_of(*things: object) -> Provenance | None:
    """Return the combined provenance of everything in these things, nested in lists, mappings and dataclasses."""
    return merged(*provenances_in(*things))


def provenances_in(*things: object) -> tuple[Provenance, ...]:
    """Return every provenance in these things, without duplicates."""
    objects = {id(each): each for each in _found(things)}  # the samples of a list share one, which is slow to hash
    return tuple(dict.fromkeys(objects.values()))


def _found(thing: object) -> Iterator[Provenance]:
    if type(thing) in _PLAIN:
        return
    own = getattr(thing, "provenance", None)
    if isinstance(own, Provenance):
        yield replace(own, issued=None).but(*getattr(thing, "replaced", ())) if own.issued else own
    elif isinstance(thing, Mapping):
        for each in thing.values():
            yield from _found(each)
    elif isinstance(thing, tuple | list | set | frozenset):
        for each in thing:
            yield from _found(each)
    elif is_dataclass(thing) and not isinstance(thing, type):
        written = getattr(thing, "written_by_hand", "")
        if written:
            yield Provenance(unproven=(f"the plan itself wrote {written}, which stands behind it",))
            return
        for field in fields(thing):
            yield from _found(getattr(thing, field.name, None))


def stamped(thing: Any, provenance: Provenance, arrays: Callable[[Any, Provenance], Any] | None = None) -> Any:
    """Return a copy of a result in which every number, word, figure and array has this provenance.

    Args:
        thing: the result of a role or a library function.
        provenance: provenance of everything in it.
        arrays: stamps other objects; without it they are left unchanged.
    """
    kind = type(thing)
    made = thing
    if isinstance(thing, float):
        made = Number(thing, provenance)
    elif kind in _SCALARS:
        made = _SCALARS[kind](thing, provenance)
    elif hasattr(thing, "with_provenance"):
        made = thing.with_provenance(provenance)
    elif isinstance(thing, tuple | list):
        items = [stamped(each, provenance, arrays) for each in thing]
        made = kind(*items) if hasattr(kind, "_fields") else kind(items)
    elif kind is dict:
        made = {name: stamped(each, provenance, arrays) for name, each in thing.items()}
    elif is_dataclass(thing) and not isinstance(thing, type):
        made = _stamped_fields(thing, provenance, arrays)
    elif arrays is not None:
        made = arrays(thing, provenance)
    return made


_SCALARS: dict[type, Callable[..., Any]] = {int: Count, Count: Count, str: Word, Word: Word}


def _stamped_fields(thing: Any, provenance: Provenance, arrays: Callable[[Any, Provenance], Any] | None) -> Any:
    made = copy.copy(thing)
    for field in fields(thing):
        if hasattr(thing, field.name):
            object.__setattr__(made, field.name, stamped(getattr(thing, field.name), provenance, arrays))
    return made
