"""Instruments and wiring of a bench file in readable form."""

from __future__ import annotations

from collections.abc import Mapping

from hil.report.material import Body, inner, inners, text
from hil.report.page.view import InstrumentRow, WireRow

__all__ = ["instruments", "wiring"]

_CERTIFICATE = ("register", "number", "certificate")


def instruments(bench: Body, records: Body) -> tuple[InstrumentRow, ...]:
    """Return the instruments of a bench file, in its order, then those read by hand, with their frozen calibrations."""
    section = inner(bench, "instruments")
    by_hand = sorted(name for name in records if name not in section)
    return (
        *(_instrument(name, inner(section, name), inner(records, name)) for name in section),
        *(_instrument(name, _by_hand(inner(records, name)), inner(records, name)) for name in by_hand),
    )


def _by_hand(record: Body) -> Body:
    return {"driver": "read by a person", "identity": {"serial": text(record, "serial")}}


def wiring(bench: Body) -> tuple[WireRow, ...]:
    """Return the wiring of a bench file, in its order."""
    return tuple(_wire(entry) for entry in inners(bench, "wiring"))


def _instrument(name: str, entry: Body, record: Body) -> InstrumentRow:
    calibration = record if text(record, "register") else inner(entry, "calibration")
    identity = inner(entry, "identity")
    return InstrumentRow(
        name=name,
        driver=text(entry, "driver"),
        identity=" ".join(text(identity, key) for key in ("manufacturer", "model", "serial", "firmware")).strip(),
        certificate=", ".join(part for part in (text(calibration, key) for key in _CERTIFICATE) if part),
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
    channel = text(entry, "channel")
    return WireRow(
        name=".".join(part for part in (text(entry, "role"), text(entry, "instance")) if part),
        instrument=text(entry, "instrument"),
        channel="" if channel == "0" else channel,
        note=text(entry, "note"),
        settings=tuple(_setting(key, value) for key, value in entry.items() if key not in shown),
    )


def _setting(key: str, value: object) -> str:
    """Return a setting of the wiring in words: `reduced: voltage 4.2, current 0.02; relay closed`."""
    return f"{_words(key)}: {_said(value)}"


def _said(value: object) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{_words(name)} {_said(inside)}" for name, inside in value.items())
    if isinstance(value, list | tuple):
        return "; ".join(map(_said, value)) or "none"
    return {"true": "yes", "false": "no", "None": "none", "": "none"}.get(str(value), str(value))


def _words(key: str) -> str:
    return key.replace("_", " ")
