"""Frozen facts by which verdicts are judged: catalogue, calibration, date."""

import hashlib
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from itertools import takewhile
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from hil.documents.canonical import JsonError, canonical, parse_strict
from hil.evidence.durable import read_plain, write_whole
from hil.evidence.events import Results
from hil.evidence.events.codec import convert
from hil.evidence.folder import CALIBRATION, CATALOGUE, DUT, REGISTERS, SOFTWARE
from hil.evidence.journal.clocks import clock_doubts
from hil.evidence.journal.reader import JournalReading
from hil.evidence.results.software import FrozenSoftware
from hil.model.bench import Calibration as Calibrated
from hil.model.errors import EvidenceError, Finding
from hil.requirements.requirement import Decision, Limit, Requirement

__all__ = [
    "Calibration",
    "Catalogue",
    "DamagedFile",
    "Facts",
    "FrozenCalibration",
    "FrozenLimit",
    "FrozenRange",
    "FrozenRequirement",
    "entries_of",
    "facts_of",
    "freeze_calibration",
    "freeze_catalogue",
    "frozen_calibration",
    "read_json",
]


class FrozenLimit(msgspec.Struct, frozen=True, kw_only=True):
    """A limit as it was frozen; its fields are those of `Limit`."""

    parameter: str
    of: tuple[str, ...] = ()
    unit: str = ""
    minimum: str | None = msgspec.field(default=None, name="min")
    maximum: str | None = msgspec.field(default=None, name="max")
    equals: str | None = None
    decision: Decision = Decision.GUARDED
    min_tur: str | None = None

    @property
    def limit(self) -> Limit:
        """The limit by which values are judged."""
        return Limit(**msgspec.structs.asdict(self))


class FrozenRequirement(msgspec.Struct, frozen=True, kw_only=True):
    """A requirement as it was frozen; what is None is not recorded."""

    rev: int | None = None
    text: str | None = None
    kind: str | None = None
    method: str | None = None
    source: str | None = None
    plan: str = ""
    parents: tuple[str, ...] = ()
    level: str = ""
    stage: str = ""
    over: Mapping[str, tuple[str, ...]] = {}
    fingerprint: str = ""
    withdrawn: bool = False
    records: Mapping[str, Any] | None = None
    limits: tuple[FrozenLimit, ...] = ()
    witness: str = ""
    independent: bool = False


class FrozenRange(msgspec.Struct, frozen=True, kw_only=True):
    """One line of a certificate as it was frozen; its fields are those of `CalibratedRange`, with all digits."""

    quantity: str
    unit: str
    low: str = msgspec.field(name="from")
    high: str = msgspec.field(name="to")
    absolute: str
    relative: str
    k: str


class FrozenCalibration(msgspec.Struct, frozen=True, kw_only=True):
    """The calibration record of one instrument as it was frozen; empty fields are unknown.

    Attributes:
        certificate: its certificate's file, empty without one: below the bench's folder, or with `register` below the
            registers of the package.
        due: the last day on which it is valid, ISO 8601.
        dut: whether the instrument is a device under test.
        sha256: SHA-256 of the certificate's file as it was frozen; None before format 2.
        size: its size in bytes; None before format 2.
        ranges: the uncertainty by quantity and range; None before format 2.
        register: the instrument's name in the register of instruments.
        serial: its serial number there.
        number: the certificate's number.
        laboratory: who calibrated.
        date: the day of calibration, ISO 8601; it is valid from this day on.
        as_left: how the laboratory returned the instrument.
    """

    certificate: str = ""
    due: str = ""
    dut: bool = False
    sha256: str | None = None
    size: int | None = None
    ranges: tuple[FrozenRange, ...] | None = None
    register: str = ""
    serial: str = ""
    number: str = ""
    laboratory: str = ""
    date: str = ""
    as_left: str = ""

    def problems(self, first: str, last: str) -> Iterator[str]:
        """Yield why a certificate does not cover measurements from one day to another, each to follow a name.

        It is valid from its date to its due date, both included. A record before format 2 has a due date only.

        Args:
            first: the first day of use, ISO 8601, or a moment in it.
            last: the last day of use, or a moment in it.
        """
        if not self.due:
            yield "has no calibration record"
            return
        if self.size == 0:
            yield f"has an empty certificate, {self.certificate}"
        if self.ranges == ():
            yield f"has a certificate without any range, {self.certificate}"
        if self.as_left == "out of tolerance":
            yield f"was returned out of tolerance by its calibration on {self.date}"
        if first[:10] < self.date:
            yield f"was used before its calibration: calibrated {self.date}, used {first[:10]}"
        if last[:10] > self.due:
            yield f"was out of calibration: due {self.due}, used {last[:10]}"


Catalogue = Mapping[str, FrozenRequirement]
"""The frozen requirements by id."""

Calibration = Mapping[str, FrozenCalibration]
"""The frozen calibration records by instrument."""


class DamagedFile(EvidenceError):
    """A file of the package that does not say what it must; `finding` has its path in the package."""

    def __init__(self, path: Path, finding: Finding) -> None:
        super().__init__(f"{path}: {finding.message}", "see hil verify")
        self.finding = finding


@dataclass(frozen=True, slots=True, kw_only=True)
class Facts:
    """The facts from which results are derived, in addition to the events.

    Attributes:
        catalogue: the frozen requirements.
        calibration: the frozen calibration records.
        date: the day on which calibrations must still be valid, ISO 8601; the run's last one.
        begun: the day on which they must already be valid, the run's first one; empty if it is not known.
        software: product, workspace and interpreter.
        dut_simulated: whether the device under test exists in simulated benches only.
        clock: why the times of the run cannot be believed, a sentence each.
    """

    catalogue: Catalogue
    calibration: Calibration = field(default_factory=dict)
    date: str = ""
    begun: str = ""
    software: FrozenSoftware = field(default_factory=FrozenSoftware)
    dut_simulated: bool = False
    clock: tuple[str, ...] = ()


def entries_of(requirements: Iterable[Requirement]) -> dict[str, FrozenRequirement]:
    """Return requirements in the form that `freeze_catalogue` takes."""
    return {item.id: _entry(item) for item in requirements}


def freeze_catalogue(folder: Path, requirements: Catalogue) -> str:
    """Write the requirements as they stand into the package; return the SHA-256 that the `run` event names.

    Args:
        folder: the run's folder.
        requirements: as returned by `entries_of`.
    """
    return _freeze(folder / CATALOGUE, {"format": 1, "requirements": requirements})


def frozen_calibration(folder: Path, record: Calibrated | None, *, dut: bool, register: str) -> FrozenCalibration:
    """Return the record of an instrument, with hash and size of its frozen certificate.

    Args:
        folder: the run's folder.
        record: the record in the bench file, or in the register of instruments; None if it is not calibrated.
        dut: whether the instrument is a device under test.
        register: the instrument's name in the register, empty if the bench file has the record.

    Raises:
        OSError: if the certificate cannot be read.
    """
    if record is None:
        return FrozenCalibration(dut=dut, register=register)
    registered = record.registered
    data = read_plain(folder / (REGISTERS if registered else "data/bench") / record.certificate)
    found = FrozenCalibration(
        certificate=record.certificate,
        due=record.due,
        dut=dut,
        sha256=hashlib.sha256(data).hexdigest(),
        size=len(data),
        ranges=tuple(
            FrozenRange(
                quantity=each.quantity,
                unit=each.unit,
                low=repr(each.low),
                high=repr(each.high),
                absolute=repr(each.absolute),
                relative=repr(each.relative),
                k=repr(each.k),
            )
            for each in record.ranges
        ),
    )
    if registered is None:
        return found
    return msgspec.structs.replace(
        found,
        register=registered.id,
        serial=registered.serial,
        number=registered.number,
        laboratory=registered.laboratory,
        date=registered.date,
        as_left=registered.as_left,
    )


def freeze_calibration(folder: Path, instruments: Calibration) -> str:
    """Write every instrument's calibration record into the package; return the SHA-256."""
    return _freeze(folder / CALIBRATION, {"format": 2, "instruments": instruments})


def facts_of(folder: Path, reading: JournalReading) -> Facts:
    """Return the facts by which the results of this run are derived.

    Of a run that ended before something was frozen, that is missing, and it can close no requirement.

    Raises:
        DamagedFile: if a frozen file cannot be read.
    """
    before = tuple(takewhile(lambda line: not isinstance(line.event, Results), reading.lines))
    days = [day for line in before if (day := str(line.wall.get("utc", ""))[:10])]
    return Facts(
        catalogue=_frozen(folder, CATALOGUE, "requirements", FrozenRequirement),
        calibration=_frozen(folder, CALIBRATION, "instruments", FrozenCalibration),
        date=max(days, default=""),
        begun=min(days, default=""),
        software=_whole(folder, SOFTWARE, FrozenSoftware),
        dut_simulated=_whole(folder, DUT, _FrozenDut).simulated,
        clock=clock_doubts(before),
    )


def read_json(path: Path) -> Any:  # noqa: ANN401 - JSON holds what it holds
    """Return the content of a JSON file of the package.

    Raises:
        EvidenceError: if it is missing or is not strict JSON.
    """
    try:
        return parse_strict(read_plain(path))
    except OSError as error:
        raise EvidenceError(f"{path}: cannot be read: {error.strerror}", "see hil verify") from error
    except JsonError as error:
        raise EvidenceError(f"{path}: {error.message}", "see hil verify") from error


def _entry(item: Requirement) -> FrozenRequirement:
    return FrozenRequirement(
        rev=item.rev,
        text=item.text,
        kind=item.kind,
        method=item.method,
        source=item.source,
        plan=item.plan,
        parents=item.parents,
        level=item.level,
        stage=item.stage,
        over=item.over,
        fingerprint=item.fingerprint,
        withdrawn=item.withdrawn,
        witness=item.witness,
        independent=item.independent,
        records=None if item.records is None else asdict(item.records),
        limits=msgspec.convert(item.limits, tuple[FrozenLimit, ...], from_attributes=True),
    )


def _freeze(path: Path, value: Mapping[str, Any]) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    data = canonical(msgspec.to_builtins(value))
    write_whole(path, data)
    return hashlib.sha256(data).hexdigest()


def _object(value: object) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise JsonError("it must be an object")
    return value


def _objects(value: object, key: str) -> dict[str, dict[str, Any]]:
    entries = value.get(key) if isinstance(value, dict) else None
    if not isinstance(entries, dict) or not all(isinstance(entry, dict) for entry in entries.values()):
        raise JsonError(f"field '{key}' must be an object of objects")
    return entries


_Entry = TypeVar("_Entry", bound=msgspec.Struct)
_KEPT = 4
"""Size of the cache of frozen files: catalogue and calibration of two packages."""


class _FrozenDut(msgspec.Struct, frozen=True, kw_only=True):
    simulated: bool = False


def _whole(folder: Path, file: str, kind: type[_Entry]) -> _Entry:
    """Return a frozen file as a type that takes what it needs of it; all defaults if there is none."""
    path = folder / file
    if not path.exists():
        return kind()
    try:
        return convert(_object(parse_strict(read_plain(path))), kind, file)
    except JsonError as error:
        raise DamagedFile(path, Finding(file, error.line, error.column, error.bare)) from error
    except OSError as error:
        raise DamagedFile(path, Finding(file, 0, 0, f"it cannot be read: {error.strerror}")) from error


def _frozen(folder: Path, file: str, key: str, kind: type[_Entry]) -> Mapping[str, _Entry]:
    path = folder / file
    if not path.exists():
        return {}
    try:
        return _entries(read_plain(path), key, kind)
    except JsonError as error:
        raise DamagedFile(path, Finding(file, error.line, error.column, error.bare)) from error
    except OSError as error:
        raise DamagedFile(path, Finding(file, 0, 0, f"it cannot be read: {error.strerror}")) from error


@lru_cache(maxsize=_KEPT)
def _entries(data: bytes, key: str, kind: type[_Entry]) -> Mapping[str, _Entry]:
    """Return the entries of a frozen file; cached, as a verification needs those of one package several times."""
    return {name: convert(fields, kind, f"{key}.{name}") for name, fields in _objects(parse_strict(data), key).items()}
