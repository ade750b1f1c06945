"""A package as material for reports."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from hil.evidence.package.bag import INFO, identifier_of
from hil.evidence.package.contents import Package
from hil.evidence.recordings.hdf5 import Recorded
from hil.model.errors import EvidenceError
from hil.report.drawing.traces import decimate
from hil.report.material import Body, Trace

__all__ = ["PackageMaterial"]

_MOST = 65_536  # samples of a channel; a drawing takes fewer still


class PackageMaterial:
    """The folder of a run, sealed or about to be.

    Args:
        package: the run.
    """

    def __init__(self, package: Package) -> None:
        self._package = package
        self._data = package.folder / "data"

    def run(self) -> str:
        """Return the name that the folder had at its seal; a copy under another name gives the same report."""
        if self._package.sealed:
            return identifier_of(self._package.text(INFO)) or self._package.name
        return self._package.name

    def stamps(self) -> tuple[str, str]:
        """Return the UTC of the first and of the last event."""
        lines = self._package.lines()
        return (str(lines[0].wall.get("utc", "")), str(lines[-1].wall.get("utc", ""))) if lines else ("", "")

    def sent(self) -> Mapping[int, str]:
        """Return the UTC at which what came from other terminals was sent; earlier records do not tell it."""
        return {line.body["seq"]: str(line.wall["sent"]) for line in self._package.lines() if "sent" in line.wall}

    def events(self) -> Sequence[Body]:
        """Return the bodies of the journal in order."""
        return self._package.events()

    def results(self) -> Body:
        """Return the results."""
        return self._package.results()

    def text(self, relative: str) -> str:
        """Return a file under `data/`, or an empty text where there is none."""
        return self._package.text(f"data/{relative}") if (self._data / relative).is_file() else ""

    def names(self, folder: str) -> Sequence[str]:
        """Return the sorted names directly within a folder under `data/`."""
        place = self._data / folder
        return sorted(entry.name for entry in place.iterdir()) if place.is_dir() else []

    def traces(self, recording: str) -> Sequence[Trace]:
        """Return the channels of a recording; none where its samples cannot be read, which `verify` tells."""
        try:
            found = self._package.recording(recording)
            return [_trace(found, name) for name in found.channels]
        except EvidenceError:
            return []


def _trace(found: Recorded, name: str) -> Trace:
    """Return one channel; of a long one the lowest and highest of each stretch, so that it leaves memory again."""
    times, values = decimate(found.time, found[name], _MOST)
    return Trace(name=name, unit=found.unit(name), times=times, values=values)
