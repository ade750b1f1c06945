"""The serial line of a Korad supply: commands without an end, replies of fixed width, a silence after each.

Nothing in a reply says which question it belongs to, where it begins or where it ends. So a question is asked in
silence, its reply must have exactly its width and form and be followed by silence, and then the identification is asked
for. The instrument answers in order: bytes that nobody had asked for make a reply too long, or push it to where the
identification should be. Of what proves a state two equal replies are asked for before that.

Some firmware ends every reply with a line feed, with carriage return and line feed, or with NUL. Which one is learnt
with the identification; no other one is accepted, and none of them is a reply.

After a fault a reply may still come: the line is listened to until it is silent, and then the identification must come
whole; it is learnt again.
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
"""That, and what it takes until the last byte has left the adapter."""
_ATTEMPTS = 3
_MOST_LISTENED = 10
_MOST_BYTES = 64
_AFTER_IDENTIFICATION = b"\x01"  # some units send it after the text
_ENDS = (b"\r\n", b"\n", b"\0")  # the longest first
_IDENTIFICATION = re.compile(rb"[A-Z][A-Z0-9 -]{2,30}V\d+\.\d+(?: SN:[0-9A-Za-z]+)?")

_T = TypeVar("_T")


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """One question, and what its reply looks like.

    Attributes:
        command: what is sent.
        form: what the whole reply must match.
        width: bytes of the reply.
        spare: bytes that some firmware sends after it.
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
        """Ask `*IDN?` and return what the supply says of itself.

        Raises:
            NoReply: nothing came each time.
            Garbled: something else came, or bytes that nobody had asked for.
        """
        return self._tried(self._learn)

    def ask(self, question: Question) -> bytes:
        """Ask, and return the reply without spare bytes; asked again where nothing or nonsense comes.

        Raises:
            NoReply, Garbled: see `identification`.
        """
        return self._tried(lambda: self._closed(question))

    def setting(self, command: str, *, urgent: bool = False) -> None:
        """Send a setting once; nothing may come after it.

        Args:
            command: the setting.
            urgent: let it leave even where bytes wait or are owed: for switching off.

        Raises:
            NoReply: the port failed.
            Garbled: bytes came that nobody had asked for; an urgent setting has left before.
        """
        if not urgent:
            self._must_be_silent()
        self._send(command.encode("ascii"))
        stray = self._silence()
        if stray and self._in_step:
            raise self._unasked(stray)

    def _tried(self, ask: Callable[[], _T]) -> _T:
        """Ask until there is a reply, three times at most; what came unasked is raised at once."""
        self._must_be_silent()
        faults: list[DeviceFault] = []
        while len(faults) < _ATTEMPTS:
            try:
                if not self._in_step:
                    self._step_again()
                return ask()
            except (NoReply, Garbled) as fault:
                self._in_step = False
                faults.append(fault)
        raise faults[0]

    def _closed(self, question: Question) -> bytes:
        """Ask, twice where it is a proof, and let the identification close it."""
        came = [self._reply(question) for _ in range(2 if question.proof else 1)]
        first, last = came[0][: question.width], came[-1][: question.width]
        if first != last and (first[0] ^ last[0]) & question.steady:
            raise self._nonsense(question.command, f"{first!r} a second time", last)
        self._learn()
        for each in came:
            self._must_be_whole(question, each)
        return last

    def _reply(self, question: Question) -> bytes:
        """Ask once, and return the reply with what followed it."""
        self._send(question.command)
        came = self._heard(question.command, question.width)
        self._must_be_whole(question, came)
        return came

    def _must_be_whole(self, question: Question, came: bytes) -> None:
        """Refuse what has not the width and form, or is followed by more than spare bytes and the end, if it is known.

        Replies may lack the end that the identification has, but not where the reply could be that end alone.
        """
        reply, more = came[: question.width], came[question.width :]
        ends = (self._end, b"") if self._identification else (*_ENDS, b"")
        whole = any(more.endswith(end) and len(more) - len(end) <= question.spare for end in ends)
        only_an_end = self._end and reply == self._end and not more
        if not whole or only_an_end or not question.form.fullmatch(reply):
            raise self._nonsense(question.command, f"{question.width} bytes of its form", came)

    def _learn(self) -> str:
        """Ask for the identification, which must be the one that was learnt, if one was."""
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
            raise self._dead_port(error) from error

    def _heard(self, command: bytes, width: int) -> bytes:
        """Return what comes until there is silence; fewer bytes than `width` are no reply."""
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
        """Return what comes before there is silence; what never ends is cut."""
        came = b""
        while len(came) < _MOST_BYTES:
            more = self._read(_MOST_BYTES, _SILENCE_S)
            if not more:
                break
            came += more
        return came

    def _step_again(self) -> None:
        """Listen until there is silence, and let the identification come whole."""
        for _ in range(_MOST_LISTENED):
            if not self._silence():
                break
        self._identification = b""
        self._learn()
        self._in_step = True

    def _must_be_silent(self) -> None:
        """Refuse bytes that came unasked; after a fault some may be owed, and stepping again deals with them."""
        if not self._in_step:
            return
        try:
            stray = self._port.read(self._port.in_waiting) if self._port.in_waiting else b""
        except OSError as error:
            raise self._dead_port(error) from error
        if stray:
            raise self._unasked(stray)

    def _read(self, size: int, timeout: float) -> bytes:
        try:
            self._port.timeout = timeout
            return self._port.read(size)
        except OSError as error:
            raise self._dead_port(error) from error

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

    def _dead_port(self, error: OSError) -> NoReply:
        self._in_step = False
        return NoReply(self._device, f"the port failed: {error}", "check cable and power")


def switched_off(questions: tuple[tuple[bytes, bytes, tuple[float, float] | None], ...], within_s: float) -> SafeBytes:
    """Return how the output is switched off by bytes alone.

    Only a silence shows where a command ends. So there is one first; and the command leaves twice, for half a command
    that a killed program left might still spoil the first.

    Args:
        questions: what is asked, what the reply must be, and the bounds of the number in it, if there is one.
        within_s: how long a reply may take [s].
    """
    proof = tuple(
        Exchange(send=command, expect=rb"\A" + reply, within_s=within_s, quiet_s=_SAFE_SILENCE_S, between=bounds)
        for command, reply, bounds in ((b"*IDN?", _IDENTIFICATION.pattern, None), *questions)
    )
    off = Exchange(send=b"OUT0", quiet_s=_SAFE_SILENCE_S)
    resync = (Exchange(send=b"", quiet_s=2 * _SILENCE_S),)
    return SafeBytes(resync=resync, off=(off, off), proof=proof, owed_s=within_s, who=proof[0])
