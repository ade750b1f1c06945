"""Level 2: lines with a checksum, numbered and timestamped by the device."""

from __future__ import annotations

from binascii import crc_hqx

from hil.instruments.cycler.lines import BANNER, Banner, Told

__all__ = ["NumberedLines"]

_DATA = frozenset(b"-0123456789")
_REPLY = ord(":")
_WRAP = 1 << 32
_HALF = _WRAP >> 1
_MS = 0.001
_MOST_DRIFT = 1.01 * _MS
"""Longest duration in s of a device millisecond: its clock is a ceramic resonator."""
_PHASES = {b"C": ("charge", 1.0), b"D": ("discharge", -1.0), b"R": ("rest", 0.0)}
_OVER = {b"IDLE": "idle", b"ENDED": "ended", b"STOPPED": "stopped", b"TEST END": "ended", b"TEST STOPPED": "stopped"}
_FEW = 16
_SEALED_CODE = 6  # a letter and the checksum
_ITERATION, _TRIPPED, _STATE_TRIPPED = b"TEST ITERATION ", b"TEST TRIPPED ", b"TRIPPED "


class NumberedLines(Told):
    """Everything a level 2 device has reported.

    Attributes:
        replies: replies not handled yet, checksums removed.
        unsure: whether a lost line may have reported the state.
        went_back: whether line number or time went back without a banner.
        nonsense: a line whose checksum is valid but which has no meaning.
        rests: whether rests are configured, so that one follows a half-cycle.
        zero_ms: device time from which rows count.
        number: of the newest numbered line, None before the first.
    """

    level = "2.0"

    def __init__(self, now: float) -> None:
        super().__init__(now)
        self.replies: list[bytes] = []
        self.unsure = False
        self.went_back = False
        self.nonsense = b""
        self.rests = False
        self.zero_ms = 0.0
        self.number: int | None = None
        self._ms = 0
        self._wrapped_ms = 0  # added for wraps of the counter

    def take(self, lines: list[bytes], now: float) -> None:
        """Take complete lines, line ends stripped, in order, at bench time `now`."""
        last_ms, last_s = self._ms + self._wrapped_ms, self.heard_s
        done = 0
        while done < len(lines):
            done += self._in_a_row(lines[done:] if done else lines, now)
            if done < len(lines):
                self._take_one(lines[done], now)
                done += 1
        passed_ms = self._ms + self._wrapped_ms - last_ms
        if passed_ms > 0 and not self.started:
            self._date(last_s + passed_ms * _MOST_DRIFT, now)

    def _take_one(self, line: bytes, now: float) -> None:
        """Take one line of any kind."""
        body = line[:-5]
        if not body or line[-5:-4] != b"*" or b"%04X" % crc_hqx(body, 0xFFFF) != line[-4:]:
            self.damaged += bool(line)
            return
        self.heard_s = now
        try:
            if body[0] in _DATA:
                self._data(body, now)
            elif body[0] == _REPLY:
                self.replies.append(body)
            else:
                self._mark(body)
        except (ValueError, KeyError):
            self.nonsense = line

    def _in_a_row(self, lines: list[bytes], now: float) -> int:
        """Take the leading run of consecutive data lines of one phase; return their number."""
        first, last_ms, taken = self.number, self._ms, 0
        if first is None or not self.recording:
            return 0
        wrapped_ms, zero_ms, rows, reading = self._wrapped_ms, self.zero_ms, self.rows, self.reading
        state, phase, cycle = self.state, self.phase, self.cycle
        try:
            for number, line in enumerate(lines, start=first + 1):
                voltage, current, energy, temperature, told, ms, code = line.split(b";")
                at_ms = int(ms)
                if (
                    int(told) != number
                    or at_ms < last_ms
                    or len(code) != _SEALED_CODE
                    or _PHASES[code[:1]][0] != state
                    or b"*%04X" % crc_hqx(line[:-5], 0xFFFF) != code[1:]
                    or line[0] not in _DATA
                ):
                    break
                reading = (float(voltage), float(current), float(energy), float(temperature))
                rows += ((at_ms + wrapped_ms - zero_ms) * _MS, *reading, phase, cycle)
                last_ms = at_ms
                taken += 1
        except (ValueError, KeyError):
            pass  # handled line by line
        if taken:
            self.number = first + taken
            self._ms = last_ms
            self.frames += taken
            self.reading, self.read_s = reading, now
            self.heard_s = now
        return taken

    def device_ms(self, ms: int) -> int:
        """Return unwrapped device time in ms for a line's timestamp; lines come in order of time."""
        if ms < self._ms:
            if self._ms - ms > _HALF:
                self._wrapped_ms += _WRAP
            else:
                self.went_back = True
        self._ms = ms
        return ms + self._wrapped_ms

    def resume(self, number: int, ms: int, state: str, cycle: float) -> int:
        """Continue from a STATE reply: last line number, time, state, cycle; return the unwrapped time in ms.

        A reply older than the newest line adds nothing; one that is much older means that the device has restarted.
        """
        back = 0 if self.number is None else self.number - number
        if back > 0:
            self.went_back = back > _FEW
            return self._ms + self._wrapped_ms - (self._ms - ms) % _WRAP
        self._count_missing(-back)
        self.number = number
        self.unsure = False
        if state in _STATES:
            self.state, self.phase, self.cycle = state, _STATES[state], cycle
        elif self.state.partition(" ")[0] != state:
            self.over(state)
            self.cycle = cycle
        return self.device_ms(ms)

    def forget(self) -> None:
        """Discard line number, time and state: the device has started without a banner."""
        self.over("idle")
        self.cycle = 0.0
        self.unsure = self.went_back = False
        self.number, self._ms, self._wrapped_ms = None, 0, 0

    def _date(self, by_s: float, now: float) -> None:
        """Note that the newest line came by `by_s`, though it was read at `now`: it may have waited in the buffer."""
        if by_s < now:
            self.heard_s = by_s
            if self.read_s == now:
                self.read_s = by_s

    def _data(self, body: bytes, now: float) -> None:
        voltage, current, energy, temperature, number, ms, code = body.split(b";")
        self._follow(int(number))
        at_ms = self.device_ms(int(ms))
        reading = (float(voltage), float(current), float(energy), float(temperature))
        self.state, self.phase = _PHASES[code]
        self.reading, self.read_s = reading, now
        if self.recording:
            self.frames += 1
            self.rows += ((at_ms - self.zero_ms) * _MS, *reading, self.phase, self.cycle)

    def _mark(self, body: bytes) -> None:
        text, number, ms, *_more = body.split(b";")
        if text == BANNER:
            self._restart(Banner.of_mark(body), int(number), int(ms))
            return
        self._follow(int(number))
        self.device_ms(int(ms))
        self.frames += self.recording
        if text in _OVER:
            self._is_over(_OVER[text])
        elif text.startswith(_ITERATION):
            self.charging(float(text[len(_ITERATION) :]))
        elif text.startswith((_TRIPPED, _STATE_TRIPPED)):
            self._is_over(f"tripped {text.rpartition(b' ')[2].decode('ascii')}")
        elif text == b"CHARGE END":
            self.state, self.phase = ("rest", 0.0) if self.rests else ("discharge", -1.0)
        elif text == b"DISCHARGE END" and self.rests:
            self.state, self.phase = "rest", 0.0

    def _is_over(self, state: str) -> None:
        """Note a state without a running test; a reading taken by STATE in it stays valid."""
        if self.state != state:
            self.over(state)

    def _restart(self, banner: Banner, number: int, ms: int) -> None:
        self.restart(banner)
        self.number, self._ms, self._wrapped_ms = number, ms, 0
        self.unsure = self.went_back = False

    def _follow(self, number: int) -> None:
        """Take the next line's number, and count the lines missing before it."""
        if self.number is not None and number != self.number + 1:
            self._count_missing(number - self.number - 1)
        self.number = number

    def _count_missing(self, missing: int) -> None:
        missing %= _WRAP
        if missing >= _HALF:
            self.went_back = True
        elif missing:
            self.unsure = True
            if self.recording:
                self.lost += missing


_STATES = dict(_PHASES.values())
