"""Streams of the board: frames with device time, and the drift of the device's clock against the bench's."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from hil.clock.port import NANOSECONDS, Clock
from hil.instruments.obc_link.messages import Code, Command, program, stream_frame
from hil.instruments.obc_link.session import BoardRefused, Inbox, ObcSession
from hil.model.errors import DeviceFault, Garbled, NoReply, Refused
from hil.wire.streaming import StreamFrame, StreamSummary, StreamTransfer

__all__ = ["ClockEstimate", "ClockReading", "ObcStream", "begin_stream", "estimate"]

_RESOLUTION_S = 1e-6
_FEWEST = 3
_STREAM = 0
_MICROSECONDS = 1_000_000
_WATCHDOG_MS = 60_000
_EXCHANGES_AT_THE_ENDS = 4
_EXCHANGE_EVERY_S = 10.0
_SILENCE_S = 2.0
_PADDING = b"\xa5" * 17  # makes the request as long as its reply, so that both take equally long on the line


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockReading:
    """Four timestamps of one exchange in s: t1 and t4 of the bench, t2 and t3 of the device."""

    sent: float
    device_received: float
    device_sent: float
    received: float

    @property
    def offset(self) -> float:
        """Bench minus device in s, ((t1 - t2) + (t4 - t3)) / 2: RFC 5905, section 8, with the sign of the bench."""
        return ((self.sent - self.device_received) + (self.received - self.device_sent)) / 2.0

    @property
    def delay(self) -> float:
        """Round-trip delay in s, (t4 - t1) - (t3 - t2): RFC 5905, section 8; half of it bounds the offset's error."""
        return (self.received - self.sent) - (self.device_sent - self.device_received)

    @property
    def device_middle(self) -> float:
        """Device time midway between t2 and t3, in s."""
        return (self.device_received + self.device_sent) / 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockEstimate:
    """Clock drift and offset from a set of exchanges; None if there are too few.

    Attributes:
        drift: rate of the device's clock relative to the bench's, minus 1.
        drift_uncertainty: standard uncertainty of `drift`.
        offset: bench minus device at the last exchange, in s.
    """

    drift: float | None = None
    drift_uncertainty: float | None = None
    offset: float | None = None


def estimate(exchanges: Sequence[ClockReading]) -> ClockEstimate:
    """Estimate drift and offset by a straight line through the offsets of the quicker half of the exchanges.

    Exchanges slower than the median are left out: the extra delay is usually in one direction only
    (Cristian, Probabilistic clock synchronization, Distributed Computing 3, 1989; RFC 5905 keeps the
    quickest of eight). The line is fitted by least squares to offset over device time; its slope b is
    d(bench)/d(device) - 1, so the drift is 1/(1 + b) - 1. Its standard uncertainty comes from the scatter
    about the line with n - 2 degrees of freedom, which is taken as at least the contribution of the
    timestamps' 1 us resolution to the mean of two: 1 us / sqrt(12) / sqrt(2). A constant asymmetry of
    the two directions shifts the offset, by at most half of the delay, and does not affect the drift.

    Args:
        exchanges: at any intervals, in any order.
    """
    if not exchanges:
        return ClockEstimate()
    middle_delay = median(exchange.delay for exchange in exchanges)
    kept = [exchange for exchange in exchanges if exchange.delay <= middle_delay]
    end = max(exchange.device_middle for exchange in exchanges)
    times = [exchange.device_middle - end for exchange in kept]
    offsets = [exchange.offset for exchange in kept]
    count = len(kept)
    mean_time, mean_offset = math.fsum(times) / count, math.fsum(offsets) / count
    spread = math.fsum((time - mean_time) ** 2 for time in times)
    if count < _FEWEST or not spread:
        return ClockEstimate(offset=mean_offset)
    pairs = list(zip(times, offsets, strict=True))
    slope = math.fsum((time - mean_time) * (offset - mean_offset) for time, offset in pairs) / spread
    residuals = (offset - mean_offset - slope * (time - mean_time) for time, offset in pairs)
    scatter = math.sqrt(math.fsum(residual**2 for residual in residuals) / (count - 2))
    least = _RESOLUTION_S / math.sqrt(12.0) / math.sqrt(2.0)
    return ClockEstimate(
        drift=-slope / (1.0 + slope),
        drift_uncertainty=max(scatter, least) / math.sqrt(spread) / (1.0 + slope) ** 2,
        offset=mean_offset - slope * mean_time,
    )


def begin_stream(
    session: ObcSession,
    clock: Clock,
    *,
    bus: int,
    transfers: Sequence[StreamTransfer],
    period_s: float | None,
    line: int | None,
) -> ObcStream:
    """Start stream 0 of the board, after stopping one that an earlier session left running."""
    if (period_s is None) == (line is None):
        raise Refused(f"{session.device}: a stream has a period or a line", "give one of the two")
    if session.arrivals.expects(_STREAM):
        raise Refused(
            f"{session.device}: the board runs one stream at a time, and one runs", "record its sensors in turn"
        )
    period_us = None if period_s is None else round(period_s * _MICROSECONDS)
    try:
        payload = program(_STREAM, bus, transfers, period_us, line)
    except struct.error as error:
        raise Refused(f"{session.device}: this stream cannot be requested ({error})", "check its numbers") from None
    stream = ObcStream(session, clock)
    stream.begin(payload)
    return stream


class ObcStream:
    """A running stream. See `hil.wire.streaming.BusStream`.

    TIME is exchanged at the beginning, every 10 s while frames are fetched, and at the end. While the
    stream runs, the board's watchdog is armed with 60 s, so that a board that lost its host stops sending.
    """

    def __init__(self, session: ObcSession, clock: Clock) -> None:
        self._session = session
        self._clock = clock
        self._inbox = Inbox()
        self._exchanges: list[ClockReading] = []
        self._ready: list[StreamFrame] = []
        self._heard = clock.now()
        self._asked_times = 0
        self._received = 0
        self._next_number = 0
        self._over = False

    def begin(self, payload: bytes) -> None:
        """Start the stream with a program.

        Raises:
            Rejected: the board cannot run it.
        """
        self._measure(_EXCHANGES_AT_THE_ENDS)
        self._session.request(Command.WATCHDOG, struct.pack("<I", _WATCHDOG_MS))
        self._inbox = self._session.arrivals.open_inbox(_STREAM)
        try:
            self._start(payload)
        except DeviceFault:
            self._session.arrivals.close_inbox(_STREAM)
            raise
        self._heard = self._clock.now()

    def frames(self) -> Sequence[StreamFrame]:
        """Return the frames received since the last call, in order; waits only for the exchange of TIME.

        Raises:
            DeviceFault: the stream ended: the board restarted, its watchdog expired, or the link is silent.
        """
        try:
            if not self._over:
                self._session.poll()
                self._track_clock(bool(self._inbox.payloads))
        except DeviceFault as fault:
            self._inbox.fault = self._inbox.fault or fault
        self._decode_frames()
        ready, self._ready = self._ready, []
        if not ready and self._inbox.fault:
            raise self._inbox.fault
        return ready

    def stop(self) -> StreamSummary:
        """End the stream and return its summary; frames not fetched yet stay available.

        Raises:
            DeviceFault: the board does not answer, or had already ended the stream.
        """
        numbers = self._next_number
        if not self._over:
            self._over = True
            try:
                numbers = self._stop_on_board()
            finally:
                self._session.arrivals.close_inbox(_STREAM)
        self._decode_frames()
        clocks = estimate(self._exchanges)
        return StreamSummary(
            frames=self._received,
            lost=max(numbers, self._next_number) - self._received,
            drift=clocks.drift,
            drift_uncertainty=clocks.drift_uncertainty,
            offset_s=clocks.offset,
        )

    def _stop_on_board(self) -> int:
        """Stop the stream on the board, and return the number of frames that it counted."""
        if self._inbox.fault:
            raise self._inbox.fault
        fields = self._session.request(Command.STREAM_STOP, bytes((_STREAM,))).fields
        _stream, numbers, _lost = self._session.read("STREAM_STOP", _stopped, fields)
        self._measure(_EXCHANGES_AT_THE_ENDS)
        self._session.request(Command.WATCHDOG, struct.pack("<I", 0))
        return numbers

    def _start(self, payload: bytes) -> None:
        try:
            self._session.request(Command.STREAM_START, payload)
        except BoardRefused as refusal:
            if refusal.code != Code.BUSY:
                raise
            self._session.request(Command.STREAM_STOP, bytes((_STREAM,)))
            self._inbox.payloads.clear()
            self._session.request(Command.STREAM_START, payload)

    def _decode_frames(self) -> None:
        """Decode the frames in the inbox, dropping truncated and duplicate ones."""
        payloads, self._inbox.payloads = self._inbox.payloads, []
        for payload in payloads:
            try:
                frame = stream_frame(payload)
            except ValueError:
                self._session.arrivals.stray += 1
                continue
            if frame.number < self._next_number:
                self._session.arrivals.stray += 1
                continue
            self._next_number = frame.number + 1
            self._received += 1
            self._ready.append(frame)

    def _track_clock(self, frames_came: bool) -> None:
        now = self._clock.now()
        if frames_came:
            self._heard = now
        last = self._exchanges[-1].received
        if now - last >= _EXCHANGE_EVERY_S or now - max(self._heard, last) >= _SILENCE_S:
            self._measure(1)

    def _measure(self, count: int) -> None:
        for _ in range(count):
            exchange = self._exchange()
            if self._exchanges and exchange.device_received < self._exchanges[-1].device_sent:
                raise self._session.went_back()
            self._exchanges.append(exchange)

    def _exchange(self) -> ClockReading:
        """Exchange TIME; a retry is a new request, because a resent one would have old timestamps."""
        try:
            return self._asked()
        except (NoReply, Garbled):
            return self._asked()

    def _asked(self) -> ClockReading:
        # The host's value is a count: bench time would differ when a record of hardware is replayed.
        self._asked_times += 1
        question = struct.pack("<Q", self._asked_times) + _PADDING
        reply = self._session.request(Command.TIME, question, once=True)
        echo, received_us, sent_us = self._session.read("TIME", _stamps, reply.fields)
        if echo != self._asked_times:
            raise Garbled(self._session.device, "TIME was answered with another host value", "check the firmware")
        return ClockReading(
            sent=reply.sent_ns / NANOSECONDS,
            device_received=received_us / _MICROSECONDS,
            device_sent=sent_us / _MICROSECONDS,
            received=reply.received_ns / NANOSECONDS,
        )


def _stamps(fields: bytes) -> tuple[int, int, int]:
    return _three("<QQQ", fields)


def _stopped(fields: bytes) -> tuple[int, int, int]:
    return _three("<BII", fields)


def _three(layout: str, fields: bytes) -> tuple[int, int, int]:
    try:
        first, second, third = struct.unpack_from(layout, fields)
    except struct.error as error:
        raise ValueError(str(error)) from None
    return first, second, third
