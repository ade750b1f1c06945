"""Stand-ins for wrapped instruments: a plain Python object, called as a vendor's driver would be."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.wire.peer import Line, PeerClock

__all__ = ["StandIn", "stand_in"]

_TAKES_NS = 1_000_000


class StandIn:
    """A peer on a byte stream that answers calls: a line of JSON asks, another one tells.

    The state of the object is its attributes, as JSON values; those that begin with `_` are its connections, and do not
    belong to it. If it has a method `restored`, that is called once they were set again.

    Args:
        instrument: the object with the operations; `channel(number)` gives that of a channel.
    """

    def __init__(self, instrument: Any) -> None:  # noqa: ANN401 - anybody's
        self._instrument = instrument
        self._inbox = b""
        self._line: Line | None = None

    def attach(self, line: Line, clock: PeerClock) -> None:
        """Connect it to its line."""
        del clock
        self._line = line

    def receive(self, data: bytes) -> None:
        """Answer every whole line."""
        *whole, self._inbox = (self._inbox + data).split(b"\n")
        for line in whole:
            answer = self._answer(line)
            if answer and self._line is not None:
                self._line.send(json.dumps(answer, separators=(",", ":")).encode() + b"\n", _TAKES_NS)

    def state(self) -> Mapping[str, object]:
        """Return the object's attributes, and half a line."""
        kept = {name: value for name, value in vars(self._instrument).items() if not name.startswith("_")}
        return {"inbox": self._inbox.hex(), "instrument": json.loads(json.dumps(kept))}

    def restore(self, state: Mapping[str, object]) -> None:
        """Continue from what `state` returned."""
        self._inbox = bytes.fromhex(str(state["inbox"]))
        kept = state["instrument"]
        if not isinstance(kept, dict):
            raise TypeError("the state of a stand-in is the attributes of its object")
        vars(self._instrument).update(kept)
        if hasattr(self._instrument, "restored"):
            self._instrument.restored()

    def _answer(self, line: bytes) -> dict[str, object]:
        try:
            call = json.loads(line)
            asked, number = call["call"], call["number"]
        except (ValueError, KeyError, TypeError):
            return {}
        part = self._instrument.channel(call["channel"]) if call.get("channel") else self._instrument
        try:
            found = getattr(part, asked)(**call.get("arguments", {}))
        except Exception as error:  # noqa: BLE001 - as a vendor's driver might
            return {"error": f"{type(error).__name__}: {error}", "number": number}
        return {"number": number, "result": _marked(found) if asked == "identity" else _json(found)}


def stand_in(build: Callable[[PeerSetup], Any]) -> PeerModel:
    """Return the model of a stand-in, for an entry point of `hil.peers`.

    Args:
        build: makes the object from its truth and its connections to plants.
    """
    return PeerModel(link="serial", fault_kinds=(), build=lambda setup: _built(build, setup))


def _built(build: Callable[[PeerSetup], Any], setup: PeerSetup) -> StandIn:
    instrument = build(setup)
    setup.finish()
    return StandIn(instrument)


def _marked(told: Mapping[str, object]) -> dict[str, object]:
    """Return an identity that says that it is simulated, whatever its object says."""
    return {**told, "firmware": "SIMULATED"}


def _json(value: Any) -> Any:  # noqa: ANN401 - whatever an operation returns
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return [_json(each) for each in value] if isinstance(value, tuple | list) else value
