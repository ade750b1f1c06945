"""Checks across the sections of a bench file."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, replace

from hil.bench.file import cutting_checks, limit_checks, port_checks
from hil.bench.file.complaints import Complaints, known, listed, named, usable
from hil.clock.virtual import VirtualClock
from hil.documents.declared import Document
from hil.documents.findings import Findings
from hil.instruments.driver import ServesBus, Strap, Strapped
from hil.instruments.registry import DRIVERS, ROLES
from hil.instruments.wrapped import is_wrapped
from hil.model.bench import BenchSpec, Bus, InstrumentSpec, Wire
from hil.model.notation import Path
from hil.wire.keys import keys_of_this_port
from hil.wire.opening import MESSAGES, NETWORK, PortKind, kind_of, url_of_resource, why_not_opened

__all__ = ["check_bench"]

_NAME = re.compile("[A-Za-z][A-Za-z0-9_-]*")
_KEY_OF_ENTRY = 3  # section, entry, key
_REFERENCE = "reference"
"""The instance of a role with which devices under test are compared."""

_HIGHEST_STATION = 247  # Modbus over serial line, section 2.2; no other line with addresses has more


def check_bench(document: Document[BenchSpec], findings: Findings, *, driven: bool = True) -> Document[BenchSpec]:
    """Add every inconsistency, and for a bench that is to be driven also whatever prevents that.

    What could not be read is blank and was reported: a check that relies on it is skipped, and so is one that
    relies on a driver or role that no package offers.

    Returns:
        The document, with the places of such drivers and roles among what is wrong.
    """
    unknown = tuple(_unknown(document.model))
    for path, message in unknown:
        findings.add(document.place(path), message)
    document = replace(document, wrong=(*document.wrong, *(path for path, _ in unknown)))
    for check, relied_on in (*(_DRIVEN if driven else ()), *_CHECKS):
        if not any(_concerns(wrong, part) for wrong in document.wrong for part in relied_on):
            for path, message in check(document.model):
                if not _follows(path, document.wrong):
                    findings.add(document.place(path), message)
    return document


def _unknown(spec: BenchSpec) -> Complaints:
    for at, item in named(spec.instruments, "instruments"):
        yield from known((*at, "driver"), "driver", item.driver, DRIVERS)
    for at, wire in listed("wiring", spec.wiring):
        yield from usable((*at, "role"), ROLES, wire.role)


def _concerns(wrong: Path, part: str) -> bool:
    """Return whether an error at a path may affect a part of the file, such as `wiring.role`."""
    section, *keys = wrong
    inside = ".".join(str(key) for key in keys[1:] if isinstance(key, str))
    name, _, wanted = part.partition(".")
    return section == name and (not inside or not wanted or inside == wanted or inside.startswith(f"{wanted}."))


def _follows(path: Path, wrongs: Collection[Path]) -> bool:
    """Return whether a complaint about an entry may be a mere consequence of a wrong key in it."""
    return any(wrong[:2] == path[:2] and len(wrong) <= _KEY_OF_ENTRY for wrong in wrongs)


def _names(spec: BenchSpec) -> Complaints:
    """Check the names: they appear in URLs, transcripts and file names."""
    things: list[tuple[Path, InstrumentSpec | Bus]] = [
        *named(spec.instruments, "instruments"),
        *named(spec.buses, "buses"),
    ]
    for at, item in things:
        if not _NAME.fullmatch(item.name):
            yield at, f"the name '{item.name}' must be letters, digits, '-' and '_', and begin with a letter"


def _instruments(spec: BenchSpec) -> Complaints:
    buses = [bus.name for bus in spec.buses]
    for at, item in named(spec.instruments, "instruments"):
        if bool(item.port) == bool(item.bus):
            yield at, f"{item.name} needs either a port or a bus with an address"
        if item.bus:
            yield from known(at, "bus", item.bus, buses)
            if not 0x08 <= item.address <= 0x77:
                yield at, f"{item.name}: 0x{item.address:02X} is not a 7-bit I2C address (0x08 to 0x77)"
        elif item.address > _HIGHEST_STATION:
            yield at, f"{item.name}: {item.address} is not a station's address (1 to {_HIGHEST_STATION})"


def _ports(spec: BenchSpec) -> Complaints:
    """Check that ports can be told apart; on a network, an instrument is known only by its own identification."""
    for path, item in named(spec.instruments, "instruments"):
        if not item.port:
            continue
        at = (*path, "port")
        if problem := why_not_opened(item.port):
            yield at, f"{item.name}: {problem}"
        elif _is_on_network(item) and not (item.identity.model or item.identity.serial):
            yield (
                at,
                (
                    f"{item.name} is {_where(item)}, where anything may answer: give it an identity with model or"
                    " serial, which is compared before anything is driven"
                ),
            )


def _where(item: InstrumentSpec) -> str:
    return {
        PortKind.USBTMC: "at USB",
        PortKind.VENDOR: "where its vendor's driver finds it",
        PortKind.VISA: "at a VISA name",
    }.get(kind_of(item.port), "on a network")


def _is_on_network(item: InstrumentSpec) -> bool:
    scheme, is_url, _ = url_of_resource(item.port).partition("://")
    return is_wrapped(item) or (bool(is_url) and scheme in NETWORK) or kind_of(item.port) in MESSAGES


def _buses(spec: BenchSpec) -> Complaints:
    """Check that every bus is the host's own or served by an instrument of the bench."""
    by_name = {item.name: item for item in spec.instruments}
    served: dict[str, str] = {}
    for at, bus in named(spec.buses, "buses"):
        if bool(bus.port) == bool(bus.instrument):
            yield at, f"{bus.name} needs either a port or an instrument that serves it"
        yield from known(at, "instrument", bus.instrument, by_name)
        if bus.instrument and bus.instrument in by_name:
            yield from _server(spec, at, bus, by_name[bus.instrument])
        if bus.instrument and bus.instrument in served:
            yield at, f"{bus.instrument} serves {served[bus.instrument]} already"
        served.setdefault(bus.instrument, bus.name)


def _server(spec: BenchSpec, at: Path, bus: Bus, item: InstrumentSpec) -> Complaints:
    if item.driver in DRIVERS and not issubclass(DRIVERS[item.driver], ServesBus):
        yield at, f"{item.name} serves no bus: the driver {item.driver} has none"
    hangs_on = {other.name: other.bus for other in spec.instruments}
    above = {other.name: hangs_on.get(other.instrument, "") for other in spec.buses}
    seen: list[str] = []
    name = item.bus
    while name and name not in seen:
        if name == bus.name:
            yield at, f"{bus.name} leads back to itself: {item.name}, which serves it, is on bus {item.bus}"
        seen.append(name)
        name = above.get(name, "")


def _fed(spec: BenchSpec) -> Complaints:
    """Check that a device fed by the bench has an output that feeds it: arming identifies it while trying that one."""
    tried = {wire.name: wire.reduced is not None for wire in spec.wiring}
    for at, item in named(spec.instruments, "instruments"):
        yield from known(at, "output", item.powered_by, tried)
        if item.powered_by and not tried.get(item.powered_by, True):
            yield at, f"{item.name} is fed by {item.powered_by}, which needs a reduced level to identify it at"


@dataclass(frozen=True)
class _Die:
    """One address of an instrument on a bus, and how it is chosen."""

    at: Path
    item: InstrumentSpec
    address: int
    strap: Strap

    @property
    def place(self) -> str:
        return f"bus {self.item.bus}, address 0x{self.address:02X}"


def _dies(at: Path, item: InstrumentSpec) -> Iterator[_Die]:
    """Yield every address at which an instrument answers: two if its driver says that the chip has two dies."""
    driver = DRIVERS.find(item.driver)
    straps = driver.straps() if driver is not None and issubclass(driver, Strapped) else ()
    yield _Die((*at, "address"), item, item.address, straps[0] if straps else Strap("", ()))
    for strap in straps[1:]:
        second = (*at, "second_address") if item.second_address else at
        yield _Die(second, item, item.second_address or strap.addresses[0], strap)


def _straps(spec: BenchSpec) -> Complaints:
    """Check that the chip can be strapped to its address; a second address is that of a second die."""
    for at, item in named(spec.instruments, "instruments"):
        dies = list(_dies(at, item)) if item.bus else []
        if item.second_address and len(dies) < 2:
            yield (*at, "second_address"), f"{item.name}: an instrument of {item.driver} has one address: leave it out"
        for die in dies:
            if die.strap.addresses and die.address not in die.strap.addresses:
                there = " or ".join(f"0x{each:02X}" for each in die.strap.addresses)
                by = f", as {die.strap.pin} is strapped" if die.strap.pin else ""
                yield die.at, f"{item.name}: {item.driver} answers at {there}{by}, not at 0x{die.address:02X}"


def _clashes(spec: BenchSpec) -> Complaints:
    """Report two devices at one bus address, which would both answer, at both places, with what to strap instead."""
    dies = [die for at, item in named(spec.instruments, "instruments") if item.bus for die in _dies(at, item)]
    taken = {(die.item.bus, die.address) for die in dies}
    for number, die in enumerate(dies):
        for other in dies[:number]:
            if die.place == other.place and die.item is not other.item:
                ways = [
                    f"strap {each.item.name} to 0x{free[0]:02X} by {each.strap.pin}"
                    for each in (die, other)
                    if (free := [a for a in each.strap.addresses if (each.item.bus, a) not in taken])
                ]
                way = " or ".join(ways) or "put one of them on another bus"
                for each in (die, other):
                    yield each.at, f"{die.item.name} and {other.item.name} are both at {die.place}: {way}"


def _addresses(spec: BenchSpec) -> Complaints:
    yield from _straps(spec)
    yield from _clashes(spec)
    seen: dict[str, InstrumentSpec] = {}
    for at, item in named(spec.instruments, "instruments"):
        keys = keys_of_this_port(item.port) if item.port and not item.bus else []
        if other := next((seen[key] for key in keys if key in seen), None):
            yield at, f"{item.name} and {other.name} are both at port {url_of_resource(item.port)}"
        seen.update({key: item for key in keys if key not in seen})
    ports: dict[str, str] = {}
    for at, bus in named(spec.buses, "buses"):
        if bus.port and bus.port in ports:
            yield at, f"{bus.name} and {ports[bus.port]} are both the bus at {bus.port}"
        ports.setdefault(bus.port, bus.name)


def _wiring(spec: BenchSpec) -> Complaints:
    seen: set[str] = set()
    by_role: dict[str, set[str]] = {}
    for at, wire in listed("wiring", spec.wiring):
        yield from known(at, "instrument", wire.instrument, [item.name for item in spec.instruments])
        if wire.role and wire.name in seen:
            yield at, f"{wire.name} is wired twice"
        by_role.setdefault(wire.role, set()).add(wire.instance)
        if wire.role and "" in by_role[wire.role] and len(by_role[wire.role]) > 1:
            yield at, f"role '{wire.role}' has several instances, so each needs an 'instance' name"
        seen.add(wire.name)


def _references(spec: BenchSpec) -> Complaints:
    """A device under test is not its own reference: it would agree with itself, and needs no certificate.

    Nothing else of a bench says what a reference is, so it is known by its name.
    """
    under_test = {item.name for item in spec.instruments if item.dut}
    for at, wire in listed("wiring", spec.wiring):
        if wire.instance == _REFERENCE and wire.instrument in under_test:
            yield (
                (*at, "instrument"),
                f"{wire.name} is on {wire.instrument}, which is under test: wire a reference that is not",
            )


def _shared(spec: BenchSpec) -> Complaints:
    """Check that wires which share a relay board share no contact, and share a channel only if neither drives it."""
    by_place: dict[tuple[str, int], list[Wire]] = {}
    for at, wire in listed("wiring", spec.wiring):
        numbers = set(wire.contacts.values())
        if len(numbers) < len(wire.contacts):
            yield at, f"{wire.name}: two of its contacts have the same number"
        others = by_place.setdefault((wire.instrument, wire.channel), [])
        for other in others if wire.instrument else ():
            both = numbers & set(other.contacts.values())
            if both:
                yield at, f"{wire.name} and {other.name} both have contact {min(both)} of {wire.instrument}"
            elif not (wire.contacts and other.contacts) and not _measure_by_turns(wire, other):
                where = f"channel {wire.channel} of {wire.instrument}" if wire.channel else wire.instrument
                yield at, f"{wire.name} and {other.name} are both on {where}"
        others.append(wire)


def _measure_by_turns(wire: Wire, other: Wire) -> bool:
    """Return whether two wires may be on one instrument: neither drives anything, or they are one chip's two roles."""
    roles = ROLES.find(wire.role), ROLES.find(other.role)
    if any(role is None or role.hazardous for role in roles):
        return False
    return wire.role != other.role or not any(role and role.states for role in roles)


def _twin(spec: BenchSpec) -> Complaints:
    """Check the peers and the epoch of the twin; for truths, plants and person see `binding.check_twin`."""
    if spec.simulated is None:
        return
    names = [item.name for item in spec.instruments]
    simulated = {peer.device for peer in spec.simulated.peers}
    for peer in spec.simulated.peers:
        yield from known(("simulated", "peers", peer.device), "instrument", peer.device, names)
    for at, item in named(spec.instruments, "instruments"):
        if item.name and item.name not in simulated:
            yield at, f"{item.name} has no peer in the simulated twin"
    if spec.simulated.epoch and not _is_moment(spec.simulated.epoch):
        yield ("simulated", "epoch"), f"the epoch {spec.simulated.epoch} does not exist"


def _is_moment(epoch: str) -> bool:
    try:
        VirtualClock(epoch)
    except ValueError:
        return False
    return True


_OUTPUTS = ("wiring.role", "wiring.instance")
_PORTS = ("instruments.port", "instruments.bus", "buses")
_Checks = tuple[tuple[Callable[[BenchSpec], Complaints], tuple[str, ...]], ...]
"""Each check, with the parts of the file, besides the entry it complains about, on which its complaints rely.

The `name` of an entry counts as wrong if the whole section or entry does.
"""

_DRIVEN: _Checks = (
    (cutting_checks.cut_off, (*_OUTPUTS, *_PORTS, "wiring.instrument", "wiring.charges", "cut_paths")),
    (_ports, ()),
    (_references, (*_OUTPUTS, "instruments.dut")),
)
_CHECKS: _Checks = (
    (_names, ()),
    (_instruments, ("buses.name",)),
    (_buses, ("instruments.driver", "instruments.bus")),
    (_fed, (*_OUTPUTS, "wiring.reduced")),
    (_addresses, ("instruments.address", "instruments.second_address")),
    (_wiring, (*_OUTPUTS, "instruments.name")),
    (_shared, ("wiring.instrument", "wiring.channel", "wiring.contacts")),
    (limit_checks.ratings, ()),
    (limit_checks.certificates, ()),
    (limit_checks.clamps, _OUTPUTS),
    (limit_checks.rated, (*_OUTPUTS, "wiring.instrument", "wiring.channel", "instruments.ratings")),
    (limit_checks.reduced_levels, (*_OUTPUTS, "wiring.contacts", "safe_off.output")),
    (limit_checks.clamped_levels, (*_OUTPUTS, "wiring.reduced", "clamps")),
    (limit_checks.envelope, _OUTPUTS),
    (limit_checks.air, (*_OUTPUTS, "clamps", "envelope")),
    (limit_checks.safe_steps, _OUTPUTS),
    (limit_checks.covered, (*_OUTPUTS, "safe_off", "clamps.output", "clamps.quantity")),
    (cutting_checks.charging, (*_OUTPUTS, "wiring.charges", "instruments.driver", "envelope")),
    (cutting_checks.cut_paths, (*_OUTPUTS, *_PORTS, "wiring.instrument", "safe_off.output", "safe_off.state")),
    (cutting_checks.watched_after, _OUTPUTS),
    (port_checks.identities, ()),
    (port_checks.settings, ("instruments.driver", "buses.name")),
    (_twin, ("instruments.name", "simulated.peers")),
)
