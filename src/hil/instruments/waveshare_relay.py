"""Waveshare Modbus RTU Relay, the eight-relay board.

Coils 0 to 7 are the relays labelled 1 to 8 on the board (development protocol V2, which is
standard Modbus): function 05 switches one, 0F several, 01 reads them. The vendor's toggle (function
05 with 5500) is never sent, because its effect depends on the previous state. The read-back is the
commanded state of the relays; a welded contact shows only in the circuit that it switches.

The board's timed command (function 05, address 0200h plus the relay, value in tenths of a second) serves as a watchdog:
a relay closed with it opens by itself unless the command is repeated.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

from hil.instruments import settings
from hil.instruments.driver import ANY_BYTE, Connection, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.modbus_line import SILENCE, coils, coils_taken, coils_told, exchange, one_register, question
from hil.instruments.modbus_session import ModbusSession
from hil.instruments.roles import RELAYS, Relays
from hil.instruments.safing import must_be_state
from hil.model.bench import Proof, Wire
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused, Rejected
from hil.model.identity import Identity
from hil.model.notation import measured
from hil.model.safing import SafeBytes

__all__ = ["WaveshareRelay", "WaveshareRelays"]

_RELAYS = 8
_FACTORY_UNIT = 1
_VERSION_REGISTER = 0x8000
_HIGHEST_VERSION = 9999
_SIMULATED = 0x5349
"""The version of a simulated board, the letters SI."""
_TIMED = 0x0200
_LONGEST_BEAT_S = 3276.7
_SHORTEST_BEAT_S = 1.0
_QUIET_S = 0.02
"""Quiet gap in s: the board answers after 2 ms with 6 bytes, which take 6 ms at 9600 baud."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """Wire settings.

    Attributes:
        beat_s: heartbeat timeout [s] after which the board opens the wire's contacts by itself; 0 for never.
    """

    beat_s: Annotated[float, measured("s", minimum=_SHORTEST_BEAT_S, maximum=_LONGEST_BEAT_S)] = field(
        default=0.0, metadata={"alias": "beat"}
    )


class WaveshareRelays:
    """Named contacts of one board; fills the role `relays`.

    A setting is sent once and then read back; a lost or damaged acknowledgement is ignored if the
    read-back is as commanded.

    Args:
        name: the wire's dotted name.
        device: the instrument's name, for messages.
        session: the board's session.
        contacts: relay number on the board, 1 to 8, by contact name.
        beat_s: heartbeat timeout [s] after which the board opens them, 0 for never.
    """

    def __init__(
        self, *, name: str, device: str, session: ModbusSession, contacts: Mapping[str, int], beat_s: float = 0.0
    ) -> None:
        self._name = name
        self._device = device
        self._session = session
        self._contacts = dict(contacts)
        self._beat_s = beat_s
        self._held: set[int] = set()  # coils that the board opens by itself

    @drives
    def close(self, contact: str) -> None:
        """Energise one contact."""
        coil = self._coil(contact)
        if not self._beat_s:
            self._prove(lambda: self._session.write_coil(coil, on=True), {coil: True})
            return
        self._prove(lambda: self._hold(coil), {coil: True})
        self._held.add(coil)

    @drives
    def open(self, contact: str) -> None:
        """Release one contact."""
        coil = self._coil(contact)
        self._held.discard(coil)
        self._prove(lambda: self._session.write_coil(coil, on=False), {coil: False})

    @drives
    def release_all(self) -> None:
        """Release every relay of the board, including those of other wires."""
        self._held.clear()
        wanted = dict.fromkeys(range(_RELAYS), False)
        self._prove(lambda: self._session.write_coils(0, [False] * _RELAYS), wanted)

    @reads
    def closed(self) -> tuple[str, ...]:
        """Return the names of the energised contacts, sorted."""
        states = self._session.read_coils(0, _RELAYS)
        return tuple(sorted(name for name, number in self._contacts.items() if states[number - 1]))

    @property
    def watchdog_s(self) -> float:
        """Heartbeat timeout in s after which the board opens the contacts; see `hil.instruments.roles.Watched`."""
        return self._beat_s

    def beat(self) -> None:
        """Keep closed contacts closed, unless the board has opened them; see `hil.instruments.roles.Beaten`."""
        if not self._held:
            return
        states = self._session.read_coils(0, _RELAYS)
        opened = sorted(coil + 1 for coil in self._held if not states[coil])
        if opened:
            self._held.clear()
            raise Rejected(
                self._device,
                f"{self._name}: the board opened relay {', '.join(map(str, opened))} by itself: no heartbeat",
                f"check what held the run up for {self._beat_s:g} s",
            )
        for coil in sorted(self._held):
            self._hold(coil)

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:  # noqa: ARG002 - it measures nothing
        """Return the bytes that release every relay of the board; see `hil.instruments.roles.SafeByBytes`.

        The proof is the board's own relay state, which does not reveal a welded contact.
        """
        must_be_state(RELAYS, self._name, state)
        unit, within_s, released = self._session.unit, self._session.timeout, [False] * _RELAYS
        return SafeBytes(
            resync=(SILENCE,),
            off=(exchange(coils(0, released, unit), coils_taken(0, _RELAYS, unit), within_s),),
            proof=(exchange(question(1, 0, _RELAYS, unit), coils_told(released, unit), within_s),),
            owed_s=within_s,
            who=one_register(_VERSION_REGISTER, unit, within_s),
        )

    def _hold(self, coil: int) -> None:
        self._session.write_timed_coil(_TIMED + coil, round(self._beat_s * 10))

    def _prove(self, write: Callable[[], None], wanted: Mapping[int, bool]) -> None:
        """Write once and read back, followed by silence as proof that no stale frame was read.

        Raises:
            NoReply: no reply, or a reply was lost and the relays are not as wanted.
            Garbled: the same for a malformed reply, or unsolicited bytes came.
            Rejected: the board refused, or reports other relay states.
        """
        stray = self._stray()
        fault: DeviceFault | None = None
        try:
            write()
        except (NoReply, Garbled) as error:
            fault = error
        states = self._session.read_coils(0, _RELAYS)
        self._session.must_be_quiet(_QUIET_S)
        if stray:
            raise stray
        wrong = [coil + 1 for coil, on in wanted.items() if states[coil] != on]
        if wrong and fault:
            raise fault
        if wrong:
            raise Rejected(
                self._device,
                f"{self._name}: the board acknowledged, but reads back relay {', '.join(map(str, wrong))} otherwise",
                "check the board's supply voltage, and what else talks to it",
            )

    def _stray(self) -> DeviceFault | None:
        """Return the fault found before a write, which is sent all the same, because it may be a release."""
        try:
            self._session.must_be_quiet()
        except DeviceFault as fault:
            return fault
        return None

    def _coil(self, contact: str) -> int:
        if contact not in self._contacts:
            raise Refused(
                f"{self._name} has no contact '{contact}'", f"its contacts are {', '.join(sorted(self._contacts))}"
            )
        return self._contacts[contact] - 1


class WaveshareRelay:
    """Driver `waveshare-relay`: role `relays`; every contact of the wire is a number from 1 to 8, see `Settings`.

    The instrument's `address` is the board's unit address; 0 stands for the factory setting, 1.
    """

    roles: ClassVar[frozenset[str]] = frozenset({"relays"})
    capabilities: ClassVar[frozenset[str]] = frozenset({ANY_BYTE})

    def __init__(self, connection: Connection) -> None:
        if connection.port is None:
            raise Refused(f"{connection.device}: a waveshare-relay is reached by a port", "give it `port:`")
        self._connection = connection
        unit = connection.address or _FACTORY_UNIT
        self._session = ModbusSession(
            connection.device, connection.port, connection.clock, unit, timeout=connection.timeout
        )

    def identify(self) -> Identity:
        """Read the version register, the only identification that the board offers.

        The register (8000h, version times 100) is vendor-specific. A board that answers there and
        has eight coils is taken to be this model; one that rejects it gets an identity without model.
        Manufacturer and serial number cannot be read.
        """
        try:
            version = self._session.read_holding(_VERSION_REGISTER, 1)[0]
        except Rejected:
            return Identity()
        self._session.read_coils(0, _RELAYS)
        if version == _SIMULATED:
            return Identity(model="Modbus RTU Relay", firmware="SIMULATED")
        if not 0 < version <= _HIGHEST_VERSION:
            return Identity()
        return Identity(model="Modbus RTU Relay", firmware=f"{version // 100}.{version % 100:02d}")

    def outlets(self) -> Sequence[Outlet]:
        """Read every relay; its channel is its number on the board."""
        return tuple(Outlet(coil + 1, on) for coil, on in enumerate(self._session.read_coils(0, _RELAYS)))

    def role(self, wire: Wire) -> Relays:
        """Return the wire's contacts."""
        if wire.role not in self.roles:
            raise Refused(
                f"wiring {wire.name}: a waveshare-relay does not fill the role {wire.role}", "it fills the role relays"
            )
        if not wire.contacts:
            raise Refused(f"wiring {wire.name}: no contacts", "name them: `contacts: {heater: 1}`")
        for contact, number in wire.contacts.items():
            if not 1 <= number <= _RELAYS:
                raise Refused(
                    f"wiring {wire.name}: contact {contact} is relay {number}", f"the board has 1 to {_RELAYS}"
                )
        asked = settings.read(wire, Settings)
        return WaveshareRelays(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            contacts=wire.contacts,
            beat_s=asked.beat_s,
        )
