"""Fault injection into peers: the `faults` of a bench file. Each kind is a class with its parameters."""

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
"""A fraction from 0 to 1."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """An injected fault with its time window on the bench's clock. Each kind is a class of its own.

    The fields of a kind are its parameters, written in bench files as in `hil.model.notation`.

    Attributes:
        name: name of the kind in bench files.
        start_ns: start of the fault, counted from the epoch.
        end_ns: first instant after the fault.
    """

    name: ClassVar[str] = ""

    kind: AnyText = ""
    start_ns: Nanoseconds = field(default=0, metadata={"alias": "from"})
    end_ns: Nanoseconds = field(default=_FOREVER, metadata={"alias": "until"})

    def holds(self, now_ns: int) -> bool:
        """Return whether the fault is active at that instant."""
        return self.start_ns <= now_ns < self.end_ns

    def concerns(self, part: int) -> bool:
        """Return whether it affects this channel, contact or address."""
        del part
        return True


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkFault(Fault):
    """A fault on the link of any device; entry points of the group `hil.faults` name such classes.

    Attributes:
        links: kinds of links: `serial`, `bus`, or both.
        cuts: whether the link is dead while it is active; a bus device does not acknowledge.
    """

    links: ClassVar[frozenset[str]] = frozenset()
    cuts: ClassVar[bool] = False

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Return the corrupted bytes of a transmission at this instant."""
        del noise, now_ns
        return data

    @property
    def delay_ns(self) -> int:
        """Added latency of the device's bytes, on a byte stream."""
        return 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Dead(LinkFault):
    """The device has no power: it neither receives nor sends."""

    name = "dead"
    links = frozenset({"bus", "serial"})
    cuts = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Garbled(LinkFault):
    """One bit of some bytes is flipped, chosen by instant and position only."""

    name = "garbled"
    links = frozenset({"bus", "serial"})

    share: Share = 1.0

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Flip one bit in a share of the bytes."""
        spoiled = bytearray(data)
        for place in range(len(data)):
            index = 2 * (now_ns + place)
            if noise.uniform(index) < self.share:
                spoiled[place] ^= 1 << int(noise.uniform(index + 1) * _BITS)
        return bytes(spoiled)


@dataclass(frozen=True, slots=True, kw_only=True)
class Late(LinkFault):
    """Replies are delayed."""

    name = "late"
    links = frozenset({"serial"})

    by_ns: Nanoseconds = field(metadata={"alias": "by"})

    @property
    def delay_ns(self) -> int:
        """The added latency."""
        return self.by_ns


@dataclass(frozen=True, slots=True, kw_only=True)
class Partial(LinkFault):
    """Each transmission is truncated to its first bytes."""

    name = "partial"
    links = frozenset({"serial"})

    most: Annotated[int, whole(0)] = field(default=1, metadata={"alias": "bytes"})

    def spoiled(self, data: bytes, noise: RandomStream, now_ns: int) -> bytes:
        """Return the first bytes."""
        del noise, now_ns
        return data[: self.most]


@dataclass(frozen=True, slots=True, kw_only=True)
class Chatty(LinkFault):
    """Unsolicited bytes are sent repeatedly."""

    name = "chatty"
    links = frozenset({"serial"})

    every_ns: SomeNanoseconds = field(metadata={"alias": "every"})
    text: AnyText = "?\r\n"


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity(Fault):
    """Another instrument answers, with the identity `value`."""

    name = "identity"

    value: Text


@dataclass(frozen=True, slots=True, kw_only=True)
class Stuck(Fault):
    """The device's output is frozen."""

    name = "stuck"


@dataclass(frozen=True, slots=True, kw_only=True)
class Saturated(Fault):
    """Every axis of a sensor saturates: this much is added, in the sensor's unit."""

    name = "saturated"

    added: Number = field(default=5000.0, metadata={"alias": "field"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Drifting(Fault):
    """Every axis of a sensor drifts by this much more per kelvin from 25 degC, in the sensor's unit."""

    name = "drifting"

    added: Number = field(default=0.05, metadata={"alias": "drift"})


@dataclass(frozen=True, slots=True)
class Faults:
    """All faults of one peer."""

    faults: tuple[Fault, ...] = ()

    def of(self, kind: type[_FAULT]) -> tuple[_FAULT, ...]:
        """Return the faults of a kind, active or not."""
        return tuple(fault for fault in self.faults if isinstance(fault, kind))

    def now(self, kind: type[_FAULT], now_ns: int, part: int | None = None) -> _FAULT | None:
        """Return the first active fault of a kind, if given for one part."""
        for fault in self.faults:
            if isinstance(fault, kind) and fault.holds(now_ns) and (part is None or fault.concerns(part)):
                return fault
        return None


def read_faults(rows: Sequence[Mapping[str, object]], path: Path, kinds: Sequence[type[Fault]]) -> Faults:
    """Read the `faults` of a peer that knows these kinds.

    Raises:
        TruthError: with every error of the first row that has any.
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
