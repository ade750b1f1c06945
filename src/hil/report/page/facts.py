"""Who, what, when and where: the facts at the head of a report."""

from __future__ import annotations

from collections.abc import Sequence

from hil.model.identity import Source
from hil.report.material import Body, Material, inner, text, texts
from hil.report.numbers import duration
from hil.report.page.view import Fact

__all__ = ["facts"]


def facts(material: Material, run: Body, bench: Body, events: Sequence[Body]) -> tuple[Fact, ...]:
    """Return who, what, when and where: label and value, empty where it is not recorded.

    Args:
        material: the run's evidence.
        run: what it was made of, from its results.
        bench: the head of its bench file.
        events: its events, in order.
    """
    dut = inner(run, "dut")
    span = _span(run, duration(events[-1].get("t")) if events else "")
    began, ended = material.stamps()
    return tuple(
        Fact(label=label, value=value)
        for label, value in (
            ("Device under test", text(dut, "title")),
            ("Part number", text(dut, "part")),
            ("Serial number", text(dut, "serial")),
            ("Model", text(dut, "model")),
            ("Hardware revision", text(dut, "hardware")),
            ("Firmware revision", text(dut, "firmware")),
            ("Purpose", text(run, "purpose")),
            ("Source", f"{text(run, 'source')}, served by another process" if _served(run) else text(run, "source")),
            ("Operator", text(run, "operator")),
            ("Bench", " · ".join(part for part in (text(run, "bench"), text(bench, "title")) if part)),
            ("Place", text(bench, "place")),
            ("Began (UTC)", _instant(began)),
            ("Ended (UTC)", _instant(ended)),
            ("Bench time", span),
            ("Plans", ", ".join(texts(run, "plans"))),
            ("Run", material.run()),
        )
    )


def _served(run: Body) -> bool:
    return bool(inner(run, "live").get("served"))


def _span(run: Body, lasted: str) -> str:
    """Return how long a run lasted in bench time, and what that time was."""
    live, epoch = inner(run, "live"), text(run, "epoch")
    if not lasted or text(run, "source") == Source.HARDWARE:
        return lasted
    if not live:
        return f"{lasted}, virtual{epoch and ' from '}{epoch}"
    speed = text(live, "speed").removesuffix(".0")
    return lasted if speed in {"", "1"} else f"{lasted}, at {speed} times real time"


def _instant(stamp: str) -> str:
    """Return a stamp as a person reads it, to the second."""
    return f"{stamp[:10]} {stamp[11:19]}" if len(stamp) > 19 else stamp
