"""A Keysight E36312A power supply as its remote interface shows it: three outputs, SCPI lines.

Facts: three isolated outputs (6 V 5 A, 25 V 1 A, 25 V 1 A), lines that end with a line feed, executed one after the
other and answered in order. `STAT:QUES:INST:ISUM<n>:COND?` as in this family's guides: bit 0 (1) constant current,
bit 1 (2) constant voltage, both 0 output off; bit 9 (512) and 10 (1024) over-voltage and over-current tripped.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.model.notation import AnyText, NotNegative
from hil.simulation.faults import Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.scpi import channel_list
from hil.simulation.peers.scpi_manual import Clear, Reading, Row, Setting, Switch
from hil.simulation.peers.scpi_supply import SupplyManual, model_of
from hil.simulation.peers.supply_output import NotANumber, OutputTruth, Rating, RefuseOff, SupplyOutput

__all__ = ["KEYSIGHT", "MODEL", "ROWS", "KeysightTruth"]

_LEVEL = "[:LEVel][:IMMediate][:AMPLitude]"
_VOLTS = {"V": 1.0, "MV": 1e-3, "UV": 1e-6, "KV": 1e3}
_AMPERES = {"A": 1.0, "MA": 1e-3, "UA": 1e-6}
_SIX, _TWENTY_FIVE = Rating.programmable(6.0, 5.0), Rating.programmable(25.0, 1.0)
_NR3 = "{:+.8E}".format


@dataclass(frozen=True, slots=True, kw_only=True)
class KeysightTruth(DeviceTruth):
    """One device."""

    serial: AnyText = "MY00000001"
    firmware: AnyText = "2.1.0-1.0.4-1.12"
    command_time: NotNegative = 2e-3
    measure_time: NotNegative = 1e-2


def _targets(parameters: Sequence[str]) -> tuple[list[str], list[int] | None]:
    """Split off a channel list at the end."""
    channels = channel_list(parameters[-1]) if parameters else None
    return list(parameters if channels is None else parameters[:-1]), channels


def _condition(output: SupplyOutput, now_ns: int) -> int:
    del now_ns
    regulation = {"CC": 1, "CV": 2, "off": 0}[output.mode()]
    return regulation + 512 * output.over_voltage + 1024 * output.over_current


ROWS: tuple[Row, ...] = (
    Reading("MEASure[:SCALar][:VOLTage][:DC]", SupplyOutput.read_volts, _NR3),
    Reading("MEASure[:SCALar]:CURRent[:DC]", SupplyOutput.read_amperes, _NR3),
    Setting(
        f"[SOURce:]VOLTage{_LEVEL}",
        "volts",
        _NR3,
        most=lambda rating: rating.most_volts,
        usual=lambda _: 0.0,
        write=SupplyOutput.set_volts,
        units=_VOLTS,
    ),
    Setting(
        f"[SOURce:]CURRent{_LEVEL}",
        "limit",
        _NR3,
        most=lambda rating: rating.most_amperes,
        usual=lambda rating: rating.amperes,
        write=SupplyOutput.set_limit,
        units=_AMPERES,
    ),
    Setting(
        "[SOURce:]VOLTage:PROTection[:LEVel]",
        "protection",
        _NR3,
        most=lambda rating: rating.most_protection,
        usual=lambda rating: rating.most_protection,
        units=_VOLTS,
    ),
    Switch("OUTPut[:STATe]", "on"),
    Switch("[SOURce:]CURRent:PROTection:STATe", "current_protection"),
    Reading("[SOURce:]VOLTage:PROTection:TRIPped", lambda output, _: output.over_voltage, "{:d}".format),
    Reading("[SOURce:]CURRent:PROTection:TRIPped", lambda output, _: output.over_current, "{:d}".format),
    Clear("[SOURce:]VOLTage:PROTection:CLEar", ("over_voltage",)),
    Clear("[SOURce:]CURRent:PROTection:CLEar", ("over_current",)),
    Clear("OUTPut:PROTection:CLEar", ("over_voltage", "over_current")),
)
"""What these manuals have in common; where no channel list is given, the output that was selected is meant."""

KEYSIGHT = SupplyManual(
    identity="Keysight Technologies,E36312A,{serial},{firmware}",
    truth=KeysightTruth,
    ratings={1: _SIX, 2: _TWENTY_FIVE, 3: _TWENTY_FIVE},
    deviates=OutputTruth,
    rows=(
        *ROWS,
        Reading("STATus:QUEStionable:INSTrument:ISUMmary<n>:CONDition", _condition, by="number"),
    ),
    answers={"*OPC": "1", "*TST": "0", "SYSTem:VERSion": "1999.0"},
    ignored=("*OPC", "*WAI", "SYSTem:LOCal", "SYSTem:REMote", "SYSTem:RWLock"),
    selects={"INSTrument[:SELect]": "CH{}", "INSTrument:NSELect": "{}"},
    targets=_targets,
    no_channel=-222,
    error_form='{:+d},"{}"',
    faults=(Identity, NotANumber, RefuseOff),
)
"""The manual of the E36300 series."""

MODEL = model_of(KEYSIGHT)
"""The model for the driver `keysight-e36300`."""
