"""Siglent SPD3303X and SPD3303X-E power supplies, two programmable outputs.

Commands: SPD3303X Quick Start, chapter 3. There is no query for an output's state: `SYST:STAT?` returns the state of
the instrument in hexadecimal, with bits 0 and 1 for constant current, 2 and 3 for the coupling of the outputs, 4 and 5
for on. Outputs in series or parallel deliver more than either setting, so an `on` in such a mode is refused.
No command reaches an over-voltage protection, so the driver does not claim `over-voltage-level`. Firmware adds a fifth
field to the identification.
"""

from __future__ import annotations

import re
from typing import ClassVar

from hil.instruments.driver import TERMINATED
from hil.instruments.scpi_dialect import Dialect, Levels
from hil.instruments.scpi_supply import ScpiSupply

__all__ = ["SPD3303X", "SiglentSpd3303x"]

_STATUS = re.compile(r"0[xX][0-9A-Fa-f]{1,8}", re.ASCII)
_COUPLING, _INDEPENDENT = 0b1100, 0b0100
_FIRST_ON = 4
_SAYS_OFF = {1: b"02468ACE", 2: b"014589CD"}  # second digit from the right: without bit 0, without bit 1


def _bits(reply: str) -> int:
    if not _STATUS.fullmatch(reply):
        raise ValueError("a hexadecimal number such as 0x10")
    return int(reply, 16)


def _as_state(reply: str, channel: int) -> bool:
    bits = _bits(reply)
    on = bool(bits & 1 << _FIRST_ON + channel - 1)
    if on and bits & _COUPLING != _INDEPENDENT:
        raise ValueError("outputs that are not in series or parallel")
    return on


def _as_mode(reply: str, channel: int) -> str:
    return "CC" if _bits(reply) & 1 << channel - 1 else "CV"


def _says_off(channel: int) -> bytes:
    return rb"(?i:0x(?:0*[0-9A-F]|[0-9A-F]*[%s][0-9A-F]))" % _SAYS_OFF[channel]


SPD3303X = Dialect(
    driver="siglent-spd3303x",
    channels=(1, 2),
    decimals=3,
    tolerance=0.0055,
    set_voltage="CH{channel}:VOLT {value}",
    get_voltage="CH{channel}:VOLT?",
    set_current="CH{channel}:CURR {value}",
    get_current="CH{channel}:CURR?",
    switch_on="OUTP CH{channel},ON",
    switch_off="OUTP CH{channel},OFF",
    is_on="SYST:STAT?",
    measure_voltage="MEAS:VOLT? CH{channel}",
    measure_current="MEAS:CURR? CH{channel}",
    mode="SYST:STAT?",
    levels=Levels,
    as_state=_as_state,
    as_mode=_as_mode,
    says_off=_says_off,
    fields=5,
    pause_s=0.015,  # public drivers leave 10 ms between commands
)
"""The commands of the SPD3303X."""


class SiglentSpd3303x(ScpiSupply):
    """Driver `siglent-spd3303x`: role `supply` on channels 1 and 2."""

    capabilities: ClassVar[frozenset[str]] = frozenset({TERMINATED})
    dialect: ClassVar[Dialect] = SPD3303X
