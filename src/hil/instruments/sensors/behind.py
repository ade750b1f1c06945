"""A sensor on a second die that can be reached through the first one only, as on a chip's auxiliary bus."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, TypeVar, cast

from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.sensor import Chip, Sensor
from hil.model.errors import NoReply

__all__ = ["Behind", "Condition"]

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """What a register of the first die must hold, for the second die to be there.

    Attributes:
        register, value: what is written there.
        otherwise: what it means where the register holds something else, for the message.
        bits: those that matter.
    """

    register: IntEnum
    value: int
    otherwise: str
    bits: int = 0xFF


class Behind(Sensor):
    """A sensor behind the first die of its chip, whose class defines `_switch_off` and reads by `_reached`.

    Attributes:
        first: the first die's chip, for its identity.
        way: what the first die must hold, written in this order.
        first_asleep: what puts the first die to sleep.
    """

    first: ClassVar[Chip]
    way: ClassVar[tuple[Condition, ...]]
    first_asleep: ClassVar[Mapping[int, int]]

    def _identify(self) -> None:
        """Open the way, then ask for its name; the first die must be the right one, too."""
        self._require_name(self._first_die, self.first)
        self._open()
        self._reached(super()._identify)

    def _sleep(self) -> None:
        """Put this die to sleep, and the first one unless another sensor of the chip runs; read that back."""
        self._open()  # the first die may sleep already
        self._reached(self._switch_off)
        if not self._others_run():
            self._first_die.put(self.first_asleep)

    @abstractmethod
    def _switch_off(self) -> None:
        """Put this die to sleep, and read that back."""

    @property
    def _first_die(self) -> Registers:
        return cast("Registers", self._registers.other)

    def _open(self) -> None:
        """Let the first die be as it must, which another sensor that runs has seen to."""
        if not self._others_run():
            self._first_die.set({each.register: each.value for each in self.way})

    def _reached(self, transfer: Callable[[], _T]) -> _T:
        """Transfer with this die; where it does not acknowledge, say what of the first die keeps it away."""
        try:
            return transfer()
        except NoReply as fault:
            for each in self.way:
                found = self._first_die.read(each.register) & each.bits
                if found != each.value:
                    raise NoReply(
                        self._device,
                        f"its {self.chip.role} cannot be reached: {each.register.name} is {found:#04x}, which must be"
                        f" {each.value:#04x} ({each.otherwise})",
                        "start it again, and look what else writes to the sensor",
                    ) from fault
            raise
