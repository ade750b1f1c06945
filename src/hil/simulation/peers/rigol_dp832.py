"""A Rigol DP832 power supply as its remote interface shows it: three outputs, SCPI lines, and no hurry.

Facts, from the DP800 programming guide: two outputs of 30 V 3 A and one of 5 V 3 A; lines that end with a line feed; a
channel is a parameter (`CH1`), a number in the header (`:SOUR1`), or the one that `:INST` has selected; switches are ON
and OFF, trips YES and NO. Programs leave about ten milliseconds between lines. Assumed: a line that comes earlier is
lost without a word, and several answers of one line come joined by `;`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from hil.model.notation import AnyText, NotNegative
from hil.simulation.faults import Identity
from hil.simulation.peers.manner import DeviceTruth
from hil.simulation.peers.scpi import leading_channel
from hil.simulation.peers.scpi_manual import By, Clear, Numbers, Reading, Row, Setting, Switch
from hil.simulation.peers.scpi_supply import SupplyManual, model_of
from hil.simulation.peers.supply_output import CoarseTruth, Rating, RefuseOff, SupplyOutput

__all__ = ["MODEL", "RigolTruth"]

_LEVEL = "[:LEVel][:IMMediate][:AMPLitude]"
_SOURCES: tuple[tuple[str, By], ...] = (("[SOURce:]", "selected"), ("SOURce<n>:", "number"))
_MODES = {"CV": "CV", "CC": "CC", "off": "UR"}
_FOUR, _THREE = "{:.4f}".format, "{:.3f}".format
_THIRTY = Rating(30.0, 3.0, 32.0, 3.2, 33.0, 3.3)
_FIVE = Rating(5.0, 3.0, 5.3, 3.2, 5.5, 3.3)


@dataclass(frozen=True, slots=True, kw_only=True)
class RigolTruth(DeviceTruth):
    """One device."""

    serial: AnyText = "DP8C000000001"
    firmware: AnyText = "00.01.16"
    command_time: NotNegative = 5e-3
    pause_time: NotNegative = 1e-2


def _all(output: SupplyOutput, now_ns: int) -> str:
    volts, amperes = output.read_volts(now_ns), output.read_amperes(now_ns)
    return f"{volts:.4f},{amperes:.4f},{volts * amperes:.3f}"


def _sources() -> tuple[Setting, ...]:
    """Return voltage and current, by the header's number or the selection."""
    volts, amperes = f"VOLTage{_LEVEL}", f"CURRent{_LEVEL}"
    return tuple(
        row
        for header, by in _SOURCES
        for row in (
            Setting(header + volts, "volts", _THREE, lambda r: r.most_volts, write=SupplyOutput.set_volts, by=by),
            Setting(header + amperes, "limit", _FOUR, lambda r: r.most_amperes, write=SupplyOutput.set_limit, by=by),
        )
    )


def _protection(
    name: str, *, switch: str, latch: str, level: str, form: Callable[..., str], most: Callable[[Rating], float]
) -> tuple[Row, ...]:
    """Return the headers of one protection, from the output's attributes."""

    def tripped(output: SupplyOutput, now_ns: int) -> str:
        del now_ns
        return "YES" if getattr(output, latch) else "NO"

    return (
        Switch(f"OUTPut:{name}[:STATe]", switch),
        Setting(f"OUTPut:{name}:VALue", level, form, most),
        Reading(f"OUTPut:{name}:QUES", tripped),
        Reading(f"OUTPut:{name}:ALAR", tripped),
        Clear(f"OUTPut:{name}:CLEAR", (latch,)),
    )


MODEL = model_of(
    SupplyManual(
        identity="RIGOL TECHNOLOGIES,DP832,{serial},{firmware}",
        truth=RigolTruth,
        ratings={1: _THIRTY, 2: _THIRTY, 3: _FIVE},
        deviates=CoarseTruth,
        rows=(
            Reading("MEASure[:VOLTage][:DC]", SupplyOutput.read_volts, _FOUR),
            Reading("MEASure:CURRent[:DC]", SupplyOutput.read_amperes, _FOUR),
            Reading("MEASure:POWEr[:DC]", lambda o, ns: o.read_volts(ns) * o.read_amperes(ns), _THREE),
            Reading("MEASure:ALL[:DC]", _all),
            *_sources(),
            Numbers("APPLy", _sources()[:2]),
            Switch("OUTPut[:STATe]", "on"),
            Reading("OUTPut:MODE", lambda output, _: _MODES[output.mode()]),
            Reading("OUTPut:CVCC", lambda output, _: _MODES[output.mode()]),
            *_protection(
                "OVP",
                switch="over_voltage_on",
                latch="over_voltage",
                level="protection",
                form=_THREE,
                most=lambda rating: rating.most_protection,
            ),
            *_protection(
                "OCP",
                switch="current_protection",
                latch="over_current",
                level="over_current_level",
                form=_FOUR,
                most=lambda rating: rating.most_over_current or 0.0,
            ),
        ),
        answers={"*OPC": "1"},
        ignored=("SYSTem:REMote", "SYSTem:LOCal"),
        selects={"INSTrument[:SELect]": "", "INSTrument:NSELect": "{}"},
        targets=leading_channel,
        error_form='{:d},"{}"',
        on_off=("OFF", "ON"),
        watches=True,
        faults=(Identity, RefuseOff),
    )
)
"""The model for the driver `rigol-dp832`."""
