"""Keysight 33500 series function generators: 33509B to 33522B.

Commands: 33500 Series Operating and Service Guide, from memory, to be checked on the first article: `FUNCtion`,
`FREQuency`, `VOLTage`, `VOLTage:OFFSet`, `OUTPut`, `OUTPut:LOAD INFinity` (reads back as 9.9E+37), each with the
channel number in its header; a DC level is set as the offset.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import ClassVar

from hil.instruments import settings
from hil.instruments.driver import Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.role import Role
from hil.instruments.scpi_instrument import ReadBack, ScpiInstrument, ScpiTerminals, SwitchedSpeech
from hil.instruments.scpi_session import as_number, as_switch, as_text
from hil.instruments.signal_roles import FUNCTION_GENERATOR
from hil.model.bench import Proof, Wire
from hil.model.errors import Refused, Rejected
from hil.model.figure import Figure
from hil.model.safing import SafeBytes

__all__ = ["Keysight33500"]

_CHANNELS = (1, 2)
_SHAPES = {"sine": "SIN", "square": "SQU", "ramp": "RAMP", "dc": "DC"}
_CLOSE = 1e-3


class GeneratorOutput(ScpiTerminals):
    """One output; fills the role `function_generator`, always configured for a high-impedance load."""

    fills: ClassVar[Role] = FUNCTION_GENERATOR

    @drives
    def configure(self, shape: str, frequency: float, amplitude: float, offset: float = 0.0) -> None:
        """Set shape, frequency, amplitude and offset; the clamps check the peak voltage first.

        While the output is on, intermediate combinations of old and new settings are checked too.
        """
        if shape not in _SHAPES:
            raise Refused(f"{self._name}: unknown shape '{shape}'", f"it is {', '.join(_SHAPES)}")
        if not all(map(math.isfinite, (frequency, amplitude, offset))) or amplitude < 0 or frequency <= 0:
            raise Refused(f"{self._name}: settings that are no numbers to set", "give finite ones, frequency above 0")
        self._permit(abs(offset) + amplitude / 2)
        if self.enabled():
            swing, shift = self._asked("VOLT") / 2, abs(self._asked("VOLT:OFFS"))
            self._permit(max(abs(offset), shift) + max(amplitude / 2, swing))
        else:  # amplitude plus the old offset might exceed the output range
            self._take("VOLT:OFFS", 0.0)
        self._session.setting(f"OUTP{self._channel}:LOAD INF")
        if not math.isnan(self._session.query(f"OUTP{self._channel}:LOAD?", as_number)):
            raise Rejected(self._device, f"{self._name} counts on a load", "set its load to high impedance")
        self._read_back.word(f"SOUR{self._channel}:FUNC", _SHAPES[shape])
        if shape != "dc":
            self._take("FREQ", frequency)
            self._take("VOLT", amplitude)
        self._take("VOLT:OFFS", offset)

    @drives
    def enable(self) -> None:
        """Switch the output on, if the clamps permit its settings."""
        self._permit(self.peak().value)
        if not self._switch_on():
            raise Rejected(self._device, f"{self._name} was switched on and is off", "check its display")

    @reads
    def peak(self) -> Figure:
        """Return the peak voltage of the present settings in V, as a magnitude."""
        shape = self._session.query(f"SOUR{self._channel}:FUNC?", as_text)
        swing = 0.0 if shape == "DC" else self._asked("VOLT") / 2
        return Figure(value=abs(self._asked("VOLT:OFFS")) + swing, unit="V")

    def safe_bytes(self, state: str, proof: Proof | None = None) -> SafeBytes:
        """Return the bytes that switch off; see `hil.instruments.roles.SafeByBytes`."""
        return self._safe_bytes(state, proof, {})

    def _permit(self, volts: float) -> None:
        self._clamps.permit(self._channel, "peak", volts)

    def _asked(self, what: str) -> float:
        return self._session.query(f"SOUR{self._channel}:{what}?", as_number)

    def _take(self, what: str, value: float) -> None:
        self._read_back.number(f"SOUR{self._channel}:{what}", value, _CLOSE)

    @property
    def _read_back(self) -> ReadBack:
        return ReadBack(self._name, self._device, self._session)


class Keysight33500(ScpiInstrument):
    """Driver `keysight-33500`: role `function_generator` on each of its outputs."""

    roles: ClassVar[frozenset[str]] = frozenset({"function_generator"})
    speech: ClassVar[SwitchedSpeech] = SwitchedSpeech(
        driver="keysight-33500",
        framed=True,
        decimals=4,
        tolerance=1e-3,
        switch_on="OUTP{channel} ON",
        switch_off="OUTP{channel} OFF",
        is_on="OUTP{channel}?",
    )

    def outlets(self) -> Sequence[Outlet]:
        """Query whether each output is on; models `335x1B` and below have one."""
        if not self._session.model:
            self._session.identification()
        return tuple(
            Outlet(channel, self._session.query(f"OUTP{channel}?", as_switch))
            for channel in _CHANNELS[: 2 if self._session.model[3:5] in _TWO else 1]
        )

    def role(self, wire: Wire) -> GeneratorOutput:
        """Return the output that the wire names."""
        settings.fits(wire, self.speech.driver, self.roles, _CHANNELS)
        settings.read(wire, settings.NoSettings)
        return GeneratorOutput(
            name=wire.name,
            device=self._connection.device,
            session=self._session,
            speech=self.speech,
            clamps=self._connection.clamps,
            channel=wire.channel,
        )


_TWO = frozenset({"10", "12", "20", "22"})
"""Digits of the two-output models: 33510B, 33512B, 33520B, 33522B."""
