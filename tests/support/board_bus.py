"""An I2C bus that runs transfers at a peer's interrupts, without a board and a link around it."""

from __future__ import annotations

from hil.model.errors import NoReply
from hil.wire.peer import Nack
from hil.wire.simulated_bus import SimulatedBus
from hil.wire.streaming import FifoRead, StreamFrame, StreamSummary

__all__ = ["BoardBus"]

_NANO = 1_000_000_000


class BoardBus(SimulatedBus):
    """A simulated bus with `start_stream`; the device's clock is the bench's, `ahead_s` fast.

    Attributes:
        skip: numbers of frames that are lost on the way.
        spurious: how many triggers come at once when a stream starts.
        link_is_silent: whether the link fails.
        delay_ns: by number, how much later a turn runs than its trigger.
    """

    def __init__(self, clock, peer, *, ahead_s=1000.0) -> None:
        super().__init__(clock, 400_000, [peer])
        self.device = "obc"
        self.clock = clock
        self.peer = peer
        self.ahead_s = ahead_s
        self.skip = set()
        self.spurious = 0
        self.link_is_silent = False
        self.delay_ns = {}
        self.running = None
        self.line = None
        peer.on_interrupt(self._trigger)

    def transfer(self, messages):
        """Fail as a link does, where it is silent."""
        if self.link_is_silent:
            raise NoReply("obc", "silent", "look at the cable")
        return super().transfer(messages)

    def start_stream(self, transfers, *, period_s=None, line=None):
        """Run the transfers at every interrupt of the peer."""
        assert period_s is None
        self.line = line
        self.running = _Stream(self, transfers)
        for _ in range(self.spurious):
            self._trigger()
        return self.running

    def _trigger(self) -> None:
        if self.running is not None:
            stream, now_ns = self.running, self.clock.now_ns()
            delay = self.delay_ns.get(stream.number, 0)
            if delay:
                number = stream.take_number()
                self.clock.at(now_ns + delay, lambda: stream.turn(number, now_ns))
            else:
                stream.turn(stream.take_number(), now_ns)


class _Stream:
    def __init__(self, bus, transfers) -> None:
        self.bus = bus
        self.transfers = transfers
        self.number = 0
        self.lost = 0
        self.arrived = 0
        self.waiting = []

    def take_number(self):
        self.number += 1
        return self.number - 1

    def turn(self, number, at_ns):
        replies = tuple(self._run(transfer) for transfer in self.transfers)
        if number in self.bus.skip or self.bus.link_is_silent:
            self.lost += 1
            return
        self.arrived += 1
        device_s = at_ns / _NANO + self.bus.ahead_s
        self.waiting.append(StreamFrame(number=number, lost=0, device_s=device_s, replies=replies))

    def frames(self):
        if self.bus.link_is_silent and not self.waiting:
            raise NoReply("obc", "silent", "look at the cable")
        waiting, self.waiting = self.waiting, []
        return waiting

    def stop(self):
        self.bus.running = None
        if self.bus.link_is_silent:
            raise NoReply("obc", "silent", "look at the cable")
        return StreamSummary(frames=self.arrived, lost=self.lost, drift=1e-5, drift_uncertainty=1e-6, offset_s=0.0)

    def _run(self, transfer):
        try:
            if not isinstance(transfer, FifoRead):
                return self._read(transfer.address, transfer.register, transfer.length)
            count = self._read(transfer.address, transfer.count_register, 2)
            at_hand = min(int.from_bytes(count, "big") * transfer.unit, transfer.most)
            whole = at_hand - at_hand % transfer.record
            return self._read(transfer.address, transfer.data_register, whole) if whole else b""
        except Nack:
            return None

    def _read(self, address, register, count):
        self.bus.peer.write(address, bytes([register]))
        return self.bus.peer.read(address, count)
