"""Serial line of a Korad supply: commands without a terminator, fixed-width replies, a pause after each.

Nothing in a reply shows which query it answers, where it begins or where it ends. So a query is sent on a silent line,
its reply must have exactly the expected width and form and be followed by silence, and then the identification is
queried. The instrument answers in order: stray bytes make a reply too long, or push it to where the identification
should be. A reply that proves a state must come twice, the same, before that.

Some firmware ends every reply with a line feed, carriage return and line feed, or NUL. Which one is learnt from the
identification; no other is accepted, and a terminator alone is not a reply.

After a fault a late reply may still come: the driver listens until the line is silent, and then the identification must
be complete; it is learnt afresh.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

from hil.clock.port import Clock
from hil.instruments.pacing import PacedPort
from hil.instruments.safing import LONGEST_REPLY_S
from hil.model.errors import DeviceFault, Garbled, NoReply
from hil.model.safing import Exchange, SafeBytes
from hil.wire.port import Port

__all__ = ["KoradLine", "Question", "switched_off"]

_SILENCE_S = 0.05  # what the supply needs between commands; no byte may come in it
_SAFE_SILENCE_S = 0.06
"""The same, plus the time until the last byte has left the adapter."""
_ATTEMPTS = 3
_MOST_LISTENED = 10
_MOST_BYTES = 64
_AFTER_IDENTIFICATION = b"\x01"  # some units send it after the text
_ENDS = (b"\r\n", b"\n", b"\0")  # the longest first
_IDENTIFICATION = re.compile(rb"[A-Z][A-Z0-9 -]{2,30}V\d+\.\d+(?: SN:[0-9A-Za-z]+)?")

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """One query and the form of its reply.

    Attributes:
        command: the bytes sent.
        form: pattern for the whole reply.
        width: length of the reply in bytes.
        spare: extra bytes that some firmware appends.
        proof: whether two equal replies are needed; `steady` are the bits that must be equal.
    """

    command: bytes
    form: re.Pattern[bytes]
    width: int
    spare: int = 0
    proof: bool = False
    steady: int = 0xFF


class KoradLine:
    """The host's end of the line.

    Args:
        device: the instrument's name in the bench file, for messages.
        port: the open byte stream.
        clock: the bench's clock.
        timeout: longest wait for one reply [s].
    """

    def __init__(self, device: str, port: Port, clock: Clock, *, timeout: float = LONGEST_REPLY_S) -> None:
        self._device = device
        self.timeout = timeout
        self._port = PacedPort(port, clock, _SILENCE_S)
        self._identification = b""
        self._end = b""
        self._in_step = True

    def identification(self) -> str:
        """Query `*IDN?` and return the identification text.

        Raises:
            NoReply: no attempt got a reply.
            Garbled: the reply is malformed, or unsolicited bytes came.
        """
        return self._with_retries(self._learn)

    def ask(self, question: Question) -> bytes:
        """Send a query, and return its reply without spare bytes; silence and malformed replies are retried.

        Raises:
            NoReply, Garbled: see `identification`.
        """
        return self._with_retries(lambda: self._closed(question))

    def setting(self, command: str, *, urgent: bool = False) -> None:
        """Send a setting once; no reply may follow it.

        Args:
            command: the setting.
            urgent: send it even with bytes waiting or a reply outstanding: for switching off.

        Raises:
            NoReply: the port failed.
            Garbled: unsolicited bytes came; an urgent setting was sent first all the same.
        """
        if not urgent:
            self._must_be_silent()
        self._send(command.encode("ascii"))
        stray = self._silence()
        if stray and self._in_step:
            raise self._unasked(stray)

    def _with_retries(self, ask: Callable[[], _T]) -> _T:
        """Retry until there is a reply, three attempts at most; unsolicited bytes are raised at once."""
        self._must_be_silent()
        faults: list[DeviceFault] = []
        while len(faults) < _ATTEMPTS:
            try:
                if not self._in_step:
                    self._resynchronise()
                return ask()
            except (NoReply, Garbled) as fault:
                self._in_step = False
                faults.append(fault)
        raise faults[0]

    def _closed(self, question: Question) -> bytes:
        """Send a query, twice if it is a proof, and close it with the identification."""
        came = [self._reply(question) for _ in range(2 if question.proof else 1)]
        first, last = came[0][: question.width], came[-1][: question.width]
        if first != last and (first[0] ^ last[0]) & question.steady:
            raise self._nonsense(question.command, f"{first!r} a second time", last)
        self._learn()
        for each in came:
            self._must_be_whole(question, each)
        return last

    def _reply(self, question: Question) -> bytes:
        """Send a query once, and return the reply with all that followed it."""
        self._send(question.command)
        came = self._heard(question.command, question.width)
        self._must_be_whole(question, came)
        return came

    def _must_be_whole(self, question: Question, came: bytes) -> None:
        """Refuse a reply of the wrong width or form, or followed by more than spare bytes and the known terminator.

        Replies may lack the identification's terminator, unless the reply could be taken for that terminator.
        """
        reply, more = came[: question.width], came[question.width :]
        ends = (self._end, b"") if self._identification else (*_ENDS, b"")
        whole = any(more.endswith(end) and len(more) - len(end) <= question.spare for end in ends)
        only_an_end = self._end and reply == self._end and not more
        if not whole or only_an_end or not question.form.fullmatch(reply):
            raise self._nonsense(question.command, f"{question.width} bytes of its form", came)

    def _learn(self) -> str:
        """Query the identification, which must match the one learnt before, if any."""
        self._send(b"*IDN?")
        came = self._heard(b"*IDN?", 1)
        end = next((end for end in _ENDS if came.endswith(end)), b"")
        text = came.removesuffix(end).removesuffix(_AFTER_IDENTIFICATION)
        known = (self._identification, self._end) if self._identification else (text, end)
        if not _IDENTIFICATION.fullmatch(text) or (text, end) != known:
            expected = b"".join(known) if self._identification else b"KORADKA3005PV2.0 or another name"
            raise self._nonsense(b"*IDN?", f"{expected!r}", came)
        self._identification, self._end = text, end
        return text.decode("ascii")

    def _send(self, command: bytes) -> None:
        try:
            self._port.write(command)
        except OSError as error:
            raise self._port_failed(error) from error

    def _heard(self, command: bytes, width: int) -> bytes:
        """Send a command and return all bytes until the line is silent; fewer than `width` count as no reply."""
        came = self._read(width, self.timeout)
        came += self._silence() if came else b""
        if len(came) < width:
            what = f"only {came!r} came" if came else "nothing came"
            raise NoReply(
                self._device,
                f"asked {command!r}, {what} within {self.timeout:g} s",
                "check the supply's power and cable, and that its baud is 9600",
            )
        return came

    def _silence(self) -> bytes:
        """Return the bytes until the line is silent; an endless stream is cut off."""
        came = b""
        while len(came) < _MOST_BYTES:
            more = self._read(_MOST_BYTES, _SILENCE_S)
            if not more:
                break
            came += more
        return came

    def _resynchronise(self) -> None:
        """Resynchronise: listen until the line is silent, then require a complete identification."""
        for _ in range(_MOST_LISTENED):
            if not self._silence():
                break
        self._identification = b""
        self._learn()
        self._in_step = True

    def _must_be_silent(self) -> None:
        """Refuse unsolicited bytes; after a fault late replies are expected, and resynchronising discards them."""
        if not self._in_step:
            return
        try:
            stray = self._port.read(self._port.in_waiting) if self._port.in_waiting else b""
        except OSError as error:
            raise self._port_failed(error) from error
        if stray:
            raise self._unasked(stray)

    def _read(self, size: int, timeout: float) -> bytes:
        try:
            self._port.timeout = timeout
            return self._port.read(size)
        except OSError as error:
            raise self._port_failed(error) from error

    def _unasked(self, stray: bytes) -> Garbled:
        self._in_step = False
        return Garbled(
            self._device,
            f"{stray[:_MOST_BYTES]!r} arrived unsolicited",
            "check what else talks on the line, and switch the supply off and on",
        )

    def _nonsense(self, command: bytes, expected: str, came: bytes) -> Garbled:
        return Garbled(
            self._device,
            f"asked {command!r}, expected {expected}, got {came[:_MOST_BYTES]!r}",
            "check the driver that the bench file names, the line's speed and its shielding",
        )

    def _port_failed(self, error: OSError) -> NoReply:
        self._in_step = False
        return NoReply(self._device, f"the port failed: {error}", "check cable and power")


def switched_off(questions: tuple[tuple[bytes, bytes, tuple[float, float] | None], ...], within_s: float) -> SafeBytes:
    """Return the bytes that switch the output off.

    Only silence marks the end of a command. So the sequence starts with a pause, and the command is sent twice, because
    half a command left by a killed program might still spoil the first.

    Args:
        questions: each query, the pattern of its reply, and the bounds of the number in it, if there is one.
        within_s: reply timeout [s].
    """
    proof = tuple(
        Exchange(send=command, expect=rb"\A" + reply, within_s=within_s, quiet_s=_SAFE_SILENCE_S, between=bounds)
        for command, reply, bounds in ((b"*IDN?", _IDENTIFICATION.pattern, None), *questions)
    )
    off = Exchange(send=b"OUT0", quiet_s=_SAFE_SILENCE_S)
    resync = (Exchange(send=b"", quiet_s=2 * _SILENCE_S),)
    return SafeBytes(resync=resync, off=(off, off), proof=proof, owed_s=within_s, who=proof[0])
