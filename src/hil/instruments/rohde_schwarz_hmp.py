"""Rohde & Schwarz power supplies of the HMP2000, HMP4000 and NGE100 series.

Commands: HMP Series and NGE100 Series user manuals, as far as public drivers and excerpts show them. Commands act on
the channel selected last, which the front panel can change, so every line selects its own channel.

An output is live when its channel is activated (`OUTP:SEL`) and the master switch is on (`OUTP:GEN`). A channel
activated while the master switch is off would come on together with the next one. So a channel counts as on as soon as
it is activated, and off means not activated; the master switch, shared by all channels, is left as it is.

The fuse trips at the current limit; it has no level of its own. The over-voltage protection of an NGE100 can be
switched off, that of the others cannot. Assumed, not yet checked against an instrument: several commands fit in a line.
"""

from __future__ import annotations

from dataclasses import replace
from typing import ClassVar

from hil.instruments.scpi_dialect import Dialect, LevelAndFuse, Protection
from hil.instruments.scpi_supply import ScpiSupply

__all__ = ["HMP", "NGE100", "RohdeSchwarzHmp", "RohdeSchwarzNge100"]

_AT = "INST OUT{channel};"
_OVER_VOLTAGE = Protection(
    set_level=_AT + "VOLT:PROT:LEV {value}", get_level=_AT + "VOLT:PROT:LEV?", tripped=_AT + "VOLT:PROT:TRIP?"
)

HMP = Dialect(
    driver="rohde-schwarz-hmp",
    channels=(1, 2, 3, 4),
    decimals=3,
    tolerance=0.0055,
    set_voltage=_AT + "VOLT {value}",
    get_voltage=_AT + "VOLT?",
    set_current=_AT + "CURR {value}",
    get_current=_AT + "CURR?",
    switch_on=_AT + ":OUTP:GEN ON;:OUTP:SEL ON",
    switch_off=_AT + ":OUTP:SEL OFF",
    is_on=_AT + ":OUTP:SEL?",
    measure_voltage=_AT + "MEAS:VOLT?",
    measure_current=_AT + "MEAS:CURR?",
    mode="STAT:QUES:INST:ISUM{channel}:COND?",
    over_voltage=_OVER_VOLTAGE,
    over_current=Protection(tripped=_AT + "FUSE:TRIP?", arm=_AT + "FUSE ON", armed=_AT + "FUSE?"),
    levels=LevelAndFuse,
    ratings={
        "HMP2020": ((32.0, 10.0),) * 2,
        "HMP2030": ((32.0, 10.0),) * 3,
        "HMP4030": ((32.0, 10.0),) * 3,
        "HMP4040": ((32.0, 10.0),) * 4,
    },
)
"""The commands of the HMP series; where a channel's actual rating is lower than here, the instrument refuses."""

NGE100 = replace(
    HMP,
    driver="rohde-schwarz-nge100",
    channels=(1, 2, 3),
    over_voltage=replace(_OVER_VOLTAGE, arm=_AT + "VOLT:PROT:STAT ON", armed=_AT + "VOLT:PROT:STAT?"),
    ratings={"NGE102B": ((32.0, 3.0),) * 2, "NGE103B": ((32.0, 3.0),) * 3},
)
"""The commands of the NGE100 series."""


class RohdeSchwarzHmp(ScpiSupply):
    """Driver `rohde-schwarz-hmp`: role `supply` on each channel; a wire may set `over_voltage` and `over_current`."""

    dialect: ClassVar[Dialect] = HMP


class RohdeSchwarzNge100(ScpiSupply):
    """Driver `rohde-schwarz-nge100`: role `supply` on each channel; wires may set `over_voltage` and `over_current`."""

    dialect: ClassVar[Dialect] = NGE100
