"""The two relays of the simulated cycler: never closed together, and sometimes stuck."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

from hil.model.notation import one_of
from hil.simulation.faults import Fault, Faults
from hil.simulation.peers.timing import Alarm, Alarms
from hil.simulation.plants.terminal import InputPoint, Power
from hil.wire.checkpoint import Kept, Stateful
from hil.wire.peer import PeerClock

__all__ = ["CHARGE", "DISCHARGE", "Relays", "StuckRelay"]

CHARGE, DISCHARGE = "charge", "discharge"
_PAUSE_NS = 100_000_000


@dataclass(frozen=True, slots=True, kw_only=True)
class StuckRelay(Fault):
    """A contact stays where it is."""

    name = "stuck-relay"

    relay: Annotated[str, one_of("charge", "discharge")]


class Relays(Stateful):
    """Coils as the firmware drives them, and contacts that follow unless they are stuck.

    The fault `stuck-relay` keeps a contact where it is while the fault lasts. Without power no coil holds its contact.

    Args:
        contacts: plant inputs by relay.
        faults: what goes wrong.
        power: of the coils.
    """

    _coil: Kept[str]
    _coming: Kept[str]
    _closed: Kept[dict[str, bool]]
    _pause: Kept[Alarm]
    _freed: Kept[Alarms]

    def __init__(self, contacts: Mapping[str, InputPoint], faults: Faults, power: Power) -> None:
        self._points = contacts
        self._power = power
        self._stuck = faults.of(StuckRelay)
        self._coil = ""
        self._coming = ""
        self._closed = {CHARGE: False, DISCHARGE: False}
        self._clock: PeerClock

    def attach(self, clock: PeerClock) -> None:
        """Take the clock; both are open."""
        self._clock = clock
        self._pause = Alarm(clock, self._close)
        self._freed = Alarms(clock, [(fault.end_ns, self._follow) for fault in self._stuck])
        self._power.listen(self._follow)

    @property
    def letter(self) -> str:
        """The relay whose coil is driven as the reply to STATE has it: `C`, `D`, or `-`."""
        return self._coil[0].upper() if self._coil else "-"

    def open(self) -> None:
        """Release both coils at once."""
        self._pause.clear()
        self._coil = self._coming = ""
        self._follow()

    def close(self, relay: str) -> None:
        """Open both, and drive one after the pause that keeps them apart."""
        self.open()
        self._coming = relay
        self._pause.set(self._clock.now_ns() + _PAUSE_NS)

    def _close(self) -> None:
        self._coil, self._coming = self._coming, ""
        self._follow()

    def _follow(self) -> None:
        now_ns, pulled = self._clock.now_ns(), self._coil if self._power.there else ""
        for relay in self._closed:
            if any(fault.relay == relay and fault.holds(now_ns) for fault in self._stuck):
                continue
            self._closed[relay] = relay == pulled
            if relay in self._points:
                self._points[relay].command(self._closed[relay])
