"""Keysight E36311A, E36312A and E36313A triple-output power supplies.

Commands: E36300 Series Programming Guide (E36311-90008). Outputs can be set to 103 % of their rating. The third
output of an E36311A is negative, which the role does not support, so it is only ever set to 0 V.
"""

from __future__ import annotations

from typing import ClassVar

from hil.instruments.scpi_dialect import Dialect, Protection
from hil.instruments.scpi_supply import ScpiSupply

__all__ = ["E36300", "KeysightE36300"]

E36300 = Dialect(
    driver="keysight-e36300",
    channels=(1, 2, 3),
    decimals=4,
    tolerance=0.002,
    set_voltage="VOLT {value},(@{channel})",
    get_voltage="VOLT? (@{channel})",
    set_current="CURR {value},(@{channel})",
    get_current="CURR? (@{channel})",
    switch_on="OUTP ON,(@{channel})",
    switch_off="OUTP OFF,(@{channel})",
    is_on="OUTP? (@{channel})",
    measure_voltage="MEAS:VOLT? (@{channel})",
    measure_current="MEAS:CURR? (@{channel})",
    mode="STAT:QUES:INST:ISUM{channel}:COND?",
    over_voltage=Protection(
        set_level="VOLT:PROT {value},(@{channel})",
        get_level="VOLT:PROT? (@{channel})",
        tripped="VOLT:PROT:TRIP? (@{channel})",
    ),
    ratings={
        "E36311A": ((6.18, 5.15), (25.75, 1.03), (0.0, 1.03)),
        "E36312A": ((6.18, 5.15), (25.75, 1.03), (25.75, 1.03)),
        "E36313A": ((6.18, 10.3), (25.75, 2.06), (25.75, 2.06)),
    },
    framed=True,
)
"""The commands of the E36300 series."""


class KeysightE36300(ScpiSupply):
    """Driver `keysight-e36300`: role `supply` on channels 1 to 3; a wire may set `over_voltage`."""

    dialect: ClassVar[Dialect] = E36300
