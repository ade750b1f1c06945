"""The parameters of a plan: numbers and words that cases use and that are not limits."""

from __future__ import annotations

import keyword
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path as File
from types import MappingProxyType
from typing import Annotated

from hil.documents.canonical import digest
from hil.documents.declared import Document, read_document
from hil.documents.findings import Findings, shown
from hil.documents.suggest import did_you_mean
from hil.documents.text import is_there
from hil.model.errors import HilError, Refused
from hil.model.figure import Figure
from hil.model.notation import AnyText, Complaint, Flag, Number, Path, Text, read_number, slug, whole
from hil.model.provenance import Provenance, stamped
from hil.requirements.units import UnitError, check_unit, compatible, convert, is_plain

__all__ = ["PARAMETERS", "Allowed", "Ambiguous", "Parameter", "Parameters", "UnknownParameter", "load_parameters"]

_COUNT = whole(1)


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed:
    """What the numbers of one parameter may be; without anything, every number.

    Attributes:
        minimum: the lowest, in the parameter's unit; it is allowed itself.
        maximum: the highest; it is allowed itself.
        whole: whether it must be a whole number.
        rising: whether each number of a list is above the one before.
        count: how many a list holds; None for any number.
    """

    minimum: Number | None = field(default=None, metadata={"alias": "min"})
    maximum: Number | None = field(default=None, metadata={"alias": "max"})
    whole: Flag = False
    rising: Flag = False
    count: Annotated[int, _COUNT] | None = None

    def holds(self, numbers: Sequence[float]) -> bool:
        """Return whether these numbers are allowed, in the parameter's unit."""
        low = -math.inf if self.minimum is None else self.minimum
        high = math.inf if self.maximum is None else self.maximum
        return (
            all(low <= number <= high for number in numbers)
            and (not self.whole or all(number.is_integer() for number in numbers))
            and (not self.rising or all(one < other for one, other in pairwise(numbers)))
            and self.count in {None, len(numbers)}
        )

    def shown(self, unit: str) -> str:
        """Return what is allowed, for people: `a whole number from 1 to 10`."""
        suffix = "" if unit in {"", "1"} else f" {unit}"
        low, high = (None if each is None else f"{each:.15g}{suffix}" for each in (self.minimum, self.maximum))
        kind = "whole number" if self.whole else "number"
        what = f"a {kind}" if self.count is None else f"{self.count} {kind}s"
        order = ", each above the one before" if self.rising else ""
        if low is not None and high is not None:
            return f"{what} from {low} to {high}{order}"
        bounds = [text for text in (low and f"at least {low}", high and f"at most {high}") if text]
        return " ".join([what, *(f"of {text}" for text in bounds)]) + order


PARAMETERS = "parameters.yaml"
"""The file of a plan's parameters, in its folder."""

_SCHEMA = "hil/parameters/1"

_Single = float | str

_TAKEN = ("s", "V", "A", "deg", "deg/s", "degC", "K", "Hz", "ohm", "uT", "W", "W.h", "A.h", "m", "kg", "1")
"""Units that roles, `record` and formulas take: a parameter in another unit is wanted in one of these."""


class UnknownParameter(HilError, AttributeError):
    """A parameter that the plan does not have."""


class Ambiguous(HilError):
    """A parameter whose number differs in the unit that a reader would expect.

    Not an AttributeError: a check for the parameter's existence must not fail.
    """


@dataclass(frozen=True, slots=True, kw_only=True)
class Parameter:
    """One parameter; numbers are in its unit, words have none. `planned` is what the plan says where it was changed."""

    name: str
    value: _Single | tuple[_Single, ...]
    unit: str = ""
    text: str = ""
    planned: str = ""
    allowed: Allowed = field(default_factory=Allowed)

    @property
    def numbers(self) -> list[float]:
        """Its numbers, none of a text."""
        values = self.value if isinstance(self.value, tuple) else (self.value,)
        return [value for value in values if not isinstance(value, str)]

    @property
    def problem(self) -> str:
        """Why the plan does not allow the value, empty if it does."""
        told = f"parameter '{self.name}' is {self.shown}, allowed is {self.allowed.shown(self.unit)}"
        return "" if self.allowed.holds(self.numbers) else told

    @property
    def deviation(self) -> str:
        """How it differs from the plan, empty if it does not."""
        if self.planned in {"", self.shown}:
            return ""
        return f"parameter {self.name} is {self.shown} instead of {self.planned}"

    @property
    def shown(self) -> str:
        """The value with its unit, for people."""
        values = self.value if isinstance(self.value, tuple) else (self.value,)
        text = ", ".join(value if isinstance(value, str) else f"{value:.15g}" for value in values)
        return text if self.unit in {"", "1"} else f"{text} {self.unit}"


class Parameters:
    """The parameters of one plan, each an attribute of its name; they are read-only.

    A parameter with a unit is a float in that unit, one without is a text; lists are tuples of either. A unit that an
    SI unit is only a factor away from (cm, h, %) has to be named where the parameter is used: see `in_unit`.
    """

    __slots__ = ("_parameters",)

    _parameters: Mapping[str, Parameter]

    def __init__(self, parameters: tuple[Parameter, ...] = ()) -> None:
        found = MappingProxyType({parameter.name: parameter for parameter in parameters})
        object.__setattr__(self, "_parameters", found)

    def __getattr__(self, name: str) -> _Single | tuple[_Single, ...]:
        if name.startswith("_"):
            raise AttributeError(name)
        parameter = self._parameter(name)
        if not _is_plain(parameter):
            raise Ambiguous(_ambiguous(parameter))
        return parameter.value

    def __setattr__(self, name: str, value: object) -> None:
        raise HilError(f"parameter '{name}' cannot be changed by a case", "see hil run --parameter")

    def __delattr__(self, name: str) -> None:
        raise HilError(f"parameter '{name}' cannot be removed by a case", "see hil run --parameter")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._parameters]

    def in_unit(self, name: str, unit: str) -> float | tuple[float, ...]:
        """Return a parameter's number, or numbers, in this unit.

        Raises:
            UnknownParameter: if the plan does not have it.
            HilError: if it is a text, or its unit does not convert.
        """
        parameter = self._parameter(name)
        if not parameter.unit:
            raise HilError(f"parameter '{name}' is text and has no unit", f"read it as parameters.{name}")
        values = parameter.value if isinstance(parameter.value, tuple) else (parameter.value,)
        plain = tuple(convert(float(value), parameter.unit, unit) for value in values)
        converted: tuple[float, ...] = stamped(plain, Provenance(sources=(f"parameter {name}",)))
        return converted if isinstance(parameter.value, tuple) else converted[0]

    def figure(self, name: str, *, uncertainty: str = "") -> Figure:
        """Return a parameter as a figure for a function of `hil.analysis`, in its unit; its provenance names it.

        A result to which only parameters contributed closes nothing.

        Args:
            name: of a number.
            uncertainty: name of the parameter that holds its standard uncertainty, empty if there is none.

        Raises:
            UnknownParameter: if the plan does not have one of them.
            HilError: if one is not a single number, or their units do not convert.
        """
        parameter = self._parameter(name)
        value, known = self.in_unit(name, parameter.unit), None
        if uncertainty:
            known = self.in_unit(uncertainty, parameter.unit)
        if isinstance(value, tuple) or isinstance(known, tuple):
            raise HilError(f"parameter '{name}' as a figure: a list is not one number", "make it a parameter of one")
        figure = Figure(value=value, unit=parameter.unit, uncertainty=known)
        return figure.with_provenance(
            Provenance(sources=tuple(f"parameter {each}" for each in (name, uncertainty) if each))
        )

    def problem_with(self, name: str) -> str:
        """Return why `parameters.name` cannot be read, empty if it can."""
        if name in self._parameters:
            return "" if _is_plain(self._parameters[name]) else _ambiguous(self._parameters[name])
        if hasattr(type(self), name):
            return ""
        return f"the plan has no parameter '{name}'{did_you_mean(name, self._parameters)}"

    def override(self, name: str, text: str) -> Parameters:
        """Return parameters in which one has another value; it is noted as a deviation.

        Args:
            name: an existing parameter.
            text: the value as on the command line, in the parameter's unit or with one that converts to it; lists are
                separated by commas.

        Raises:
            UnknownParameter: if the plan does not have it.
            Refused: if the plan does not allow the value.
            HilError: if the text is not a value for it.
        """
        before = self._parameter(name)
        changed = replace(before, value=_value_of(before, text), planned=before.planned or before.shown)
        if changed.problem:
            raise Refused(changed.problem, f"the plan has {before.planned or before.shown}: change it within that")
        return Parameters(tuple(changed if item.name == name else item for item in self._parameters.values()))

    @property
    def digest(self) -> str:
        """SHA-256 over names, values and units."""
        return digest(
            {
                item.name: {
                    "value": list(item.value) if isinstance(item.value, tuple) else item.value,
                    "unit": item.unit,
                }
                for item in self._parameters.values()
            }
        )

    @property
    def deviations(self) -> tuple[str, ...]:
        """What differs from the plan, a sentence each."""
        return tuple(item.deviation for item in self._parameters.values() if item.deviation)

    def rows(self) -> tuple[Parameter, ...]:
        """Return every parameter in the order of the file."""
        return tuple(self._parameters.values())

    def facts(self) -> list[dict[str, str]]:
        """Return what a package stores of every parameter, in the order of the file."""
        return [
            {
                "name": row.name,
                "value": row.shown,
                "unit": row.unit,
                "text": row.text,
                "deviation": row.deviation,
            }
            for row in self.rows()
        ]

    def _parameter(self, name: str) -> Parameter:
        if name not in self._parameters:
            known = ", ".join(self._parameters) or "none"
            raise UnknownParameter(
                f"the plan has no parameter '{name}'{did_you_mean(name, self._parameters)}", f"it has {known}"
            )
        return self._parameters[name]


def load_parameters(root: File, plan: File) -> Parameters:
    """Return the parameters of a plan; none where it has no `parameters.yaml`.

    Raises:
        ConfigurationError: with all errors in the file.
    """
    file = plan / PARAMETERS
    if not is_there(file):
        return Parameters()
    findings = Findings()
    document = read_document(file, shown(file, root), findings, _File, schema=_SCHEMA)
    found: dict[str, Parameter] = {}
    for index, entry in enumerate(document.model.parameters if document else ()):
        if document is not None:
            parameter = _parameter(document, ("parameters", index), entry, findings)
            if entry.name and entry.name in found:
                findings.add(document.place(("parameters", index, "name")), f"duplicate parameter '{entry.name}'")
            found[entry.name] = parameter
    findings.raise_if_any()
    return Parameters(tuple(found.values()))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Entry(Allowed):
    """One entry of `parameters.yaml`: either a value or values, and what the plan allows them to be."""

    name: Annotated[str, slug("_")]
    value: AnyText | None = None
    values: tuple[Text, ...] | None = None
    unit: AnyText = ""
    text: AnyText = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class _File:
    """`parameters.yaml`."""

    parameters: tuple[_Entry, ...]


def _parameter(document: Document[_File], at: Path, entry: _Entry, findings: Findings) -> Parameter:
    """Return a parameter, and note contradictions between the keys of its entry."""
    before = len(findings)
    for key, message in _problems(document, at, entry):
        findings.add(document.place((*at, key) if key else at), message)
    key, value = "value" if entry.values is None else "values", _value(entry)
    if isinstance(value, Complaint):
        findings.add(document.place((*at, key)), f"parameters: {value}")
        value = 0.0
    allowed = Allowed(**{field.name: getattr(entry, field.name) for field in fields(Allowed)})
    found = Parameter(name=entry.name, value=value, unit=entry.unit, text=entry.text, allowed=allowed)
    if len(findings) == before and document.is_sound(at) and found.problem:
        findings.add(document.place((*at, key)), found.problem)
    return found


def _problems(document: Document[_File], at: Path, entry: _Entry) -> Iterator[tuple[str, str]]:
    """Yield contradictions between the keys of an entry: the key, and a sentence."""
    given = [key for key in ("min", "max", "whole", "rising", "count") if document.has((*at, key))]
    if hasattr(Parameters, entry.name) or keyword.iskeyword(entry.name):
        yield "name", f"'{entry.name}' cannot be the name of a parameter, choose another"
    wrong = check_unit(entry.unit) if entry.unit else None
    if wrong:
        yield "unit", wrong
    if document.has((*at, "value")) == document.has((*at, "values")):
        yield "", f"parameter '{entry.name}' needs either value or values"
    if given and not entry.unit:
        yield given[0], f"a text has no '{given[0]}', only a number with a unit has"
    for key in ("rising", "count"):
        if key in given and not document.has((*at, "values")):
            yield key, f"'{key}' applies to a list, and this parameter has no values"
    if entry.minimum is not None and entry.maximum is not None and entry.minimum > entry.maximum:
        yield "min", f"min {entry.minimum:.15g} is above max {entry.maximum:.15g}"


def _value(entry: _Entry) -> _Single | tuple[_Single, ...] | Complaint:
    """Return the value, or the values, in the unit where there is one."""
    if not entry.unit:
        return (entry.value or "") if entry.values is None else entry.values
    try:
        if entry.values is None:
            return read_number(entry.value or "0")
        return tuple(_number(text) for text in entry.values)
    except Complaint as complaint:
        return Complaint(f"'value' {complaint}, found '{entry.value}'")
    except ValueError:
        return Complaint("'values' with a unit must be decimal numbers in quotes")


def _value_of(before: Parameter, text: str) -> _Single | tuple[_Single, ...]:
    parts = [part.strip() for part in text.split(",")] if isinstance(before.value, tuple) else [text.strip()]
    try:
        values = tuple(_with_unit(part, before.unit) if before.unit else part for part in parts)
    except ValueError as error:
        raise HilError(
            f"'{text}' is not a value for parameter '{before.name}'", f"give a decimal number in {before.unit}"
        ) from error
    except UnitError as error:
        raise HilError(f"'{text}' is not a value for parameter '{before.name}': {error.message}", error.hint) from error
    if not all(part for part in parts):
        raise HilError(f"parameter '{before.name}' needs a value", f"it is {before.shown} in the plan")
    return values if isinstance(before.value, tuple) else values[0]


def _with_unit(text: str, unit: str) -> float:
    """Return a number that may name a unit of its own, in the parameter's; 12 digits where it was converted."""
    number, _, own = text.partition(" ")
    if not own.strip():
        return _number(number)
    return float(f"{convert(_number(number), own.strip(), unit):.12g}")


def _is_plain(parameter: Parameter) -> bool:
    return not parameter.unit or is_plain(parameter.unit)


def _ambiguous(parameter: Parameter) -> str:
    name, unit = parameter.name, parameter.unit
    wanted = next((plain for plain in _TAKEN if compatible(plain, unit)), unit)
    return f"parameter '{name}' is in {unit}, say in which unit you want it: parameters.in_unit('{name}', '{wanted}')"


def _number(text: str) -> float:
    number = float(text)
    if not math.isfinite(number) or "_" in text:
        raise ValueError(text)
    return number
