"""The limits of the envelope in a bench file, those on derived quantities too."""

from __future__ import annotations

from hil.bench.derived.derivation import MADE_OF
from hil.documents.reader import MappingReader
from hil.model.envelope import Derived, EnvelopeLimit

__all__ = ["read_envelope_limit"]

_KEYS = ("of", "while", "threshold", "since", "over", "band", "against")


def read_envelope_limit(reader: MappingReader) -> EnvelopeLimit:
    """Read one limit of the envelope."""
    quantity = reader.text("quantity")
    limit = EnvelopeLimit(
        id=reader.text("id", pattern="[a-z][a-z0-9-]*"),
        output=reader.text("output"),
        quantity=quantity,
        unit=reader.text("unit"),
        minimum=reader.number("min", None),
        maximum=reader.number("max", None),
        period_s=reader.duration("period"),
        max_age_s=reader.duration("max_age"),
        debounce=reader.integer("debounce", 1, minimum=1),
        derived=_derived(reader, quantity),
    )
    reader.done()
    return limit


def _derived(reader: MappingReader, quantity: str) -> Derived | None:
    """Read how a quantity is derived; None where it is what is read."""
    given = [reader.has(key) for key in _KEYS]
    if quantity not in MADE_OF and not any(given):
        return None
    return Derived(
        of=reader.text("of", ""),
        flow=reader.text("while", "", choices=("charging", "discharging", "flowing")),
        threshold=reader.number("threshold", None),
        since=reader.text("since", "", choices=("phase", "arm")),
        over_s=reader.duration("over", None),
        band=reader.number("band", None),
        against=reader.text("against", ""),
    )
