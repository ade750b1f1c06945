"""The sections of a bench file about what its safe-off cannot do alone: cut paths, and the watch afterwards."""

from __future__ import annotations

from hil.bench.file.complaints import Located
from hil.documents.reader import MappingReader
from hil.model.cutting import CutPath, WatchAfter

__all__ = ["read_cut_paths", "read_watch_after"]


def read_cut_paths(document: MappingReader, places: Located) -> tuple[CutPath, ...]:
    """Read what cuts outputs off whose own port is gone."""
    paths = []
    for reader in document.children("cut_paths"):
        path = CutPath(
            output=reader.text("output"),
            by=reader.text("by", ""),
            state=reader.text("state", ""),
            hardware=reader.text("hardware", ""),
            within_s=reader.duration("within"),
        )
        reader.done()
        paths.append(places.keep(path, reader.place()))
    return tuple(paths)


def read_watch_after(document: MappingReader, places: Located) -> tuple[WatchAfter, ...]:
    """Read what must be seen behind the last safe-off."""
    watched = []
    for reader in document.children("watch_after"):
        toward = reader.number("toward", None)
        # What goes toward a value may take so long; what stays between bounds is watched for so long.
        watch = WatchAfter(
            output=reader.text("output"),
            quantity=reader.text("quantity"),
            unit=reader.text("unit"),
            minimum=None if toward is not None else reader.number("min"),
            maximum=None if toward is not None else reader.number("max"),
            toward=toward,
            tolerance=0.0 if toward is None else reader.number("tolerance"),
            seconds=reader.duration("for" if toward is None else "within"),
        )
        reader.done()
        watched.append(places.keep(watch, reader.place()))
    return tuple(watched)
