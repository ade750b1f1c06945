"""Session with a cycler: tagged level 2 commands and their replies."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

from hil.clock.port import Clock
from hil.instruments.cycler.hearing import FIRMWARE, Hearing
from hil.instruments.cycler.lines import Banner, Reading, fields_of, seal
from hil.instruments.cycler.numbered import NumberedLines
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.errors import Garbled, NoReply, Rejected
from hil.wire.port import Port

__all__ = ["CyclerSession", "Status", "drift_between", "refusal"]

_LINES_S = 0.5  # three long lines of 140 bytes at 9600 baud: two that may be sent first, and the reply
_ATTEMPTS = 3
_LAST_TAG = 65_535
_SEAL_AND_END = 7
_FIRMWARE = "compare its firmware with version 2.0 of the protocol"
_MEANINGS = {
    "COMMAND": ("it does not know the command {word}", _FIRMWARE),
    "FIELD": ("it does not understand the field {word}", _FIRMWARE),
    "RANGE": ("that is lower or higher than {word} may be", "choose a value from the table of its settings"),
    "BUSY": ("the test {word} runs", "wait for its end, or stop() it"),
    "STATE": ("its state is {word}", "call prepare() before start(); it acknowledges what ended the last test"),
    "RUN": ("its last test is {word}", "check what else starts tests on it, and prepare the test again"),
    "SETTINGS": ("its settings are not those that were set, their CRC is {word}", "prepare the test again"),
    "ORDER": ("its settings contradict each other, the first is {word}", "see the order of settings on its page"),
    "LIMIT": ("what it measures is beyond {word} already", "check the battery, its wires, and its limits"),
}
_STEP_S = 0.001
_EXCHANGES = 3
_BYTE_S = 10 / 9600


class CyclerSession(Hearing):
    """The host's end of the line, with one command outstanding at a time. See `Hearing`.

    Args:
        device: the instrument's name in the bench file, for messages.
        port: the open byte stream.
        clock: the bench's clock.
        timeout: longest time until a reply begins on a free line [s].

    Attributes:
        within_s: longest wait for one reply [s], including lines sent before it.
        tag: tag of the last command.
        sent_bytes: length of the last command.
        reply_bytes: length of its reply.
    """

    def __init__(self, device: str, port: Port, clock: Clock, *, timeout: float = LONGEST_REPLY_S) -> None:
        super().__init__(device, port, clock)
        self.within_s = timeout + _LINES_S
        self.tag = 0
        self.sent_bytes = 0
        self.reply_bytes = 0
        self._line = b""
        self._prefix = b""  # of the outstanding reply
        self._words: str | None = None

    def reopened(self) -> None:
        """Discard all that was received, and the outstanding reply."""
        super().reopened()
        self._prefix, self._words = b"", None

    def ask(self, command: str) -> str:
        """Send a command, and return the text after OK; without a reply, resend the same bytes.

        Raises:
            Rejected: the device answers with an error.
            NoReply, Garbled: it does not answer, or its reply is damaged.
        """
        damaged = self.numbered().damaged
        if self._prefix:
            self.listen(self.within_s, lambda: self.answer() is not None)
        self.send(command)
        for attempt in range(_ATTEMPTS):
            if attempt:
                self.send_again()
            self.listen(self.within_s, lambda: self.answer() is not None)
            if (words := self.answer()) is not None:
                return self.judged(command, words)
        self.in_step = False
        self._prefix = b""
        if self.numbered().damaged > damaged:
            raise Garbled(
                self.device,
                f"asked {command}, and the reply is damaged",
                "check the line's speed, 9600, and the USB cable",
            )
        raise NoReply(self.device, f"asked {command}, and no reply came", "check its power and its USB cable")

    def send(self, command: str) -> int:
        """Send a command without waiting, and return its tag; a line end first clears any pending partial line."""
        self.tag = self.tag % _LAST_TAG + 1
        self._prefix, self._words = b":%d " % self.tag, None
        self._line = (b"" if self.in_step else b"\n") + seal(f":{self.tag} {command}")
        self.in_step = True
        self.sent_bytes = len(self._line)
        self.write(self._line)
        return self.tag

    def send_again(self) -> None:
        """Resend the last command's bytes."""
        self.write(self._line)

    def answer(self) -> str | None:
        """Return the text after the tag if the last command's reply has come; other replies are late duplicates."""
        if self._prefix and isinstance(self.told, NumberedLines):
            replies, self.told.replies = self.told.replies, []
            for reply in replies:
                if reply.startswith(self._prefix):
                    self._words = reply[len(self._prefix) :].decode("ascii", "replace")
                    self._prefix = b""
                    self.reply_bytes = len(reply) + _SEAL_AND_END
                    break
        return self._words

    def fields(self, command: str) -> Mapping[str, str]:
        """Send a query, and return the fields of its reply.

        Raises:
            DeviceFault: as `ask`; Garbled where the reply is not fields.
        """
        words = self.ask(command)
        try:
            return fields_of(words)
        except ValueError as error:
            raise self.nonsense(words) from error

    def identify(self) -> Banner:
        """Query the identity of a level 2 device.

        Raises:
            DeviceFault: as `fields`.
        """
        told = self.fields("ID")
        try:
            found = Banner.of_reply(told)
        except (KeyError, ValueError) as error:
            raise self.nonsense(str(dict(told))) from error
        if self.banner is not None and self.banner.boots != found.boots:
            self.went_back(self.numbered(), running=self.numbered().running)
        self.banner = found
        return found

    def judged(self, command: str, words: str) -> str:
        """Return the text after OK; Rejected if the reply is an error, Garbled if it is neither."""
        result, _, rest = words.partition(" ")
        if result == "ERROR":
            raise refusal(self.device, command, rest)
        if result != "OK":
            raise self.nonsense(words)
        return rest

    def numbered(self) -> NumberedLines:
        """Return what a level 2 device has reported; Garbled if it no longer is one."""
        told = self.meet()
        if not isinstance(told, NumberedLines):
            raise Garbled(self.device, "it speaks level 1", FIRMWARE)
        return told


def refusal(device: str, command: str, words: str) -> Rejected:
    """Return the fault for an ERROR reply; `words` are the error's name and detail."""
    name, _, word = words.partition(" ")
    meaning, hint = _MEANINGS.get(name, (f"it answers ERROR {words}", _FIRMWARE))
    return Rejected(device, f"it refuses {command}: {meaning.format(word=word)}", hint)


@dataclass(frozen=True, slots=True, kw_only=True)
class Status:
    """One exchange of STATE.

    Attributes:
        run: identifier of the last test, `-` if there was none.
        relays: the closed relay: `C`, `D` or `-`.
        reading: present measurements.
        device_ms: unwrapped device time.
        low_s: earliest bench time of the device's timestamp: until then the query was still on the line.
        high_s: latest bench time of the timestamp: by then the reply was on the line.
    """

    run: str
    relays: str
    reading: Reading
    device_ms: int
    low_s: float
    high_s: float

    @classmethod
    def ask(cls, session: CyclerSession) -> Self:
        """Query the state, and continue the reported state from the reply.

        Raises:
            DeviceFault: the device does not answer, or answers nonsense.
        """
        told = session.numbered()
        running, sent_s = told.running, session.clock.now()
        words = session.fields("STATE")
        received_s = session.clock.now()
        try:
            voltage, current, energy, temperature = (float(words[name]) for name in "viet")
            state, cycle, lines = words["state"].lower(), float(words["cycle"]), int(words["lines"])
            device_ms = told.resume(lines, int(words["ms"]), state, cycle)
            found = cls(
                run=words["run"],
                relays=words["relays"],
                reading=(voltage, current, energy, temperature),
                device_ms=device_ms,
                low_s=min(sent_s + session.sent_bytes * _BYTE_S, received_s),
                high_s=max(received_s - session.reply_bytes * _BYTE_S, sent_s),
            )
        except (KeyError, ValueError) as error:
            raise session.nonsense(" ".join(f"{name}={value}" for name, value in words.items())) from error
        if told.went_back:
            session.went_back(told, running=running)
        told.reading, told.read_s, told.heard_s = found.reading, received_s, received_s
        return found

    @classmethod
    def ask_for_time(cls, session: CyclerSession) -> Self:
        """Query the state a few times, and return the quickest exchange, which dates the device's time best.

        Raises:
            DeviceFault: as `ask`.
        """
        return min((cls.ask(session) for _ in range(_EXCHANGES)), key=lambda status: status.spread_s)

    @property
    def middle_s(self) -> float:
        """Bench time assigned to the device's timestamp."""
        return (self.low_s + self.high_s) / 2

    @property
    def spread_s(self) -> float:
        """Distance between the bounds of the timestamp in s; they cross where the line is faster than specified."""
        return abs(self.high_s - self.low_s)

    @property
    def uncertainty(self) -> float:
        """Standard uncertainty of `middle_s` in s: the timestamp lies between the bounds, with a resolution of 1 ms."""
        return math.hypot(self.spread_s, _STEP_S) / math.sqrt(12)


def drift_between(first: Status, last: Status) -> tuple[float, float] | tuple[None, None]:
    """Return the relative drift of the device's clock against the bench's, and its standard uncertainty.

    The drift is the ratio of elapsed device time to elapsed bench time, minus 1; None where no time elapsed.
    """
    seconds = last.middle_s - first.middle_s
    if seconds <= 0:
        return None, None
    drift = (last.device_ms - first.device_ms) * _STEP_S / seconds - 1.0
    return drift, math.hypot(first.uncertainty, last.uncertainty) / seconds
