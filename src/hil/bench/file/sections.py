"""The sections of a bench file, each read into its data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TypeVar

from hil.bench.file.complaints import Located
from hil.clock.wall import is_date
from hil.documents.reader import MappingReader
from hil.model.bench import (
    Bus,
    CalibratedRange,
    Calibration,
    Clamp,
    InstrumentSpec,
    PeerSpec,
    PlantSpec,
    Position,
    Proof,
    Rating,
    ReducedLevel,
    SafeStep,
    SimulatedBench,
    UsbPort,
    Wire,
)
from hil.model.identity import Identity

__all__ = [
    "read_buses",
    "read_clamp",
    "read_instruments",
    "read_safe_step",
    "read_twin",
    "read_wire",
]

_DATE = r"\d{4}-(0[1-9]|1[0-2])-(0[1-9]|[12]\d|3[01])"
_EPOCH = rf"{_DATE}T([01]\d|2[0-3]):[0-5]\d:[0-5]\dZ"
_INSTANCE = "[a-z][a-z0-9_]*"

_Bounded = TypeVar("_Bounded", Clamp, Proof)


def read_buses(document: MappingReader, places: Located) -> tuple[Bus, ...]:
    """Read the I2C buses."""
    buses = []
    for name, reader in document.entries("buses"):
        bus = Bus(
            name=name.text,
            port=reader.text("port", ""),
            instrument=reader.text("instrument", ""),
            frequency_hz=reader.frequency("frequency", 100_000.0),
        )
        reader.done()
        buses.append(places.keep(bus, name))
    return tuple(buses)


def read_instruments(document: MappingReader, places: Located) -> tuple[InstrumentSpec, ...]:
    """Read the instruments."""
    instruments = []
    for name, reader in document.entries("instruments", required=True):
        instruments.append(places.keep(_instrument(name.text, reader, places), name))
        reader.done()
    return tuple(instruments)


def read_wire(reader: MappingReader) -> Wire:
    """Read one role instance."""
    contacts = reader.child("contacts")
    names = contacts.keys() if contacts else ()
    wire = Wire(
        role=reader.text("role"),
        instance=reader.text("instance", "", pattern=_INSTANCE),
        instrument=reader.text("instrument"),
        channel=reader.integer("channel", 0, minimum=0),
        contacts={name: contacts.integer(name) for name in names} if contacts else {},
        settings=_texts(reader, "settings"),
        reduced=_reduced(reader.child("reduced")),
        charges=reader.text("charges", ""),
        hazardous=reader.flag("hazardous", default=True),
        note=reader.text("note", ""),
    )
    reader.done()
    return wire


def read_clamp(reader: MappingReader) -> Clamp:
    """Read one clamp."""
    return _bounded(reader, Clamp)


def read_safe_step(reader: MappingReader) -> SafeStep:
    """Read one line of safe-off, rest or hold."""
    proof = reader.child("proof")
    step = SafeStep(
        output=reader.text("output"),
        state=reader.text("state"),
        within_s=reader.duration("within"),
        proof=_bounded(proof, Proof) if proof else None,
    )
    reader.done()
    return step


def read_twin(document: MappingReader, places: Located) -> SimulatedBench | None:
    """Read the simulated twin, None where the bench has none."""
    reader = document.child("simulated")
    if reader is None:
        return None
    plants, peers = [], []
    for name, item in reader.entries("plants", required=True):
        plant = PlantSpec(
            name=name.text,
            model=item.text("model"),
            grid_s=item.duration("grid"),
            truth=_mapping(item.child("truth")),
        )
        item.done()
        plants.append(places.keep(plant, name))
    for name, item in reader.entries("peers", required=True):
        peers.append(places.keep(_peer(name.text, item), name))
        item.done()
    twin = SimulatedBench(
        epoch=reader.text("epoch", pattern=_EPOCH),
        seed=reader.integer("seed"),
        plants=tuple(plants),
        peers=tuple(peers),
        person=_texts(reader, "person"),
    )
    reader.done()
    return places.keep(twin, reader.place())


def _instrument(name: str, reader: MappingReader, places: Located) -> InstrumentSpec:
    return InstrumentSpec(
        name=name,
        driver=reader.text("driver"),
        port=reader.text("port", ""),
        baud=reader.integer("baud", 0, minimum=0),
        bus=reader.text("bus", ""),
        address=reader.integer("address", 0, minimum=0),
        powered_by=reader.text("powered_by", ""),
        identity=_identity(reader.child("identity")),
        ratings=tuple(places.keep(_rating(item), item.place()) for item in reader.children("ratings")),
        calibration=_calibration(reader.child("calibration"), places),
        dut=reader.flag("dut", default=False),
        usb=_usb(reader.child("usb"), places),
    )


def _usb(reader: MappingReader | None, places: Located) -> UsbPort | None:
    if reader is None:
        return None
    usb = UsbPort(serial=reader.text("serial", ""), path=reader.text("path", ""))
    reader.done()
    return places.keep(usb, reader.place())


def _identity(reader: MappingReader | None) -> Identity:
    if reader is None:
        return Identity()
    identity = Identity(
        manufacturer=reader.text("manufacturer", ""),
        model=reader.text("model", ""),
        serial=reader.text("serial", ""),
        firmware=reader.text("firmware", ""),
    )
    reader.done()
    return identity


def _rating(reader: MappingReader) -> Rating:
    rating = Rating(
        channel=reader.integer("channel", 0, minimum=0),
        quantity=reader.text("quantity"),
        unit=reader.text("unit"),
        maximum=reader.number("max"),
    )
    reader.done()
    return rating


def _calibration(reader: MappingReader | None, places: Located) -> Calibration | None:
    if reader is None:
        return None
    due = reader.text("due", pattern=_DATE)
    if due and not is_date(due):
        reader.findings.add(reader.place("due"), f"calibration: the date {due} does not exist")
    calibration = Calibration(
        certificate=reader.text("certificate"),
        due=due,
        ranges=tuple(places.keep(_range(item), item.place()) for item in reader.children("ranges", required=True)),
    )
    reader.done()
    return places.keep(calibration, reader.place("certificate"))


def _range(reader: MappingReader) -> CalibratedRange:
    entry = CalibratedRange(
        quantity=reader.text("quantity"),
        unit=reader.text("unit"),
        low=reader.number("from"),
        high=reader.number("to"),
        absolute=reader.number("absolute"),
        relative=reader.number("relative", 0.0),
        k=reader.number("k", 2.0),
    )
    reader.done()
    return entry


def _reduced(reader: MappingReader | None) -> ReducedLevel | None:
    if reader is None:
        return None
    level = ReducedLevel(
        voltage=reader.number("voltage"),
        current=reader.number("current"),
        lowest_current=reader.number("lowest_current"),
        highest_current=reader.number("highest_current"),
        positions=tuple(_position(item) for item in reader.children("positions")),
    )
    reader.done()
    return level


def _position(reader: MappingReader) -> Position:
    position = Position(relays=reader.text("relays"), closed=reader.texts("closed"), conducts=reader.flag("conducts"))
    reader.done()
    return position


def _bounded(reader: MappingReader, kind: Callable[..., _Bounded]) -> _Bounded:
    """Read the bounds of one quantity of one output."""
    bounded = kind(
        output=reader.text("output"),
        quantity=reader.text("quantity"),
        unit=reader.text("unit"),
        minimum=reader.number("min"),
        maximum=reader.number("max"),
    )
    reader.done()
    return bounded


def _peer(name: str, reader: MappingReader) -> PeerSpec:
    return PeerSpec(
        device=name,
        model=reader.text("model", ""),
        truth=_mapping(reader.child("truth")),
        connects=_texts(reader, "connects"),
        faults=tuple(_mapping(fault) for fault in reader.children("faults")),
    )


def _mapping(reader: MappingReader | None) -> Mapping[str, object]:
    keys = reader.keys() if reader else ()
    return {key: reader.plain(key) for key in keys} if reader else {}


def _texts(reader: MappingReader, key: str) -> Mapping[str, str]:
    inner = reader.child(key)
    names = inner.keys() if inner else ()
    return {name: inner.text(name) for name in names} if inner else {}
