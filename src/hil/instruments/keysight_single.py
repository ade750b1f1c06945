"""Keysight power supplies with one output: the E36100 series, and the E3632A, E3633A and E3634A.

Commands: E36100 Series Operating and Service Guide; E3632A User's Guide (E3632-90001). They have no channel lists.
Several queries in one line are not documented, so an identification query closes each reply.

Assumed, not yet checked against an instrument: the E36100 series has the same queries for a tripped protection as the
E36300 series.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from hil.instruments.scpi_dialect import Dialect, Protection, mode_of
from hil.instruments.scpi_supply import ScpiSupply

__all__ = ["E3632A", "E36100", "KeysightE3632a", "KeysightE36100"]

_OVER_VOLTAGE = Protection(set_level="VOLT:PROT {value}", get_level="VOLT:PROT?", tripped="VOLT:PROT:TRIP?")

E36100 = Dialect(
    driver="keysight-e36100",
    channels=(1,),
    decimals=4,
    tolerance=0.005,
    set_voltage="VOLT {value}",
    get_voltage="VOLT?",
    set_current="CURR {value}",
    get_current="CURR?",
    switch_on="OUTP ON",
    switch_off="OUTP OFF",
    is_on="OUTP?",
    measure_voltage="MEAS:VOLT?",
    measure_current="MEAS:CURR?",
    mode="STAT:OPER:COND?",
    as_mode=mode_of(voltage=1 << 8, current=1 << 10),
    over_voltage=_OVER_VOLTAGE,
)
"""The commands of the E36100 series."""

E3632A = replace(
    E36100,
    driver="keysight-e3632a",
    mode="STAT:QUES:COND?",
    as_mode=mode_of(voltage=1 << 1, current=1 << 0),
    over_voltage=replace(_OVER_VOLTAGE, arm="VOLT:PROT:STAT ON", armed="VOLT:PROT:STAT?"),
)
"""The commands of the E3632A; the over-voltage protection has a switch."""


class KeysightE36100(ScpiSupply):
    """Driver `keysight-e36100`: role `supply` on channel 1; a wire may set `over_voltage`."""

    dialect: ClassVar[Dialect] = E36100


class KeysightE3632a(ScpiSupply):
    """Driver `keysight-e3632a`: role `supply` on channel 1; a wire may set `over_voltage`."""

    dialect: ClassVar[Dialect] = E3632A
