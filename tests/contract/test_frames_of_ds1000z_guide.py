"""The oscilloscope's driver against the answers that its programming guide prints, and no peer of ours."""

from __future__ import annotations

import numpy as np
import pytest

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.rigol_ds1000z import RigolDs1000z
from hil.model.bench import Wire
from hil.model.errors import Garbled

PREAMBLE = b"0,2,600,2,0.000001,-0.000006,0,0.008000,50,127"
"""The guide's example of `:WAVeform:PREamble?`, but for its interval: it is printed as 0.000000."""

DATA = b"#9000000015" + bytes([0x8E] * 15)
"""A TMC header with nine digits, and the guide's first byte: (0x8E - YORigin - YREFerence) x YINCrement."""


class Guide:
    """Answers each question as the guide does; what is set is what is read back."""

    def __init__(self, **changed):
        self.timeout, self._ready, self._set = 0.5, b"", {}
        self._answers = {
            "*IDN?": b"RIGOL TECHNOLOGIES,DS1104Z,DS1ZA000000001,00.04.01",
            ":SYST:ERR?": b'0,"No error"',
            ":TRIG:STAT?": b"TD",
            ":WAV:PRE?": PREAMBLE,
            ":WAV:DATA?": DATA,
            **changed,
        }

    @property
    def in_waiting(self):
        """Nothing comes unasked."""
        return len(self._ready)

    def write(self, data):
        """Take a line."""
        line = data.decode().strip()
        if line.endswith("?"):
            self._ready += self._answers.get(line) or self._set[line[:-1]]
            self._ready += b"\n"
        else:
            header, _, value = line.partition(" ")
            self._set[header] = value.encode()

    def read(self, size=1):
        """Give bytes."""
        data, self._ready = self._ready[:size], self._ready[size:]
        return data

    def read_line(self, terminator=b"\n", limit=4096):
        """Give a line."""
        return self.read(self._ready.find(terminator) + 1)


def captured(port):
    """Return the frame and the rows of a capture of 2 us before to 12 us after the trigger."""
    driver = RigolDs1000z(Connection(device="scope1", clock=VirtualClock(), clamps=Clamps(), port=port))
    found = driver.role(Wire(role="oscilloscope", instrument="scope1", settings={"ch1": "rail"}))
    found.vertical("rail", 0.2, 0.4)
    found.window(2e-6, 12e-6)
    found.trigger("rail", 0.1)
    found.arm()
    frame = found.frame()
    return frame, np.concatenate(list(found.blocks(frame)))


def test_bytes_become_volts_as_the_guide_says():
    """The first point lies 6 us before the trigger, so that the window begins with the fifth."""
    port = Guide()
    frame, rows = captured(port)
    assert (frame.interval, frame.rows) == (1e-6, 15)
    assert rows[:, 0] == pytest.approx(np.arange(-2, 13) * 1e-6)
    assert rows[:, 1] == pytest.approx((0x8E - 50 - 127) * 0.008)
    assert (port._set[":WAV:STAR"], port._set[":WAV:STOP"]) == (b"5", b"19")
    assert (frame.screens[0].low, frame.screens[0].high) == pytest.approx((-177 * 0.008, 78 * 0.008))


@pytest.mark.parametrize(
    "answers",
    [
        {":WAV:PRE?": b"0,2,600,2,0.000000,-0.000006,0,0.008000,50,127"},
        {":WAV:PRE?": b"1,2,600,2,0.000001,-0.000006,0,0.008000,50,127"},
        {":WAV:PRE?": b"0,2,600"},
        {":WAV:DATA?": b"#9000000014" + bytes(14)},
        {":WAV:DATA?": b"#900000001" + bytes(15)},
        {":WAV:DATA?": b"0.1,0.2"},
        {":TRIG:STAT?": b"READY"},
    ],
)
def test_other_answers_are_refused(answers):
    """Another format, a length that does not hold, text in place of a block."""
    with pytest.raises(Garbled):
        captured(Guide(**answers))
