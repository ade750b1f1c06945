"""The guardian's dialogue with every peer behind a line that delays replies, up to just below the instrument's limit.

All time is virtual. What is in flight when the guardian begins says that the output is safe, as an executive may have
asked right before it switched on.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest
from by_bytes import BY_BYTES, SCPI, rig
from sweeps import sample

from hil.guardian.ports.dialogue import Dialogue, Patience

_STEP_S = 0.005
_TRIES = 40
_BETWEEN_S = 0.3
LATENCIES_S = (0.04, 0.07, 0.1, 0.2, 0.45)
SWEEP = pytest.mark.parametrize(
    ("name", "latency_s", "rises"),
    [
        each
        for name in BY_BYTES
        for each in sample([*itertools.product([name], LATENCIES_S, [False]), (name, 0.45, True), (name, 0.1, True)], 3)
    ],
)


_OTHERWISE = {"line_end": "crlf", "switches": "words", "numbers": "unit", "no_error": "0 No Error"}
FIRMWARE = [
    *((name, _OTHERWISE) for name in SCPI),
    *((name, {"echo": True, "line_end": "crlf"}) for name in ("keysight-e36300", "rigol-dp832")),
    *(("korad-ka3005p", {"reply_end": end}) for end in ("lf", "crlf", "nul")),
    ("newport-esp301", {"controller": "ESP301-3N", "axes": "1", "identifies": "empty"}),
]


class DelayedLine:
    """What the guardian's `Line` is, on a simulated line and its clock; every byte comes later, in order."""

    def __init__(self, line, clock, latency_s):
        self._line, self._clock = line, clock
        self.latency_s = latency_s
        self.busy_until = clock.now()
        self._coming = []

    def now(self):
        """Return the bench's time."""
        return self._clock.now()

    def hear(self, until):
        """Return what has come by then."""
        while True:
            self.late(self._line.read(4096, _STEP_S))
            came = b""
            while self._coming and self._coming[0][0] <= self.now():
                came += self._coming.pop(0)[1]
            if came:
                self.busy_until = self.now()
                return came
            if self.now() >= until:
                return b""

    def late(self, data):
        """Let bytes come after the latency."""
        if data:
            due = self.now() + self.latency_s
            self._coming.append((max(due, self._coming[-1][0]) if self._coming else due, data))

    def say(self, data, _until):
        """Write."""
        self._line.write(data)
        self.busy_until = max(self.busy_until, self.now())
        return len(data)


def safe_replies(found, code):
    """Return what the instrument says to every question of a proof while the output is safe."""
    said = b""
    for each in code.proof:
        while found.line.read(4096, each.quiet_s):
            pass
        found.line.write(each.send)
        said += found.line.read(4096, 0.4)
    return said


def proven(found, talk, code):
    """Do what the guardian does after a death: in a hurry first, then as often as it takes."""
    hurry = Patience(0.25)
    talk.begin(code, hurry)
    talk.off(code, hurry)
    for _ in range(_TRIES if code.off else 4):
        talk.begin(code, Patience())
        talk.off(code, Patience())
        if not (wrong := talk.prove(code)):
            return ""
        found.clock.sleep(_BETWEEN_S)
    return wrong


@SWEEP
def test_late_replies_are_matched_with_their_questions(name, latency_s, rises):
    """Drilled, switched on, and proven off; what ignores every command is never proven, whatever is in flight."""
    must_match(BY_BYTES[name], latency_s, rises=rises)


@pytest.mark.parametrize("latency_s", sample([*LATENCIES_S], 2))
@pytest.mark.parametrize(("name", "firmware"), FIRMWARE)
def test_late_replies_are_matched_however_the_firmware_writes_them(name, firmware, latency_s):
    """The same with ends of lines, words, units, echoes and names that differ from the manual's."""
    must_match(BY_BYTES[name], latency_s, truth=firmware)


def must_match(kind, latency_s, *, rises=False, truth=None):
    """Drill, switch on, and prove off with late replies."""
    with rig(kind, truth=truth) as found:
        found.driver.identify()
        code = found.code(kind.proof)
        line = DelayedLine(found.line, found.clock, 0.002 if rises else latency_s)
        talk = Dialogue(line)
        talk.begin(code, Patience())
        assert talk.off(code, Patience()) == ""
        assert talk.prove(code) == ""
        assert talk.prove(code) == ""  # a port has several outputs
        safe = safe_replies(found, code)
        kind.drive(found)
        line.latency_s = latency_s
        line.late(safe)
        assert proven(found, talk, replace(code, off=()))
        assert found.on()
        line.late(safe)
        assert proven(found, talk, code) == ""
        assert not found.on()


@pytest.mark.parametrize("name", BY_BYTES)
def test_what_is_silent_is_asked_once_in_a_round(name):
    """Further outputs of its port do not wait for it again."""
    kind = BY_BYTES[name]
    with rig(kind) as found:
        found.driver.identify()
        code = found.code(kind.proof)
        line = DelayedLine(found.line, found.clock, 10.0)
        talk = Dialogue(line)
        talk.begin(code, Patience())
        wrong = talk.prove(code)
        assert "said nothing" in wrong
        before = found.clock.now()
        assert talk.prove(code) == wrong
        assert found.clock.now() == before
