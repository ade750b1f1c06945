"""A Rohde & Schwarz HMP or NGE100 power supply as its remote interface shows it: one selection, one master switch.

Facts, from public drivers and excerpts of the manuals: commands go to the channel that `INST OUT1` or `INST:NSEL 1` has
selected; `OUTP:SEL` switches a channel's own switch, `OUTP:GEN` the master switch, and a channel gives something where
both are on; switches are asked for as 0 and 1; the fuse trips where the current is limited.

Assumed: a channel that tripped is deselected, and cannot be selected until it is cleared. `OUTP[:STAT]`, which is both
switches in one, is left out.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

from hil.model.notation import AnyText, NotNegative, one_of
from hil.simulation.faults import Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.scpi import ScpiError
from hil.simulation.peers.scpi_manual import Clear, Reading, Setting, Switch
from hil.simulation.peers.scpi_supply import SupplyManual, model_of
from hil.simulation.peers.supply_output import OutputTruth, Rating, RefuseOff, SupplyOutput
from hil.wire.checkpoint import Kept

__all__ = ["HMP", "NGE100", "Nge100Truth", "RohdeSchwarzTruth"]

_THREE, _FOUR = "{:.3f}".format, "{:.4f}".format
_TEN, _THREE_AMPERES = Rating(32.0, 10.0, 32.05, 10.0, 33.0), Rating(32.0, 3.0, 32.0, 3.0, 33.0)
_HMP = {
    "HMP2020": dict.fromkeys((1, 2), _TEN),
    "HMP4030": dict.fromkeys((1, 2, 3), _TEN),
    "HMP4040": dict.fromkeys((1, 2, 3, 4), _TEN),
}
_NGE100 = {
    "NGE102B": dict.fromkeys((1, 2), _THREE_AMPERES),
    "NGE103B": dict.fromkeys((1, 2, 3), _THREE_AMPERES),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class RohdeSchwarzTruth(DeviceTruth):
    """One device."""

    model: Annotated[str, one_of(*_HMP)] = "HMP4040"
    serial: AnyText = "102416"
    firmware: AnyText = "HW50020003/SW2.62"
    command_time: NotNegative = 5e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class Nge100Truth(RohdeSchwarzTruth):
    """One device of the other series."""

    model: Annotated[str, one_of(*_NGE100)] = "NGE103B"
    serial: AnyText = "5601.3800k03/101863"
    firmware: AnyText = "1.54"


class _Output(SupplyOutput):
    """One channel: its own switch, and what it sees of the master switch."""

    selected: Kept[bool]
    general: Kept[bool]

    def _set_up(self) -> None:
        super()._set_up()
        self.selected = self.general = False

    def follow(self, now_ns: int) -> None:
        """Be on where both switches are; one that does not go off says so, or not, as its fault has it."""
        wanted = self.selected and self.general
        if wanted and (self.over_voltage or self.over_current):
            self.selected = False
            raise ScpiError(-221)
        if wanted != self.on or self._stuck_on:
            self.switch(wanted, now_ns)
            self.selected = self.selected or self.on

    def protect(self, now_ns: int) -> None:
        """Trip, and be deselected."""
        was_on = self.on
        super().protect(now_ns)
        self.selected = self.selected and self.on == was_on


def _condition(output: SupplyOutput, now_ns: int) -> int:
    del now_ns
    return {"CC": 1, "CV": 2, "off": 0}[output.mode()]


class _SwitchedOutput(_Output):
    """One channel whose over-voltage protection has a switch, which is off after a reset."""

    def _set_up(self) -> None:
        super()._set_up()
        self.over_voltage_on = False


_MANUAL = SupplyManual(
    identity="ROHDE&SCHWARZ,{model},{serial},{firmware}",
    truth=RohdeSchwarzTruth,
    ratings=_HMP["HMP4040"],
    deviates=OutputTruth,
    rows=(
        Reading("MEASure[:SCALar][:VOLTage][:DC]", SupplyOutput.read_volts, _THREE, by="selected"),
        Reading("MEASure[:SCALar]:CURRent[:DC]", SupplyOutput.read_amperes, _FOUR, by="selected"),
        Setting("[SOURce:]VOLTage", "volts", _THREE, lambda r: r.most_volts, write=SupplyOutput.set_volts),
        Setting("[SOURce:]CURRent", "limit", _FOUR, lambda r: r.most_amperes, write=SupplyOutput.set_limit),
        Setting("[SOURce:]VOLTage:PROTection:LEVel", "protection", _THREE, lambda r: r.most_protection),
        Reading("[SOURce:]VOLTage:PROTection:TRIPped", lambda output, _: output.over_voltage, "{:d}".format),
        Clear("[SOURce:]VOLTage:PROTection:CLEar", ("over_voltage",)),
        Switch("FUSE[:STATe]", "current_protection"),
        Reading("FUSE:TRIPped", lambda output, _: output.over_current, "{:d}".format),
        Switch("OUTPut:SELect", "selected"),
        Switch("OUTPut:GENeral", "general", all=True),
        Reading("STATus:QUEStionable:INSTrument:ISUMmary<n>:CONDition", _condition, by="number"),
    ),
    answers={"*OPC": "1"},
    ignored=("SYSTem:REMote", "SYSTem:LOCal", "SYSTem:MIX"),
    selects={"INSTrument[:SELect]": "OUTP{}", "INSTrument:NSELect": "{}"},
    error_form='{:d},"{}"',
    faults=(Identity, RefuseOff),
    output=_Output,
    of_model=_HMP,
)

HMP = model_of(_MANUAL)
"""The model for the driver `rohde-schwarz-hmp`."""

NGE100 = model_of(
    replace(
        _MANUAL,
        identity="Rohde&Schwarz,{model},{serial},{firmware}",
        truth=Nge100Truth,
        ratings=_NGE100["NGE103B"],
        of_model=_NGE100,
        output=_SwitchedOutput,
        rows=(*_MANUAL.rows, Switch("[SOURce:]VOLTage:PROTection[:STATe]", "over_voltage_on")),
    )
)
"""The model for the driver `rohde-schwarz-nge100`."""
