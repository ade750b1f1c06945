"""Hand instruments of a run: those of the register that a person reads, found before anything begins."""

from __future__ import annotations

import ast
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hil.documents.findings import Findings
from hil.documents.suggest import did_you_mean
from hil.executive.setup.inputs import Inputs
from hil.model.bench import BenchSpec, InstrumentSpec
from hil.model.errors import ConfigurationError, Finding
from hil.registers.instruments import INSTRUMENTS, RegisteredInstrument, file_problem, load_instruments

__all__ = ["HandInstrument", "hand_instruments"]

_ASKS = "measure"
_WHO = "operator"


@dataclass(frozen=True, slots=True, kw_only=True)
class HandInstrument:
    """An instrument that a person reads.

    Attributes:
        spec: the instrument with the calibration of its register entry, under its name in the register.
        label: what a person finds on it, such as `DMM-017, Keysight 34465A, serial MY1`.
    """

    spec: InstrumentSpec
    label: str


def hand_instruments(inputs: Inputs, fixtures: Path, bench: BenchSpec) -> Mapping[str, HandInstrument]:
    """Return the instruments named by `operator.measure(..., instrument="…")` in plans and fixtures.

    They must be known before the first step, because register and certificates are frozen then. So the name is a
    literal in the call, or a constant of its module.

    Args:
        inputs: the sources, and what is frozen.
        fixtures: the folder of the register and its certificates.
        bench: the bench, whose instruments must have different names.

    Raises:
        ConfigurationError: with every name that is not in the register, and every missing certificate.
    """
    named = [each for path in inputs.below(inputs.root) for each in _named(path, inputs)]
    if not named:
        return {}
    wrong = Findings()
    known = load_instruments(fixtures / INSTRUMENTS, inputs.shown(fixtures / INSTRUMENTS), wrong)
    findings = list(wrong)
    own = {item.name: item for item in bench.instruments}
    for place, name in named:
        if problem := _problem(name, known, own, fixtures, inputs):
            findings.append(Finding(inputs.shown(place.path), place.line, place.column, problem))
    if findings:
        raise ConfigurationError(tuple(findings))
    return {name: _hand(known[name]) for _, name in named}


@dataclass(frozen=True, slots=True)
class _Place:
    path: Path
    line: int
    column: int


def _named(path: Path, inputs: Inputs) -> Iterator[tuple[_Place, str]]:
    """Yield the instruments that a module names, each with its place."""
    data = inputs.snapshot.take(path)
    if f"{_ASKS}(".encode() not in data:
        return
    tree = None
    with suppress(SyntaxError, ValueError):  # its import reports it
        tree = ast.parse(data)
    if tree is None:
        return
    constants = dict(_constants(tree.body))
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and _is_asked(node.func):
            for keyword in node.keywords:
                value = keyword.value
                name = constants.get(value.id) if isinstance(value, ast.Name) else getattr(value, "value", None)
                if keyword.arg == "instrument" and isinstance(name, str):
                    yield _Place(path, value.lineno, value.col_offset + 1), name


def _constants(body: Iterable[ast.stmt]) -> Iterator[tuple[str, str]]:
    for node in body:
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            yield from ((each.id, node.value.value) for each in node.targets if isinstance(each, ast.Name))


def _is_asked(function: ast.expr) -> bool:
    """Return whether this is `operator.measure`, including that of an operator kept by a fixture."""
    if not isinstance(function, ast.Attribute) or function.attr != _ASKS:
        return False
    who = function.value
    name = who.id if isinstance(who, ast.Name) else who.attr if isinstance(who, ast.Attribute) else ""
    return name.strip("_") == _WHO


def _problem(
    name: str,
    known: Mapping[str, RegisteredInstrument],
    own: Mapping[str, InstrumentSpec],
    fixtures: Path,
    inputs: Inputs,
) -> str:
    register = inputs.shown(fixtures / INSTRUMENTS)
    if name not in known:
        return f"there is no instrument '{name}' in {register}{did_you_mean(name, known)}"
    if name in own:
        return f"'{name}' is an instrument of the bench as well; read it by its role, or give one of them another name"
    latest = known[name].latest
    problem = file_problem(fixtures, latest) if latest else ""
    return f"{name}, {register}: {problem}" if problem else ""


def _hand(entry: RegisteredInstrument) -> HandInstrument:
    return HandInstrument(
        spec=InstrumentSpec(name=entry.id, driver="", calibration=entry.calibration, register=entry.id),
        label=f"{entry.id}, {entry.maker} {entry.model}, serial {entry.serial}",
    )
