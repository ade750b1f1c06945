"""How the bench was armed and made safe: the gates of each arming, and every output's way to its safe state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from hil.report.material import Body, flag, inner, text
from hil.report.numbers import bench_time, duration

__all__ = ["Arming", "GateRow", "SafeRow", "armings", "safe_off"]

_AGAIN = "Armed again"
_CUT_PATH, _NOT_TRIED = "cut path of ", "not tried: "


@dataclass(frozen=True, slots=True, kw_only=True)
class GateRow:
    """One readiness gate; one that could not be tried is not said to have held."""

    name: str
    ok: bool
    tried: bool
    detail: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Arming:
    """The gates of one arming in their order; the title tells which, and is empty where there was one only."""

    title: str
    gates: tuple[GateRow, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class SafeRow:
    """One output, brought to its safe state and proven there, or not."""

    at: str
    output: str
    state: str
    ok: bool
    detail: str
    duration: str


def armings(events: Sequence[Body]) -> tuple[Arming, ...]:
    """Return the readiness gates, of each arming by itself: a run that was entered again was armed again.

    A gate behind the end of an arming is the guardian's, who does not find the bench safe when it is released.
    """
    titles, parts = ["Arming"], list[list[Body]]([[]])
    over = False
    for event in events:
        kind = event["kind"]
        again = kind == "resumed" and bool(inner(event, "entry"))
        gate = kind in {"gate", "host-gate"}
        if again or (gate and over):
            titles.append(_AGAIN if again else "At the release of the bench")
            parts.append([])
            over = False
        if gate:
            parts[-1].append(event)
            if titles[-1] == _AGAIN and not flag(event, "ok"):
                titles[-1] = "Not armed again"
        over = over or kind == "armed" or (gate and not flag(event, "ok"))
    found = [(title, part) for title, part in zip(titles, parts, strict=True) if part]
    return tuple(
        Arming(
            title=f"{title}, at {bench_time(part[0].get('t'))} of bench time" if len(found) > 1 else "",
            gates=tuple(map(_gate, part)),
        )
        for title, part in found
    )


def _gate(event: Body) -> GateRow:
    name, detail = text(event, "name"), text(event, "detail")
    tried = not (name.startswith(_CUT_PATH) and _NOT_TRIED in detail)
    return GateRow(name=name, ok=flag(event, "ok"), tried=tried, detail=detail)


def safe_off(events: Sequence[Body]) -> tuple[SafeRow, ...]:
    """Return every output that was made safe, in order."""
    return tuple(
        SafeRow(
            at=bench_time(event.get("t")),
            output=text(event, "output"),
            state=text(event, "state"),
            ok=flag(event, "ok"),
            detail=text(event, "detail"),
            duration=duration(event.get("duration")),
        )
        for event in events
        if event["kind"] == "safe"
    )
