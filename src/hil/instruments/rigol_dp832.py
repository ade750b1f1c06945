"""Rigol DP832 and DP832A triple-output power supplies.

Commands: DP800 Series Programming Guide. The channel selected by `:INST` is instrument state, which the front panel
and other programs change; every command here names its channel instead. Several queries in one line are not
documented, so an identification query closes each reply.
"""

from __future__ import annotations

from typing import ClassVar

from hil.instruments.scpi_dialect import BothLevels, Dialect, Protection
from hil.instruments.scpi_supply import ScpiSupply

__all__ = ["DP800", "RigolDp832"]

_MODES = {"CV": "CV", "CC": "CC", "UR": "unregulated"}


def _as_trip(reply: str) -> bool:
    if reply not in {"YES", "NO"}:
        raise ValueError("YES or NO")
    return reply == "YES"


def _as_mode(reply: str, channel: int) -> str:
    del channel
    if reply not in _MODES:
        raise ValueError("CV, CC or UR")
    return _MODES[reply]


DP800 = Dialect(
    driver="rigol-dp832",
    channels=(1, 2, 3),
    decimals=3,
    tolerance=0.0055,
    set_voltage=":SOUR{channel}:VOLT {value}",
    get_voltage=":SOUR{channel}:VOLT?",
    set_current=":SOUR{channel}:CURR {value}",
    get_current=":SOUR{channel}:CURR?",
    switch_on=":OUTP CH{channel},ON",
    switch_off=":OUTP CH{channel},OFF",
    is_on=":OUTP? CH{channel}",
    measure_voltage=":MEAS:VOLT? CH{channel}",
    measure_current=":MEAS:CURR? CH{channel}",
    mode=":OUTP:MODE? CH{channel}",
    over_voltage=Protection(
        set_level=":OUTP:OVP:VAL CH{channel},{value}",
        get_level=":OUTP:OVP:VAL? CH{channel}",
        tripped=":OUTP:OVP:QUES? CH{channel}",
        arm=":OUTP:OVP CH{channel},ON",
        armed=":OUTP:OVP? CH{channel}",
    ),
    over_current=Protection(
        set_level=":OUTP:OCP:VAL CH{channel},{value}",
        get_level=":OUTP:OCP:VAL? CH{channel}",
        tripped=":OUTP:OCP:QUES? CH{channel}",
        arm=":OUTP:OCP CH{channel},ON",
        armed=":OUTP:OCP? CH{channel}",
    ),
    levels=BothLevels,
    as_trip=_as_trip,
    as_mode=_as_mode,
    error_query=":SYST:ERR?",
    pause_s=0.015,  # about 10 ms between commands, plus 50 % margin
)
"""The commands of the DP800 series; the coarsest programming resolution is 10 mV."""


class RigolDp832(ScpiSupply):
    """Driver `rigol-dp832`: role `supply` on channels 1 to 3; a wire may set `over_voltage` and `over_current`."""

    dialect: ClassVar[Dialect] = DP800
