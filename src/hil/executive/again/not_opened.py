"""Gates that people or the machine did not open, from the record: who retraces a run asks neither of them."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from hil.bench.gate import Gate
from hil.executive.watch.keeper import FIRST_ARMING

__all__ = ["not_opened"]


def not_opened(events: Iterable[Mapping[str, Any]]) -> dict[int, Gate]:
    """Return the gate of the host that ended an arming, per arming that one ended.

    An arming is told by the `void_to` of the entry at which it was done, the first one by `FIRST_ARMING`. What the
    guardian finds behind an arming, at its release, is no gate of it.
    """
    found: dict[int, Gate] = {}
    arming: int | None = FIRST_ARMING
    for event in events:
        kind = event["kind"]
        if kind == "resumed" and event.get("entry"):
            arming = event["entry"]["void_to"]
        elif kind == "armed" or (kind == "gate" and not event["ok"]):
            arming = None
        elif kind == "host-gate" and not event["ok"] and arming is not None:
            found[arming] = Gate(event["name"], ok=False, detail=event["detail"])
            arming = None
    return found
