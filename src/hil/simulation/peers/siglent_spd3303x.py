"""A Siglent SPD3303X-E power supply as its remote interface shows it, with its two outputs that can be set.

Facts, from its quick start and public drivers: two outputs of 32 V 3.2 A; a channel stands before the header
(`CH1:VOLT`) or is a parameter; nobody asks whether an output is on, but `SYST:STAT?` gives it in hexadecimal: bits 0
and 1 constant current, 2 and 3 independent (01), parallel (10) or series (11), 4 and 5 on; the identification has a
fifth field; the empty error queue is `0 No Error`. Programs leave about ten milliseconds between lines.

Assumed: a line that comes earlier is lost without a word. Coupled outputs are told, not simulated, and the third
output, which is set by a switch at the front panel, is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from hil.model.notation import AnyText, NotNegative
from hil.simulation.faults import Identity
from hil.simulation.peers.manner import DeviceTruth, Manner
from hil.simulation.peers.scpi import leading_channel
from hil.simulation.peers.scpi_manual import Reading, Setting, Switch, Whole
from hil.simulation.peers.scpi_supply import SupplyManual, model_of
from hil.simulation.peers.supply_output import CoarseTruth, Rating, RefuseOff, SupplyOutput
from hil.wire.checkpoint import Kept

__all__ = ["MODEL", "SiglentTruth"]

_THREE = "{:.3f}".format
_COUPLINGS = {0: 0b01, 1: 0b11, 2: 0b10}  # independent, series, parallel, as `OUTP:TRACK` has them
_RATING = Rating(32.0, 3.2, 32.0, 3.2, 99.0)  # no level of protection that a command could reach


@dataclass(frozen=True, slots=True, kw_only=True)
class SiglentTruth(DeviceTruth):
    """One device."""

    serial: AnyText = "SPD3X000000001"
    firmware: AnyText = "1.01.01.02.07R2,V3.0"
    command_time: NotNegative = 5e-3
    pause_time: NotNegative = 1e-2


@dataclass(frozen=True, slots=True, kw_only=True)
class _SiglentManner(Manner):
    """The words of an empty error queue."""

    no_error: AnyText = "0 No Error"


class _Output(SupplyOutput):
    """One output, and how it is coupled with the other one."""

    coupled: Kept[float] = 0.0


def _status(outputs: Mapping[int, SupplyOutput], now_ns: int) -> str:
    del now_ns
    coupled = max(int(getattr(output, "coupled", 0)) for output in outputs.values())
    bits = _COUPLINGS[coupled] << 2
    for number, output in outputs.items():
        bits |= (output.mode() == "CC") << number - 1 | output.on << 3 + number
    return f"0x{bits:x}"


MODEL = model_of(
    SupplyManual(
        identity="Siglent Technologies,SPD3303X-E,{serial},{firmware}",
        truth=SiglentTruth,
        ratings={1: _RATING, 2: _RATING},
        deviates=CoarseTruth,
        rows=(
            Reading("MEASure:VOLTage", SupplyOutput.read_volts, _THREE),
            Reading("MEASure:CURRent", SupplyOutput.read_amperes, _THREE),
            Reading("MEASure:POWEr", lambda o, ns: o.read_volts(ns) * o.read_amperes(ns), _THREE),
            Setting(
                "CH<n>:VOLTage", "volts", _THREE, lambda r: r.most_volts, write=SupplyOutput.set_volts, by="number"
            ),
            Setting(
                "CH<n>:CURRent", "limit", _THREE, lambda r: r.most_amperes, write=SupplyOutput.set_limit, by="number"
            ),
            Setting("OUTPut:TRACK", "coupled", "{:.0f}".format, lambda _: 2.0, by="selected"),
            Switch("OUTPut", "on", asked=False),
            Whole("SYSTem:STATus", _status),
        ),
        answers={"SYSTem:VERSion": "1.01.01.02.07"},
        selects={"INSTrument": "CH{}"},
        targets=leading_channel,
        error_form="{:d} {}",
        on_off=("OFF", "ON"),
        faults=(Identity, RefuseOff),
        output=_Output,
        manner=_SiglentManner,
    )
)
"""The model for the driver `siglent-spd3303x`."""
