"""Keysight power supplies with one output as their remote interfaces show them: an E36103B and an E3632A.

Facts: no channel lists; in the E36100 series bit 8 of the operation register is constant voltage and bit 10 constant
current, bits 0 and 1 of the questionable register are the protections that tripped; the questionable register of an
E3632A is 0 while its output is off, 1 in constant current, 2 in constant voltage. Its lines end with a carriage return
and a line feed, and its over-voltage protection has a switch, which is on after a reset. Assumed: it stays in its range
of 15 V and 7 A.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from hil.model.notation import AnyText
from hil.simulation.peers.keysight_e36312a import KEYSIGHT, ROWS, KeysightTruth
from hil.simulation.peers.manner import CarriageReturns
from hil.simulation.peers.scpi import no_channel
from hil.simulation.peers.scpi_manual import Reading, Switch
from hil.simulation.peers.scpi_supply import model_of
from hil.simulation.peers.supply_output import Rating, SupplyOutput

__all__ = ["E3632A", "E36103B"]


@dataclass(frozen=True, slots=True, kw_only=True)
class _E36103bTruth(KeysightTruth):
    """One device."""

    serial: AnyText = "MY61000001"
    firmware: AnyText = "1.0.2-1.02"


@dataclass(frozen=True, slots=True, kw_only=True)
class _E3632aTruth(KeysightTruth):
    """One device; this series reports no serial number."""

    serial: AnyText = "0"
    firmware: AnyText = "1.1-5.0-1.0"


def _regulates(output: SupplyOutput, now_ns: int) -> int:
    del now_ns
    return {"off": 0, "CC": 1, "CV": 2}[output.mode()]


def _operates(output: SupplyOutput, now_ns: int) -> int:
    del now_ns
    return {"off": 0, "CV": 256, "CC": 1024}[output.mode()]


_ONE = replace(KEYSIGHT, selects={}, targets=no_channel)

E36103B = model_of(
    replace(
        _ONE,
        identity="Keysight Technologies,E36103B,{serial},{firmware}",
        truth=_E36103bTruth,
        ratings={1: Rating.programmable(20.0, 2.0)},
        rows=(
            *ROWS,
            Reading("STATus:OPERation:CONDition", _operates),
            Reading("STATus:QUEStionable:CONDition", lambda output, _: output.over_voltage + 2 * output.over_current),
        ),
    )
)
"""The model for the driver `keysight-e36100`."""

E3632A = model_of(
    replace(
        _ONE,
        identity="HEWLETT-PACKARD,E3632A,{serial},{firmware}",
        truth=_E3632aTruth,
        ratings={1: Rating.programmable(15.0, 7.0)},
        rows=(
            *ROWS,
            Switch("[SOURce:]VOLTage:PROTection:STATe", "over_voltage_on"),
            Reading("STATus:QUEStionable:CONDition", _regulates),
        ),
        manner=CarriageReturns,
    )
)
"""The model for the driver `keysight-e3632a`."""
