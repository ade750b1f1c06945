"""Rigol DL3021 and DL3021A electronic loads: 150 V, 40 A, 200 W.

Commands: from public drivers of the DL3000 series. From memory, to be checked on the first article: the ends of the
ranges, and that the mode is reported as `CC` or as the function's name. As with Rigol's supplies, an identification
query closes each reply.
"""

from __future__ import annotations

from typing import ClassVar

from hil.instruments.scpi_load import LoadDialect, LoadMode, ScpiLoad

__all__ = ["DL3000", "RigolDl3021"]


def _mode(quantity: str, word: str, *ranges: float) -> LoadMode:
    return LoadMode(
        quantity=quantity,
        choose=f":SOUR:FUNC {word}",
        set_level=f":SOUR:{word}:LEV:IMM {{value}}",
        get_level=f":SOUR:{word}:LEV:IMM?",
        set_range=f":SOUR:{word}:RANG {{value}}" if ranges else "",
        ranges=ranges,
    )


DL3000 = LoadDialect(
    driver="rigol-dl3021",
    decimals=4,
    tolerance=0.0055,
    switch_on=":SOUR:INP:STAT ON",
    switch_off=":SOUR:INP:STAT OFF",
    is_on=":SOUR:INP:STAT?",
    modes={
        "CC": _mode("current", "CURR", 4.0, 40.0),
        "CR": _mode("resistance", "RES", 15.0, 15000.0),
        "CP": _mode("power", "POW"),
        "CV": _mode("voltage", "VOLT", 15.0, 150.0),
    },
    which=":SOUR:FUNC?",
    said={
        **{name: name for name in ("CC", "CR", "CP", "CV")},
        "CURR": "CC",
        "RES": "CR",
        "POW": "CP",
        "VOLT": "CV",
    },
    measure={
        "voltage": ":MEAS:VOLT?",
        "current": ":MEAS:CURR?",
        "power": ":MEAS:POW?",
        "resistance": ":MEAS:RES?",
    },
    error_query=":SYST:ERR?",
)
"""The commands of the DL3000 series."""


class RigolDl3021(ScpiLoad):
    """Driver `rigol-dl3021`: role `electronic_load`."""

    dialect: ClassVar[LoadDialect] = DL3000
