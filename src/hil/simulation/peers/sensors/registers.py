"""The registers of a simulated sensor: what they hold after a reset, which can be written, and in which bank."""

from __future__ import annotations

from collections.abc import Container, Mapping

from hil.wire.checkpoint import Kept, Stateful

__all__ = ["RegisterFile"]


class RegisterFile(Stateful):
    """Plain storage with banks; what a register does is its owner's business.

    Args:
        reset: values after power-on; all others are 0.
        read_only: registers that cannot be written.
        select: the register that selects a bank, and is in every bank; None if there are no banks.
        size: registers of a bank; a number beyond them starts over.
        shift, banks: place of the bank's number in that register, and how many there are.
    """

    bank: Kept[int]
    _values: Kept[dict[int, int]]

    def __init__(
        self,
        reset: Mapping[int, int],
        read_only: Container[int],
        select: int | None = None,
        size: int = 0x80,
        *,
        shift: int = 0,
        banks: int = 8,
    ) -> None:
        self._size = size
        self._reset = reset
        self._read_only = read_only
        self._select, self._shift, self._banks = select, shift, banks
        self._values = dict(reset)
        self.bank = 0

    def __getitem__(self, register: int) -> int:
        """Return what is stored, or which bank is selected."""
        return self.bank << self._shift if register == self._select else self._values.get(register, 0)

    def __setitem__(self, register: int, value: int) -> None:
        """Store a value, unless the register can only be read; select a bank."""
        if register == self._select:
            self.bank = (value >> self._shift) % self._banks
        elif register not in self._read_only:
            self._values[register] = value

    def in_bank(self, number: int) -> int:
        """Return the register that an address on the bus means: the bank is above the low byte."""
        number %= self._size
        return number if number == self._select else self.bank << 8 | number

    def reset(self) -> None:
        """Bring back the values after power-on."""
        self._values, self.bank = dict(self._reset), 0
