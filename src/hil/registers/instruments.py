"""The register of instruments, `fixtures/instruments.yaml`: their identities and certificates."""

from __future__ import annotations

import hashlib
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from pathlib import Path
from typing import Annotated

from hil.clock.wall import is_date
from hil.documents.declared import read_document
from hil.documents.findings import Findings
from hil.documents.snapshot import read_once
from hil.documents.text import is_there
from hil.model.bench import CalibratedRange, Calibration, Registered
from hil.model.identity import Day
from hil.model.notation import NAMED, AnyText, ByName, Text, matching
from hil.model.notation import Path as Keys

__all__ = [
    "INSTRUMENTS",
    "AsFound",
    "AsLeft",
    "Certificate",
    "RegisteredInstrument",
    "file_problem",
    "load_instruments",
]

INSTRUMENTS = "instruments.yaml"
"""The file's name, in the folder of fixtures."""

_SCHEMA = "hil/instruments/1"
_Digest = Annotated[str, matching("[0-9a-f]{64}", "a SHA-256: 64 digits of 0-9 and a-f")]


class AsFound(StrEnum):
    """What the laboratory found before any adjustment."""

    IN_TOLERANCE = "in tolerance"
    OUT_OF_TOLERANCE = "out of tolerance"
    NOT_STATED = "not stated"


class AsLeft(StrEnum):
    """How the laboratory returned the instrument."""

    IN_TOLERANCE = "in tolerance"
    ADJUSTED = "adjusted"
    OUT_OF_TOLERANCE = "out of tolerance"

    @property
    def good(self) -> bool:
        """Whether the instrument was within its tolerance when it left the laboratory."""
        return self is not AsLeft.OUT_OF_TOLERANCE


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What one calibration certificate says.

    Attributes:
        number: the laboratory's number of it.
        laboratory: who calibrated.
        file: the certificate itself, below the folder of fixtures.
        sha256: SHA-256 of that file, in hexadecimal.
        date: the day of calibration; from this day on it counts.
        due: the last day on which it counts.
        as_found: what the laboratory found.
        as_left: how it returned the instrument.
        ranges: the uncertainty by quantity and range.
    """

    number: Text
    laboratory: Text
    file: Text
    sha256: _Digest
    date: Day
    due: Day
    as_found: AsFound
    as_left: AsLeft
    ranges: tuple[CalibratedRange, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class RegisteredInstrument:
    """One instrument of the register.

    Attributes:
        id: its name in the register, such as the number on its label.
        maker: who made it.
        model: the maker's name of it.
        serial: its serial number.
        title: what it is, in words.
        certificates: all known ones, the oldest first; none if it has never been calibrated.
    """

    id: str = field(default="", metadata=NAMED)
    maker: Text
    model: Text
    serial: Text
    title: AnyText = ""
    certificates: tuple[Certificate, ...] = ()

    @property
    def latest(self) -> Certificate | None:
        """The newest certificate."""
        return self.certificates[-1] if self.certificates else None

    @property
    def calibration(self) -> Calibration | None:
        """The newest certificate as a bench uses it, None if there is none."""
        newest = self.latest
        if newest is None:
            return None
        return Calibration(
            certificate=newest.file,
            due=newest.due,
            ranges=newest.ranges,
            registered=Registered(
                id=self.id,
                serial=self.serial,
                number=newest.number,
                laboratory=newest.laboratory,
                date=newest.date,
                sha256=newest.sha256,
                as_left=newest.as_left,
            ),
        )

    def certificate_on(self, day: str) -> Certificate | None:
        """Return the certificate that was the newest on a day, ISO 8601; None before the first."""
        return next((each for each in reversed(self.certificates) if each.date <= day), None)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Register:
    """The file of the register."""

    instruments: Annotated[tuple[RegisteredInstrument, ...], ByName()]


def load_instruments(path: Path, shown: str, findings: Findings) -> Mapping[str, RegisteredInstrument]:
    """Read the register and add what is wrong to the findings; the certificates' files are not opened.

    Args:
        path: the file; a workspace need not have one.
        shown: its path as shown to a person.
        findings: where all errors are noted.

    Returns:
        The instruments by their names in the register, none if there is no such file.
    """
    if not is_there(path):
        return {}
    document = read_document(path, shown, findings, _Register, schema=_SCHEMA)
    if document is None:
        return {}
    known: dict[tuple[str, str], str] = {}
    for item in document.model.instruments:
        at: Keys = ("instruments", item.id)
        who = (item.model.casefold(), item.serial.casefold())  # of one maker, however that is written
        if all(who) and known.setdefault(who, item.id) != item.id:
            findings.add(document.place((*at, "serial")), f"{item.id} is the same instrument as {known[who]}")
        for below, problem in (*_of_certificates(item), *_of_ranges(item)):
            findings.add(document.place((*at, "certificates", *below)), f"{item.id}: {problem}")
    return {item.id: item for item in document.model.instruments}


def _of_certificates(item: RegisteredInstrument) -> Iterator[tuple[Keys, str]]:
    numbers = Counter(each.number for each in item.certificates)
    before = ""
    for place, each in enumerate(item.certificates):
        for key, day in (("date", each.date), ("due", each.due)):
            if day and not is_date(day):
                yield (place, key), f"the date {day} does not exist"
        if each.due and each.due < each.date:
            yield (place, "due"), f"certificate {each.number} is due on {each.due}, before its date {each.date}"
        if each.number and numbers[each.number] > 1:
            yield (place, "number"), f"certificate {each.number} is there twice"
            numbers[each.number] = 0
        if each.date and each.date <= before:
            yield (place, "date"), f"certificate {each.number} of {each.date} stands after that of {before}; sort them"
        before = each.date or before


def _of_ranges(item: RegisteredInstrument) -> Iterator[tuple[Keys, str]]:
    for place, each in enumerate(item.certificates):
        for number, entry in enumerate(each.ranges):
            if entry.low > entry.high:
                span = f"the range begins at {entry.low:g} {entry.unit} and ends below, at {entry.high:g}"
                yield (place, "ranges", number), f"{span}; exchange from and to"


def file_problem(fixtures: Path, certificate: Certificate) -> str:
    """Return what is wrong with the file of a certificate, in a sentence; nothing if it is the one.

    Args:
        fixtures: the folder of fixtures, or a package's copy of it.
        certificate: what the register says.
    """
    named = f"the file {certificate.file} of certificate {certificate.number}"
    try:
        path = (fixtures / certificate.file).resolve()
        if not path.is_relative_to(fixtures.resolve()):
            return f"{named} is not below {fixtures.name}"
        data = read_once(fixtures / certificate.file)
    except FileNotFoundError:
        return f"{named} is missing"
    except (OSError, RuntimeError, ValueError) as error:  # a loop of links is a RuntimeError to some versions of Python
        return f"{named} cannot be read: {getattr(error, 'strerror', None) or 'its path leads nowhere'}"
    if not data:
        return f"{named} is empty"
    if hashlib.sha256(data).hexdigest() != certificate.sha256:
        return f"{named} has another SHA-256 than the register says"
    return ""
