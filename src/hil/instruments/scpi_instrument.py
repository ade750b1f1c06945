"""Base of SCPI instruments: conventions of a family, session, and switched terminals."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar

from hil.instruments.driver import TERMINATED, Clamps, Connection, Outlet
from hil.instruments.marks import drives, reads
from hil.instruments.pacing import PacedPort
from hil.instruments.role import Role
from hil.instruments.safing import NUMBER, must_be_state, own_bounds
from hil.instruments.scpi_block import BlockSession
from hil.instruments.scpi_session import ClosedSession, ScpiSession, as_number, as_quantity, as_switch, as_text
from hil.model.bench import Proof
from hil.model.errors import Refused, Rejected
from hil.model.identity import Identity
from hil.model.safing import Exchange, SafeBytes

__all__ = ["OFF", "ReadBack", "ScpiInstrument", "ScpiTerminals", "Speech", "SwitchedSpeech"]

OFF = rb"\+?0|(?i:OFF)"
"""Regular expression of a reply that means off; no reply that means on matches it."""

_GAP_S = 0.02
_IDENTIFY = "*IDN?"
_IDENTIFICATION = rb"[^,;\r\n]+(?:,[^,;\r\n]*){3,%d}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Speech:
    """SCPI conventions of one family of instruments.

    Attributes:
        driver: the driver's name in bench files.
        error_query: query that takes the oldest entry from the error queue.
        framed: whether a query may share a line with `*IDN?`.
        fields: maximum number of fields of an identification.
        pause_s: minimum pause between lines [s].
        blocks: whether it sends binary blocks, in a session that is not framed: `BlockSession`.
    """

    driver: str
    error_query: str = "SYST:ERR?"
    framed: bool = False
    fields: int = 4
    pause_s: float = 0.0
    blocks: bool = False


def _as_state(reply: str, channel: int) -> bool:
    del channel
    return as_switch(reply)


def _says_off(channel: int) -> bytes:
    del channel
    return OFF


@dataclass(frozen=True, slots=True, kw_only=True)
class SwitchedSpeech(Speech):
    """SCPI conventions of a family with switched terminals; `{channel}` is filled in.

    Attributes:
        decimals: number of decimals sent.
        tolerance: largest difference between a setting and its read-back, in its unit: the family's coarsest
            programming resolution.
        switch_on, switch_off, is_on: commands that switch the terminals, and query whether they are on.
        as_state: parses whether they are on.
        says_off: returns the regular expression of the reply to `is_on` for terminals that are off.
    """

    decimals: int
    tolerance: float
    switch_on: str
    switch_off: str
    is_on: str
    as_state: Callable[[str, int], bool] = _as_state
    says_off: Callable[[int], bytes] = _says_off


class ReadBack:
    """Settings that are read back and must match what was sent.

    Args:
        name: the wire's dotted name.
        device: the instrument's name, for messages.
        session: its session.
    """

    def __init__(self, name: str, device: str, session: ScpiSession) -> None:
        self._name, self._device, self._session = name, device, session

    def word(self, header: str, word: str) -> None:
        """Set a keyword; Rejected where it reads back differently."""
        self._session.setting(f"{header} {word}")
        self._same(header, word, self._session.query(f"{header}?", as_text))

    def switch(self, header: str, on: bool) -> None:
        """Set a switch; Rejected where it reads back differently."""
        self._session.setting(f"{header} {'ON' if on else 'OFF'}")
        self._same(header, on, self._session.query(f"{header}?", as_switch))

    def number(self, header: str, value: float, tolerance: float = 0.0) -> None:
        """Set a number; Rejected where the read-back differs by more than the tolerance and rounding."""
        self._session.setting(f"{header} {value:.9g}")
        found = self._session.query(f"{header}?", as_number)
        if not abs(found - value) <= tolerance + 1e-6 * abs(value):
            self._same(header, f"{value:g}", f"{found:g}")

    def _same(self, header: str, asked: object, found: object) -> None:
        if asked != found:
            raise Rejected(
                self._device,
                f"{self._name}: `{header}` was set to {asked} and reads back {found}",
                "check its ranges, and whether somebody works at its front panel",
            )


class ScpiTerminals:
    """Switched terminals: an output of a supply, the input of a load.

    Every setting is checked against the clamps right before its bytes leave, sent once, followed by a
    query of the error queue, and read back.

    Args:
        name: the wire's dotted name.
        device: the instrument's name, for messages.
        session: the instrument's session.
        speech: its SCPI conventions.
        clamps: the clamps on its terminals.
        channel: channel number.
    """

    fills: ClassVar[Role]

    def __init__(
        self, *, name: str, device: str, session: ScpiSession, speech: SwitchedSpeech, clamps: Clamps, channel: int
    ) -> None:
        self._name = name
        self._device = device
        self._session = session
        self._speech = speech
        self._clamps = clamps
        self._channel = channel

    @drives
    def disable(self) -> None:
        """Switch off; the bytes leave at once, whatever state the dialogue is in."""
        self._session.setting(self._filled(self._speech.switch_off), urgent=True)
        if self.enabled():
            raise Rejected(self._device, f"{self._name} was switched off and is on", "cut its mains, then check it")

    @reads
    def enabled(self) -> bool:
        """Return whether the instrument reports them as on."""
        speech = self._speech
        return self._session.query(self._filled(speech.is_on), lambda reply: speech.as_state(reply, self._channel))

    def _switch_on(self) -> bool:
        """Switch on, and return whether the instrument reports them as on."""
        self._session.setting(self._filled(self._speech.switch_on))
        return self.enabled()

    def _safe_bytes(self, state: str, proof: Proof | None, questions: dict[str, str]) -> SafeBytes:
        """Return the bytes that switch off; see `hil.instruments.roles.SafeByBytes`.

        Args:
            state: one of the role's states.
            proof: the bench file's proof.
            questions: the query of each quantity that a proof may read.
        """
        must_be_state(self.fills, self._name, state)
        speech = self._speech
        asked: list[tuple[str, bytes, tuple[float, float] | None]] = [
            (self._filled(speech.is_on), speech.says_off(self._channel), None)
        ]
        for quantity, question in questions.items():
            if bounds := own_bounds(self._name, proof, quantity):
                unit = self.fills.quantities[quantity].encode("ascii")
                asked.append((self._filled(question), NUMBER + b" *" + unit + b"?", bounds))
        return _switched_off(speech, self._filled(speech.switch_off), tuple(asked), self._session)

    def _set(self, quantity: str, command: str, question: str, value: float) -> None:
        """Check against the clamps, send, query the error queue, read back, compare."""
        text = f"{value:.{self._speech.decimals}f}"
        self._clamps.permit(self._channel, quantity, value)
        self._session.setting(self._filled(command, value=text))
        taken = self._number(quantity, question)
        if not abs(taken - value) <= self._speech.tolerance:
            raise Rejected(
                self._device,
                f"{self._name}: {quantity} was set to {text} and reads back {taken:g}",
                "check whether the front panel or another program changes it, and the instrument's ratings",
            )

    def _sendable(self, quantity: str, value: float) -> float:
        """Return the value as it will be sent, so that the clamps check that one."""
        if not math.isfinite(value):
            raise Refused(f"{self._name}: {quantity} {value} is not a number to set", "give a finite number")
        return round(value, self._speech.decimals)

    def _number(self, quantity: str, question: str) -> float:
        unit = self.fills.quantities[quantity.removeprefix("over_")]
        return self._session.query(self._filled(question), as_quantity(unit))

    def _filled(self, template: str, value: str = "") -> str:
        return template.format(channel=self._channel, value=value)


class ScpiInstrument:
    """Base of SCPI drivers: session and identification. The instrument is never reset.

    `*RST` would switch outputs off in an arbitrary order, and discard settings made by hand.
    """

    capabilities: ClassVar[frozenset[str]] = frozenset({TERMINATED})
    speech: ClassVar[Speech]

    def __init__(self, connection: Connection) -> None:
        speech, port = self.speech, connection.port
        if port is None:
            raise Refused(f"{connection.device}: the driver {speech.driver} needs a port", "give it `port:`")
        self._connection = connection
        paced = PacedPort(port, connection.clock, speech.pause_s) if speech.pause_s else port
        session = BlockSession if speech.blocks else ScpiSession if speech.framed else ClosedSession
        self._session = session(
            connection.device,
            paced,
            terminator=connection.terminator or b"\n",
            timeout=connection.timeout,
            error_query=speech.error_query,
            framed=speech.framed,
            fields=speech.fields,
        )

    def outlets(self) -> Sequence[Outlet]:
        """Return an empty list, as for an instrument that only measures; see `hil.instruments.driver.Driver`."""
        return ()

    def identify(self) -> Identity:
        """Query `*IDN?`."""
        manufacturer, model, serial, firmware = self._session.identification()
        return Identity(manufacturer=manufacturer, model=model, serial=serial, firmware=firmware)


def _switched_off(
    speech: Speech,
    off: str,
    questions: tuple[tuple[str, bytes, tuple[float, float] | None], ...],
    session: ScpiSession,
) -> SafeBytes:
    """Return the bytes that make an output safe.

    A killed program may have left half a line, which a line feed would execute: `OUTP ON` without its channel list
    switches whichever channel is selected. So the first thing sent is `*IDN?`: appended to half a line it makes that
    invalid, and the whole is refused; on its own it is a query that changes nothing. The error queue is not emptied:
    its entries show the next program what happened.

    The proof begins with `*IDN?` too: its reply shows that the instrument answers and that no older reply is due.

    The line may be echoed before its reply, blanks may surround a reply, and a carriage return may end it.

    Args:
        speech: SCPI conventions: whether queries are framed by `*IDN?`, and the pause between lines.
        off: the command to switch off.
        questions: each query, the pattern of its reply, and the bounds of the number in it, if there is one.
        session: supplies terminator and reply timeout.
    """
    quiet_s, within_s = _GAP_S + speech.pause_s, session.timeout
    begins, ends = (rb"(?:\A|\r)", rb" *\r") if session.terminator == b"\r" else (rb"(?:\A|\n)", rb" *\r?\n")
    identification = _IDENTIFICATION % (speech.fields - 1)

    def bytes_of(text: str) -> bytes:
        return text.encode("ascii") + session.terminator

    def asked(question: str, reply: bytes, bounds: tuple[float, float] | None) -> Exchange:
        separator = "" if question.startswith(":") else ":"
        line = f"{_IDENTIFY};{separator}{question}" if speech.framed else question
        echo = rb"(?:" + re.escape(line.encode("ascii")) + ends + rb")?"
        frame = identification + rb"; *" if speech.framed else rb" *"
        return Exchange(
            send=bytes_of(line),
            expect=rb"\A" + echo + frame + rb"(?:" + reply + rb")" + ends,
            within_s=within_s,
            quiet_s=quiet_s,
            between=bounds,
        )

    nothing_owed = Exchange(
        send=bytes_of(_IDENTIFY),
        expect=begins + identification + ends,
        within_s=within_s,
        quiet_s=quiet_s,
    )
    return SafeBytes(
        resync=(Exchange(send=bytes_of(_IDENTIFY), quiet_s=quiet_s),),
        off=(Exchange(send=bytes_of(off), quiet_s=quiet_s),),
        proof=(nothing_owed, *(asked(*each) for each in questions)),
        owed_s=within_s,
        who=nothing_owed,
    )
