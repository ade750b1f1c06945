"""The bench of a run: its instruments and wiring, how it was armed, and how every output was made safe."""

from __future__ import annotations

from collections.abc import Iterable

from hil.evidence.events import Armed, Event, Gate, Resumed, Safe
from hil.report.material import Body, flat, inner, inners, text
from hil.report.numbers import bench_time, duration
from hil.report.page.view import Arming, GateRow, InstrumentRow, SafeRow, WireRow

__all__ = ["armings", "instruments", "safe_off", "wiring"]

_AGAIN = "Armed again"
_CUT_PATH, _NOT_TRIED = "cut path of ", "not tried: "


def instruments(bench: Body) -> tuple[InstrumentRow, ...]:
    """Return the instruments of a bench file, in its order."""
    section = inner(bench, "instruments")
    return tuple(_instrument(name, inner(section, name)) for name in section)


def wiring(bench: Body) -> tuple[WireRow, ...]:
    """Return the wiring of a bench file, in its order."""
    return tuple(_wire(entry) for entry in inners(bench, "wiring"))


def armings(events: Iterable[Event]) -> tuple[Arming, ...]:
    """Return the readiness gates, of each arming by itself: a run that was entered again was armed again.

    A gate behind the end of an arming is the guardian's, who does not find the bench safe when it is released.
    """
    titles, parts = ["Arming"], list[list[Gate]]([[]])
    over = False
    for event in events:
        again = isinstance(event, Resumed) and event.entry is not None
        if again or (isinstance(event, Gate) and over):
            titles.append(_AGAIN if again else "At the release of the bench")
            parts.append([])
            over = False
        if isinstance(event, Gate):
            parts[-1].append(event)
            if titles[-1] == _AGAIN and not event.ok:
                titles[-1] = "Not armed again"
        over = over or isinstance(event, Armed) or (isinstance(event, Gate) and not event.ok)
    found = [(title, part) for title, part in zip(titles, parts, strict=True) if part]
    return tuple(
        Arming(
            title=f"{title}, at {bench_time(part[0].t)} of bench time" if len(found) > 1 else "",
            gates=tuple(map(_gate, part)),
        )
        for title, part in found
    )


def safe_off(events: Iterable[Event]) -> tuple[SafeRow, ...]:
    """Return every output that was made safe, in order."""
    return tuple(
        SafeRow(
            at=bench_time(event.t),
            output=event.output,
            state=event.state,
            ok=event.ok,
            detail=event.detail,
            duration=duration(event.duration),
        )
        for event in events
        if isinstance(event, Safe)
    )


def _instrument(name: str, entry: Body) -> InstrumentRow:
    calibration = inner(entry, "calibration")
    identity = inner(entry, "identity")
    return InstrumentRow(
        name=name,
        driver=text(entry, "driver"),
        identity=" ".join(text(identity, key) for key in ("manufacturer", "model", "serial", "firmware")).strip(),
        certificate=text(calibration, "certificate"),
        due=text(calibration, "due"),
        ranges=tuple(_range(item) for item in inners(calibration, "ranges")),
        dut=text(entry, "dut") == "true",
    )


def _range(entry: Body) -> str:
    unit = text(entry, "unit")
    parts = [f"{text(entry, 'absolute') or '0'} {unit}".strip()]
    if text(entry, "relative") not in {"", "0", "0.0"}:
        parts.append(f"{text(entry, 'relative')} of the reading")
    span = f"{text(entry, 'from')} to {text(entry, 'to')} {unit}".strip()
    return f"{text(entry, 'quantity')} {span}: U = {' + '.join(parts)} (k = {text(entry, 'k') or '2'})"


def _wire(entry: Body) -> WireRow:
    shown = ("role", "instance", "instrument", "channel", "note")
    rest = "; ".join(f"{key} {value}" for key, value in flat({k: v for k, v in entry.items() if k not in shown}))
    channel = text(entry, "channel")
    return WireRow(
        name=".".join(part for part in (text(entry, "role"), text(entry, "instance")) if part),
        instrument=text(entry, "instrument"),
        channel="" if channel == "0" else channel,
        note="; ".join(part for part in (text(entry, "note"), rest) if part),
    )


def _gate(gate: Gate) -> GateRow:
    tried = not (gate.name.startswith(_CUT_PATH) and _NOT_TRIED in gate.detail)
    return GateRow(name=gate.name, ok=gate.ok, tried=tried, detail=gate.detail)
