"""What a report is made from: a run's events, results and recordings, and its frozen files as plain objects."""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from hil.documents.findings import Findings
from hil.documents.node import Mapping as MappingNode
from hil.documents.node import Node, Scalar
from hil.documents.node import Sequence as SequenceNode
from hil.documents.strict_yaml import parse_yaml
from hil.evidence.durable import read_plain
from hil.evidence.events import Event
from hil.evidence.ledger.entries import ZERO
from hil.evidence.package.bag import INFO, identifier_of
from hil.evidence.package.contents import Package
from hil.evidence.recordings.hdf5 import Recorded
from hil.evidence.results.outcome import Outcome
from hil.evidence.safed import guardian_lines
from hil.model.errors import EvidenceError
from hil.report.numbers import limit_text
from hil.requirements.requirement import Decision

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "Body",
    "Material",
    "Trace",
    "decimate",
    "demands",
    "documents",
    "flag",
    "flat",
    "inner",
    "inners",
    "parse",
    "plan_files",
    "requirement_entries",
    "text",
    "texts",
    "unspoken",
]

Body = Mapping[str, object]

_MOST = 65_536  # samples of a channel; a drawing takes fewer still


@dataclass(frozen=True, slots=True, kw_only=True)
class Trace:
    """One channel of a recording: seconds since the bench's epoch and values, both of shape (n,)."""

    name: str
    unit: str
    times: NDArray[np.float64]
    values: NDArray[np.float64]


class Material:
    """What a run left behind: a sealed package, or one that is about to be sealed.

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

    def ledger_head(self) -> str:
        """Return the head of the ledger before the seal; empty where there was none, or none is named."""
        lines = self._package.lines()
        head = str(lines[-1].wall.get("ledger", "")) if lines else ""
        return "" if head == ZERO else head

    def sent(self) -> Mapping[int, str]:
        """Return the UTC at which messages from other terminals were sent; earlier records lack it."""
        return {line.event.seq: str(line.wall["sent"]) for line in self._package.lines() if "sent" in line.wall}

    def stamp_of(self, seq: int) -> str:
        """Return the UTC of an event, by its sequence number."""
        lines = self._package.lines()
        return str(lines[seq].wall.get("utc", "")) if 0 <= seq < len(lines) else ""

    def content(self, path: str, most: int) -> bytes:
        """Return a file of the package; nothing where it is missing or larger than that many bytes."""
        try:
            return read_plain(self._package.folder / path, most)
        except OSError:
            return b""

    def events(self) -> Sequence[Event]:
        """Return the events that stand, in order."""
        return self._package.events

    def results(self) -> Outcome:
        """Return the results."""
        return self._package.outcome()

    def text(self, relative: str) -> str:
        """Return a file under `data/`, or an empty text where there is none."""
        return self._package.text(f"data/{relative}") if (self._data / relative).is_file() else ""

    def guardian(self) -> Sequence[Body]:
        """Return what the guardian recorded; nothing if it had nothing to do."""
        return guardian_lines(self._package.folder)

    def names(self, folder: str) -> Sequence[str]:
        """Return the sorted names directly within a folder under `data/`."""
        place = self._data / folder
        return sorted(entry.name for entry in place.iterdir()) if place.is_dir() else []

    def traces(self, recording: str) -> Sequence[Trace]:
        """Return the channels of a recording; none if its samples cannot be read, which `hil verify` reports."""
        try:
            found = self._package.recording(recording)
            return [_trace(found, name) for name in found.channels]
        except EvidenceError:
            return []


def text(body: Body, key: str) -> str:
    """Return a field as text, empty where it is absent or null."""
    value = body.get(key)
    return "" if value is None else str(value)


def flag(body: Body, key: str) -> bool:
    """Return whether a field is there and true."""
    return body.get(key) is True


def inner(body: Body, key: str) -> Body:
    """Return a field that is an object, empty where it is absent or null."""
    value = body.get(key)
    return value if isinstance(value, Mapping) else {}


def inners(body: Body, key: str) -> tuple[Body, ...]:
    """Return a field that is a list of objects."""
    value = body.get(key)
    return tuple(item for item in value if isinstance(item, Mapping)) if isinstance(value, list | tuple) else ()


def texts(body: Body, key: str) -> tuple[str, ...]:
    """Return a field that is a list of texts."""
    value = body.get(key)
    return tuple(str(item) for item in value) if isinstance(value, list | tuple) else ()


def flat(body: Body, before: str = "") -> Iterable[tuple[str, str]]:
    """Yield every leaf of an object as a dotted name and its text, sorted by name."""
    for key in sorted(body):
        value, name = body[key], f"{before}{key}"
        if isinstance(value, Mapping):
            yield from flat(value, f"{name}.")
        elif isinstance(value, list | tuple) and any(isinstance(item, Mapping) for item in value):
            yield from flat({f"{place:03d}": item for place, item in enumerate(value, 1)}, f"{name}.")
        elif isinstance(value, list | tuple):
            yield name, ", ".join(str(item) for item in value)
        else:
            yield name, "" if value is None else str(value)


def decimate(
    times: NDArray[np.float64], values: NDArray[np.float64], points: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return at most about `points` samples that keep the lowest and highest of every stretch.

    Args:
        times: instants, shape (n,).
        values: samples, shape (n,); NaN stays a hole only where a whole stretch is NaN.
        points: how many samples may remain, at least 2.
    """
    import numpy as np  # noqa: PLC0415 - slow to import

    size = len(values)
    stretch = -(-size // max(points // 2, 1))
    if size <= points or stretch < 2:
        return times, values
    whole = size // stretch * stretch
    rows = values[:whole].reshape(-1, stretch)
    holes = np.isnan(rows)
    pierced = bool(holes.any())  # weeks of samples are copied for holes only if there are some
    low = np.argmin(np.where(holes, np.inf, rows) if pierced else rows, axis=1)
    high = np.argmax(np.where(holes, -np.inf, rows) if pierced else rows, axis=1)
    base = np.arange(0, whole, stretch)
    rest = np.arange(whole, size)
    kept = np.unique(np.concatenate([base + low, base + high, rest[:1], rest[-1:]]))
    return times[kept], values[kept]


def _trace(found: Recorded, name: str) -> Trace:
    """Return one channel; of a long one the lowest and highest of each stretch, so that it leaves memory again."""
    times, values = decimate(found.time, found[name], _MOST)
    return Trace(name=name, unit=found.unit(name), times=times, values=values)


def parse(content: str, shown: str) -> Body:
    """Return a YAML document as plain objects; an empty object where it is absent or cannot be read.

    Every scalar is its text as written: a report shows what a file says, it does not compute with it.
    """
    node = parse_yaml(content.encode(), shown, Findings()) if content else None
    value = _plain(node) if node is not None else {}
    return value if isinstance(value, Mapping) else {}


def plan_files(material: Material, name: str) -> Iterator[tuple[str, Body]]:
    """Give every plan that was frozen with its file of that name; an empty object where it has none."""
    for plan in material.names("catalogue"):
        relative = f"catalogue/{plan}/{name}"
        yield plan, parse(material.text(relative), relative)


def documents(material: Material) -> tuple[tuple[str, Body], ...]:
    """Return by plan what document its requirements are from: `id`, `issue` and `title`."""
    files = plan_files(material, "requirements.yaml")
    return tuple((plan, inner(file, "document")) for plan, file in files if inners(file, "requirements"))


def requirement_entries(material: Material) -> Mapping[str, Body]:
    """Return by id the entries of requirements as their files have them."""
    files = plan_files(material, "requirements.yaml")
    return {text(entry, "id"): entry for _, file in files for entry in inners(file, "requirements")}


def unspoken(entries: Mapping[str, Body], spoken: Container[str]) -> tuple[tuple[str, str], ...]:
    """Return the requirements of the plans that a run does not cover, with the reason: the method, or `withdrawn`."""
    return tuple(
        (name, "withdrawn" if text(entry, "withdrawn") == "true" else text(entry, "method"))
        for name, entry in sorted(entries.items())
        if name not in spoken
    )


def demands(entry: Body) -> tuple[str, ...]:
    """Return what a requirement demands, a line each: its limits, its recordings, and its variants."""
    limits = tuple(_limit(limit) for limit in inners(entry, "limits"))
    records = inner(entry, "records")
    over = inner(entry, "over")
    variants = tuple(f"for each {name} of {', '.join(texts(over, name))}" for name in over)
    return (*limits, *((_records(records),) if records else ()), *variants)


def _limit(limit: Body) -> str:
    bounds = limit_text({name: limit[name] for name in ("min", "max", "equals") if name in limit}, text(limit, "unit"))
    of = f" [{_in_short(texts(limit, 'of'))}]" if texts(limit, "of") else ""
    tur = f", TUR at least {text(limit, 'min_tur')}" if text(limit, "min_tur") else ""
    usual = Decision.SIMPLE if "equals" in limit else Decision.GUARDED  # as the catalogue's reader has it
    rule = f", {text(limit, 'decision') or usual}" if bounds else ""
    return f"{text(limit, 'parameter')}{of} {bounds or 'recorded, without a limit'}{rule}{tur}"


def _in_short(names: Sequence[str]) -> str:
    """Return names as a list; numbers that count up by one as the first and the last of them."""
    first, last = names[0], names[-1]
    counts = first.isascii() and first.isdigit() and [*names] == [str(int(first) + step) for step in range(len(names))]
    return f"{first} to {last}" if counts and len(names) > 2 else ", ".join(names)


def _records(records: Body) -> str:
    gap = text(records, "max_gap")
    parts = (
        ", ".join(texts(records, "channels")),
        text(records, "rate"),
        text(records, "duration"),
        f"gaps up to {gap}" if gap else "",
    )
    return f"recording {text(records, 'recording')}: {'; '.join(part for part in parts if part)}"


def _plain(node: Node) -> object:
    if isinstance(node, MappingNode):
        return {key.text: _plain(value) for key, value in node.entries}
    if isinstance(node, SequenceNode):
        return [_plain(item) for item in node.items]
    return node.text if isinstance(node, Scalar) else ""
