"""Sensor on a second die that is reachable only through the first, as on a chip's auxiliary bus."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar, TypeVar, cast

from hil.instruments.sensors.registers import Registers
from hil.instruments.sensors.sensor import Chip, Sensor
from hil.model.errors import NoReply

__all__ = ["Condition", "SecondDie"]

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A register setting of the first die that makes the second die reachable.

    Attributes:
        register, value: register and the value written to it.
        otherwise: what a different value means, for the message.
        bits: mask of the bits that matter.
    """

    register: IntEnum
    value: int
    otherwise: str
    bits: int = 0xFF


class SecondDie(Sensor):
    """A sensor behind its chip's first die; the chip's class defines `_switch_off` and reads by `_transfer_through`.

    Attributes:
        first: the first die's `Chip`, for its identity.
        way: settings of the first die, written in this order.
        first_asleep: settings that put the first die to sleep.
    """

    first: ClassVar[Chip]
    way: ClassVar[tuple[Condition, ...]]
    first_asleep: ClassVar[Mapping[int, int]]

    def _identify(self) -> None:
        """Open the path, then read the ID; the first die must be the right one too."""
        self._require_id(self._first_die, self.first)
        self._open()
        self._transfer_through(super()._identify)

    def _sleep(self) -> None:
        """Put this die to sleep, and the first one unless another sensor of the chip runs; read that back."""
        self._open()  # the first die may already be asleep
        self._transfer_through(self._switch_off)
        if not self._others_run():
            self._first_die.put(self.first_asleep)

    @abstractmethod
    def _switch_off(self) -> None:
        """Put this die to sleep, and read that back."""

    @property
    def _first_die(self) -> Registers:
        return cast("Registers", self._registers.other)

    def _open(self) -> None:
        """Configure the first die, unless another running sensor has done so."""
        if not self._others_run():
            self._first_die.set({each.register: each.value for each in self.way})

    def _transfer_through(self, transfer: Callable[[], _T]) -> _T:
        """Run a transfer with this die; on a missing acknowledge, report the first die's setting that blocks it."""
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
