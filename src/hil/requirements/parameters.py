"""The parameters of a plan: numbers and words that cases use and that are no limits."""

from __future__ import annotations

import keyword
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import MappingProxyType

from hil.documents.canonical import digest
from hil.documents.findings import Findings
from hil.documents.reader import MappingReader, read_document
from hil.documents.suggest import did_you_mean
from hil.model.errors import HilError, Refused
from hil.requirements.allowed import Allowed, read_allowed
from hil.requirements.layout import PARAMETERS, shown
from hil.requirements.units import UnitError, check_unit, compatible, convert, is_plain

__all__ = ["Ambiguous", "Parameter", "Parameters", "UnknownParameter", "load_parameters"]

_SCHEMA = "hil/parameters/1"

_Single = float | str

_TAKEN = ("s", "V", "A", "deg", "deg/s", "degC", "K", "Hz", "ohm", "uT", "W", "W.h", "A.h", "m", "kg", "1")
"""Units that roles, `record` and formulas take: what somebody wants a parameter in that has another one."""


class UnknownParameter(HilError, AttributeError):
    """A parameter that the plan does not have."""


class Ambiguous(HilError):
    """A parameter whose number means something else in the unit that a reader would expect.

    Not an AttributeError: nobody who looks whether there is a parameter may be told that there is none.
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
    def problem(self) -> str:
        """What the plan has against the value, empty where it is allowed."""
        values = self.value if isinstance(self.value, tuple) else (self.value,)
        if self.allowed.holds([value for value in values if not isinstance(value, str)]):
            return ""
        return f"parameter '{self.name}' is {self.shown}, allowed is {self.allowed.shown(self.unit)}"

    @property
    def deviation(self) -> str:
        """How it differs from the plan, empty where it does not."""
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
    """The parameters of one plan, each an attribute of its name; nobody can change them.

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
        raise HilError(f"parameter '{name}' cannot be taken away by a case", "see hil run --parameter")

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._parameters]

    def in_unit(self, name: str, unit: str) -> float | tuple[float, ...]:
        """Return a parameter's number, or numbers, in this unit.

        Raises:
            UnknownParameter: where the plan does not have it.
            HilError: where it is a text, or its unit does not convert.
        """
        parameter = self._parameter(name)
        if not parameter.unit:
            raise HilError(f"parameter '{name}' is a text and has no unit", f"read it as parameters.{name}")
        values = parameter.value if isinstance(parameter.value, tuple) else (parameter.value,)
        converted = tuple(convert(float(value), parameter.unit, unit) for value in values)
        return converted if isinstance(parameter.value, tuple) else converted[0]

    def problem_with(self, name: str) -> str:
        """Return why `parameters.name` cannot be read, empty where it can."""
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
            UnknownParameter: where the plan does not have it.
            Refused: where the plan does not allow the value.
            HilError: where the text is no value for it.
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

    def _parameter(self, name: str) -> Parameter:
        if name not in self._parameters:
            known = ", ".join(self._parameters) or "none"
            raise UnknownParameter(
                f"the plan has no parameter '{name}'{did_you_mean(name, self._parameters)}", f"it has {known}"
            )
        return self._parameters[name]


def load_parameters(root: Path, plan: Path) -> Parameters:
    """Return the parameters of a plan; none where it has no `parameters.yaml`.

    Raises:
        ConfigurationError: with everything that is wrong with the file.
    """
    file = plan / PARAMETERS
    if not file.exists():
        return Parameters()
    findings = Findings()
    reader = read_document(file, shown(file, root), findings, schema=_SCHEMA)
    found: dict[str, Parameter] = {}
    if reader is not None:
        for entry in reader.children("parameters", required=True):
            parameter = _read(entry)
            if parameter.name in found:
                findings.add(entry.place("name"), f"duplicate parameter '{parameter.name}'")
            found[parameter.name] = parameter
        reader.done()
    findings.raise_if_any()
    return Parameters(tuple(found.values()))


def _read(entry: MappingReader) -> Parameter:
    before = len(entry.findings)
    name = entry.text("name", pattern="[a-z][a-z0-9_]*")
    if hasattr(Parameters, name) or keyword.iskeyword(name):
        entry.findings.add(entry.place("name"), f"'{name}' cannot be the name of a parameter, choose another")
    unit = entry.text("unit", "")
    wrong = check_unit(unit) if unit else None
    if wrong:
        entry.findings.add(entry.place("unit"), wrong)
    if entry.has("value") == entry.has("values"):
        entry.findings.add(entry.node, f"parameter '{name}' needs either value or values")
    value: _Single | tuple[_Single, ...]
    if entry.has("values"):
        value = _list(entry, number=bool(unit))
    else:
        value = entry.number("value", 0.0) if unit else entry.text("value", "")
    found = Parameter(
        name=name,
        value=value,
        unit=unit,
        text=entry.text("text", ""),
        allowed=read_allowed(entry, number=bool(unit)),
    )
    if len(entry.findings) == before and found.problem:
        entry.findings.add(entry.place("values" if entry.has("values") else "value"), found.problem)
    entry.done()
    return found


def _list(entry: MappingReader, *, number: bool) -> tuple[_Single, ...]:
    texts = entry.texts("values")
    if not number:
        return texts
    try:
        return tuple(_number(text) for text in texts)
    except ValueError:
        entry.findings.add(entry.place("values"), "values with a unit must be decimal numbers in quotes")
        return ()


def _value_of(before: Parameter, text: str) -> _Single | tuple[_Single, ...]:
    parts = [part.strip() for part in text.split(",")] if isinstance(before.value, tuple) else [text.strip()]
    try:
        values = tuple(_with_unit(part, before.unit) if before.unit else part for part in parts)
    except ValueError as error:
        raise HilError(
            f"'{text}' is no value for parameter '{before.name}'", f"give a decimal number in {before.unit}"
        ) from error
    except UnitError as error:
        raise HilError(f"'{text}' is no value for parameter '{before.name}': {error.message}", error.hint) from error
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
