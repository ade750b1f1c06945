"""The bench as its frozen file says it: instruments with calibration, and wiring."""

from __future__ import annotations

from collections.abc import Mapping

from hil.documents.findings import Findings
from hil.documents.node import Mapping as MappingNode
from hil.documents.node import Node, Scalar, Sequence
from hil.documents.strict_yaml import parse_yaml
from hil.report.material import Body, flat, inner, inners, text
from hil.report.page.view import InstrumentRow, WireRow

__all__ = ["instruments", "parse", "wiring"]


def parse(content: str, shown: str) -> Body:
    """Return a YAML document as plain objects; an empty object where it is absent or cannot be read.

    Every scalar is its text as written: a report shows what a file says, it does not compute with it.
    """
    node = parse_yaml(content.encode(), shown, Findings()) if content else None
    value = _plain(node) if node is not None else {}
    return value if isinstance(value, Mapping) else {}


def instruments(bench: Body) -> tuple[InstrumentRow, ...]:
    """Return the instruments of a bench file, in its order."""
    section = inner(bench, "instruments")
    return tuple(_instrument(name, inner(section, name)) for name in section)


def wiring(bench: Body) -> tuple[WireRow, ...]:
    """Return the wiring of a bench file, in its order."""
    return tuple(_wire(entry) for entry in inners(bench, "wiring"))


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


def _plain(node: Node) -> object:
    if isinstance(node, MappingNode):
        return {key.text: _plain(value) for key, value in node.entries}
    if isinstance(node, Sequence):
        return [_plain(item) for item in node.items]
    return node.text if isinstance(node, Scalar) else ""
