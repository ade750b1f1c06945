"""What goes wrong with peers, and when: the `faults` of a bench file. Each kind is a class with its parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar, TypeVar

from hil.analysis.noise.numbers import RandomStream
from hil.model.notation import AnyText, Nanoseconds, Number, SomeNanoseconds, Text, number, whole
from hil.simulation.truth import Path, TruthError, declared, suggestion

__all__ = [
    "Chatty",
    "Dead",
    "Drifting",
    "Fault",
    "Faults",
    "Garbled",
    "Identity",
    "Late",
    "LinkFault",
    "Partial",
    "Saturated",
    "Share",
    "Stuck",
    "read_faults",
]

_BITS = 8
_FOREVER = 2**63
_FAULT = TypeVar("_FAULT", bound="Fault")

Share = Annotated[float, number(0, 1)]
"""A part of a whole, from 0 to 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """One thing that goes wrong from one instant of the bench's clock to another. Each kind is a class of its own.

    The fields of a kind are its parameters; `hil.model.notation` says how a bench file writes them.

    Attributes:
        name: of the kind, what bench files call it.
        start_ns: first instant, counted from the epoch.
        end_ns: first instant at which it is over.
    """

    name: ClassVar[str] = ""

    kind: AnyText = ""
    start_ns: Nanoseconds = field(default=0, metadata={"alias": "from"})
    end_ns: Nanoseconds = field(default=_FOREVER, metadata={"alias": "until"})

    def holds(self, now_ns: int) -> bool:
        """Return whether it is wrong at that instant."""
        return self.start_ns <= now_ns < self.end_ns

    def concerns(self, part: int) -> bool:
        """Return whether it hits one of several alike: a channel, a contact, an address."""
        del part
        return True


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFault(Fault):
    """What can go wrong around any device on a link; entry points of the group `hil.faults` name such classes.

    Attributes:
        links: where it can: `serial`, `bus`, or both.
        cuts: whether nothing comes in or goes out while it holds; a bus device does not acknowledge.
    """

    links: ClassVar[frozenset[str]] = frozenset()
    cuts: ClassVar[bool] = False

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Return what becomes of bytes that the device sends at this instant."""
        del noise, now_ns
        return data

    @property
    def delay_ns(self) -> int:
        """How much later its bytes leave, on a byte stream."""
        return 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Dead(LinkFault):
    """Without power: nothing comes in and nothing goes out."""

    name = "dead"
    links = frozenset({"bus", "serial"})
    cuts = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Garbled(LinkFault):
    """One bit of some bytes is flipped; which ones depends on the instant and the place only."""

    name = "garbled"
    links = frozenset({"bus", "serial"})

    share: Share = 1.0

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Flip a bit of a share of the bytes."""
        spoiled = bytearray(data)
        for place in range(len(data)):
            index = 2 * (now_ns + place)
            if noise.uniform(index) < self.share:
                spoiled[place] ^= 1 << int(noise.uniform(index + 1) * _BITS)
        return bytes(spoiled)


@dataclass(frozen=True, slots=True, kw_only=True)
class Late(LinkFault):
    """Replies come later."""

    name = "late"
    links = frozenset({"serial"})

    by_ns: Nanoseconds = field(metadata={"alias": "by"})

    @property
    def delay_ns(self) -> int:
        """How much later."""
        return self.by_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class Partial(LinkFault):
    """Only the first bytes of what is sent at once come through."""

    name = "partial"
    links = frozenset({"serial"})

    most: Annotated[int, whole(0)] = field(default=1, metadata={"alias": "bytes"})

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Return the first bytes."""
        del noise, now_ns
        return data[: self.most]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chatty(LinkFault):
    """Bytes come that nobody asked for, again and again."""

    name = "chatty"
    links = frozenset({"serial"})

    every_ns: SomeNanoseconds = field(metadata={"alias": "every"})
    text: AnyText = "?\r\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity(Fault):
    """Another instrument answers: it says that it is `value`."""

    name = "identity"

    value: Text


@dataclass(frozen=True, slots=True, kw_only=True)
class Stuck(Fault):
    """What the device gives out does not change."""

    name = "stuck"


@dataclass(frozen=True, slots=True, kw_only=True)
class Saturated(Fault):
    """Every axis of a sensor has more than it can measure: that much is added, in the sensor's unit."""

    name = "saturated"

    added: Number = field(default=5000.0, metadata={"alias": "field"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Drifting(Fault):
    """Every axis of a sensor drifts by that much more per kelvin from 25 degC, in the sensor's unit."""

    name = "drifting"

    added: Number = field(default=0.05, metadata={"alias": "drift"})


@dataclass(frozen=True, slots=True)
class Faults:
    """All faults of one peer."""

    faults: tuple[Fault, ...] = ()

    def of(self, kind: type[_FAULT]) -> tuple[_FAULT, ...]:
        """Return the faults of a kind, whenever they hold."""
        return tuple(fault for fault in self.faults if isinstance(fault, kind))

    def now(self, kind: type[_FAULT], now_ns: int, part: int | None = None) -> _FAULT | None:
        """Return the first fault of a kind that holds, and that concerns a part where one is given."""
        for fault in self.faults:
            if isinstance(fault, kind) and fault.holds(now_ns) and (part is None or fault.concerns(part)):
                return fault
        return None


def read_faults(rows: Sequence[Mapping[str, object]], path: Path, kinds: Sequence[type[Fault]]) -> Faults:
    """Read the `faults` of a peer that knows these kinds.

    Raises:
        TruthError: with everything that is wrong in the first row that has something wrong.
    """
    return Faults(tuple(_read(row, (*path, place), kinds) for place, row in enumerate(rows)))


def _read(row: Mapping[str, object], path: Path, kinds: Sequence[type[Fault]]) -> Fault:
    by_name = {kind.name: kind for kind in kinds}
    name = str(row.get("kind", ""))
    if not name:
        raise TruthError(path, "fault: key 'kind' is missing")
    if name not in by_name:
        raise TruthError((*path, "kind"), f"unknown fault '{name}'{suggestion(name, tuple(by_name))}")
    return declared(by_name[name], row, f"fault {name}", path)
