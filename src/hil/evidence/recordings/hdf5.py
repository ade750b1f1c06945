"""Recordings in HDF5: converted from rows, checked against the journal's hashes, read as arrays, reverted to rows."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hil.evidence.durable import PART, sync_file, sync_folder
from hil.evidence.events import Channel, Recording, RecordingEnd
from hil.evidence.recordings.datasets import (
    Dataset,
    add_dataset,
    describe,
    have_room,
    listed_words,
    open_dataset,
    read_part,
    require_own,
    told_by_number,
    told_of,
    write_part,
)
from hil.evidence.recordings.row_file import BLOCK, PIECE, Columns, RowsFile, header_line, read_rows, row_blocks, table
from hil.model.errors import EvidenceError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

__all__ = [
    "Recorded",
    "convert",
    "differing_facts",
    "hashes_of",
    "read_blocks",
    "read_column",
    "read_hdf5",
    "read_recording",
    "revert",
    "write_hdf5",
]

_TIME = {"unit": "s", "meaning": "bench time"}
_TIME_OF_CAPTURE = {"unit": "s", "meaning": "time after the trigger"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """A recording: its channels over time.

    Attributes:
        id: its id in the run.
        name: the name that the case gave it.
        rate: nominal rate in Hz.
        time: bench time of every row in s, for a capture the time after its trigger, shape (rows,).
        arrays: values by channel, shape (rows,); NaN where the device marked a sample invalid.
        units: unit by channel.
        instruments: instrument by channel.
        source: hardware, simulated or replayed.
        complete: whether it lasted as long as planned.
    """

    id: str
    name: str
    rate: float
    time: NDArray[np.float64]
    arrays: Mapping[str, NDArray[np.float64]]
    units: Mapping[str, str]
    instruments: Mapping[str, str]
    source: str
    complete: bool

    @property
    def channels(self) -> tuple[str, ...]:
        """The names of the channels, in order."""
        return tuple(self.arrays)

    def unit(self, channel: str) -> str:
        """Return the unit of one channel."""
        return self.units[channel]

    def __getitem__(self, channel: str) -> NDArray[np.float64]:
        return self.arrays[channel]

    def __len__(self) -> int:
        return len(self.time)

    def part(self, first: int, end: int) -> dict[str, NDArray[np.float64]]:
        """Return copies of `time` and every channel for the rows from `first` to before `end`."""
        if isinstance(self.arrays, _LAZY):
            return self.arrays.part(first, end)
        return {name: each[first:end].copy() for name, each in {"time": self.time, **self.arrays}.items()}


def convert(rows: Path, hdf5: Path, *, begun: Recording, ended: RecordingEnd) -> None:
    """Convert a row file to HDF5, and prove by reading it back that nothing was lost.

    The HDF5 file is on disk, but its name may not be: the rows may be removed once the folder is synced. A row file
    that is still there because the machine went down is converted again, to the same bytes.

    Args:
        rows: the row file, which stays.
        hdf5: the file to write, atomically.
        begun: the recording.
        ended: its end.

    Raises:
        EvidenceError: if the rows do not match the journal's hashes.
    """
    found = read_rows(rows)
    part = hdf5.with_name(hdf5.name + PART)
    write_hdf5(found, part, begun=begun, ended=ended)
    ((count, digest),) = hashes_of(part, [ended.rows])
    if found.rows != ended.rows or count != ended.rows or digest != ended.sha256:
        raise EvidenceError(
            f"{rows}: {found.rows} rows with hash {digest}, but the journal names {ended.rows} rows with hash"
            f" {ended.sha256}",
            "keep the folder as it is; the recording was changed behind the run's back",
        )
    part.replace(hdf5)


def write_hdf5(found: RowsFile, path: Path, *, begun: Recording, ended: RecordingEnd) -> None:
    """Write the rows as HDF5: dataset `time`, and one per channel in group `channels`; same rows, same bytes."""
    import h5py  # noqa: PLC0415 - slow to import

    names = [channel.name for channel in begun.channels]
    have_room(path, found.rows, 1 + len(names))
    with told_by_number(), h5py.File(path, "w", libver=("v110", "v110")) as file:
        describe(file.id, {**_facts(begun, ended), "order": names or [""]})
        group = file.create_group("channels")
        sets = [add_dataset(file, "time", found.rows), *(add_dataset(group, name, found.rows) for name in names)]
        for dataset, facts in zip(sets, [_facts_of_time(begun), *map(_facts_of_channel, begun.channels)], strict=True):
            describe(dataset, facts)
        for place, block in enumerate(row_blocks(found, PIECE)):
            for dataset, column in zip(sets, table(block, found.width).T.copy(), strict=True):
                write_part(dataset, place * PIECE, column)
    sync_file(path)


def read_recording(folder: Path, begun: Recording, ended: RecordingEnd | None) -> Recorded:
    """Return a recording from HDF5, or from its rows if the run is not sealed yet.

    Args:
        folder: the run's `data/recordings`.
        begun: the recording.
        ended: its end, None while it is in progress.

    Raises:
        EvidenceError: if neither file can be read.
    """
    name, hdf5 = begun.recording, folder / f"{begun.recording}.h5"
    columns: Mapping[str, NDArray[np.float64]]
    if hdf5.exists():
        columns = _Stored(hdf5) if ended and ended.rows > BLOCK else read_hdf5(hdf5)
    else:
        columns = _columns(read_rows(folder / f"{name}.rows"))
    return Recorded(
        id=name,
        name=begun.name,
        rate=float(begun.rate),
        time=columns["time"],
        arrays=columns if isinstance(columns, _LAZY) else {key: columns[key] for key in columns if key != "time"},
        units={channel.name: channel.unit for channel in begun.channels},
        instruments={channel.name: channel.instrument for channel in begun.channels},
        source=begun.source,
        complete=bool(ended and ended.complete),
    )


class _Stored(Mapping[str, "NDArray[np.float64]"]):
    """The channels of an HDF5 file by name, read lazily. See `Columns`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        with _open(path) as sets:
            self._names = tuple(sets)

    def __getitem__(self, name: str) -> NDArray[np.float64]:
        if name not in self._names:
            raise KeyError(name)
        return read_column(self._path, name)

    def __iter__(self) -> Iterator[str]:
        return iter(self._names[1:])

    def __len__(self) -> int:
        return len(self._names) - 1

    def part(self, first: int, end: int) -> dict[str, NDArray[np.float64]]:
        """Return time and channels for the rows from `first` to before `end`."""
        with _open(self._path) as sets:
            first, end, _ = slice(first, end).indices(sets["time"].shape[0])
            return {name: read_part(dataset, first, max(first, end)) for name, dataset in sets.items()}


_LAZY = (Columns, _Stored)
"""The types that read channels lazily."""


def _columns(found: RowsFile) -> Mapping[str, NDArray[np.float64]]:
    """Return `time` and every channel of a row file; those of a large one are read lazily."""
    columns = Columns(found)
    return columns if found.rows > BLOCK else columns.part(0, found.rows)


def read_hdf5(path: Path) -> dict[str, NDArray[np.float64]]:
    """Return `time` and every channel of a recording's HDF5 file.

    Raises:
        EvidenceError: if it cannot be read.
    """
    with _open(path) as sets:
        return {name: read_part(dataset, 0, dataset.shape[0]) for name, dataset in sets.items()}


def read_column(path: Path, name: str) -> NDArray[np.float64]:
    """Return `time` or one channel of a recording's HDF5 file, shape (rows,).

    Raises:
        EvidenceError: if it cannot be read.
    """
    with _open(path) as sets:
        return read_part(sets[name], 0, sets[name].shape[0])


def read_blocks(path: Path, most: int = BLOCK) -> Iterator[list[NDArray[np.float64]]]:
    """Yield the rows of a recording's HDF5 file in blocks of at most `most`, so that memory does not grow with it.

    Returns:
        For each block the time and then every channel, each of shape (n,).

    Raises:
        EvidenceError: if the file cannot be read.
    """
    with _open(path) as sets:
        rows = sets["time"].shape[0]
        for start in range(0, rows, most):
            yield [read_part(dataset, start, min(start + most, rows)) for dataset in sets.values()]


def hashes_of(path: Path, at: Sequence[int]) -> list[tuple[int, str]]:
    """Compute the row hash of an HDF5 file at each of these row counts.

    Returns:
        For each count in `at`, ascending, the number of rows up to it that exist, and the hash over their bytes.

    Raises:
        EvidenceError: if the file cannot be read.
    """
    with _open(path) as sets:
        return list(_hashes([*sets.values()], at))


def differing_facts(path: Path, *, begun: Recording, ended: RecordingEnd) -> Iterator[str]:
    """Yield a sentence for every attribute of an HDF5 file that does not match the recording's events.

    Raises:
        EvidenceError: if the file cannot be read.
    """
    with _open(path) as sets:
        names = [channel.name for channel in begun.channels]
        if [*sets] != ["time", *names]:
            yield f"its channels are {', '.join([*sets][1:])}, and the journal has {', '.join(names)}"
            return
        import h5py  # noqa: PLC0415 - slow to import

        due = [(h5py.h5i.get_file_id(sets["time"]), "", _facts(begun, ended) | {"order": names or [""]})]
        facts = [_facts_of_time(begun), *map(_facts_of_channel, begun.channels)]
        due += [(dataset, f"{name}: ", each) for (name, dataset), each in zip(sets.items(), facts, strict=True)]
        for thing, where, right in due:
            told, known = told_of(thing), {key: value for key, value in right.items() if value is not None}
            for key in sorted(told.keys() | known.keys()):
                if told.get(key) != known.get(key):
                    was, is_due = map(_plain, (told.get(key), known.get(key)))
                    yield f"{where}attribute '{key}' is {was!r}, and the journal has {is_due!r}"


def _plain(value: object) -> object:
    """Return a value for display: the words of an enumeration as texts."""
    return str(value) if isinstance(value, str) else value


@contextmanager
def _open(path: Path) -> Iterator[dict[str, Dataset]]:
    """Open a recording's HDF5 file: `time`, and the channels in their order.

    Raises:
        EvidenceError: if it cannot be read, now or while it is open.
    """
    import h5py  # noqa: PLC0415 - slow to import

    try:
        with h5py.File(path, "r") as file:
            yield _sets(file)
    except (OSError, KeyError, ValueError, TypeError, RuntimeError, AttributeError) as error:
        raise EvidenceError(f"{path}: this HDF5 file cannot be read: {error}", "see hil verify") from error


def _hashes(sets: Sequence[Dataset], at: Sequence[int]) -> Iterator[tuple[int, str]]:
    import numpy as np  # noqa: PLC0415 - slow to import

    running, done, rows = hashlib.sha256(), 0, sets[0].shape[0]
    for target in sorted(at):
        while done < min(target, rows):
            stop = min(target, done + PIECE, rows)
            running.update(np.column_stack([read_part(dataset, done, stop) for dataset in sets]).tobytes())
            done = stop
        yield done, running.hexdigest()


def _sets(file: Any) -> dict[str, Dataset]:  # noqa: ANN401 - h5py publishes no types
    """Return `time` and the channels in their order, open."""
    require_own(file, "channels")
    group = file["channels"]
    channels = {name: open_dataset(group, name) for name in listed_words(file.id, "order") if name}
    for holder, names in ((file, {"channels", "time"}), (group, {*channels})):
        if more := sorted({*holder} - names):
            raise ValueError(f"'{more[0]}' is no part of a recording")
    return {"time": open_dataset(file, "time"), **channels}


def _facts(begun: Recording, ended: RecordingEnd) -> dict[str, Any]:
    facts = {key: getattr(begun, key) for key in ("recording", "name", "case", "step", "rate", "duration", "source")}
    facts |= {key: getattr(ended, key) for key in ("rows", "sha256", "complete", "gaps")}
    if begun.capture is not None:
        of_capture = {"interval": "interval", "trigger_channel": "channel", "trigger_level": "level"}
        of_capture |= {"trigger_slope": "slope", "first": "first"}
        facts |= {key: getattr(begun.capture, name) for key, name in of_capture.items()}
    return {"format": 1} | {key: _as_json(value) for key, value in facts.items()}


def _facts_of_time(begun: Recording) -> dict[str, Any]:
    return _TIME if begun.capture is None else _TIME_OF_CAPTURE


_OF_CHANNEL = ("calibration", "instrument", "uncertainty", "unit", "probe", "resolution", "low", "high")


def _facts_of_channel(channel: Channel) -> dict[str, Any]:
    return {key: _as_json(getattr(channel, key)) for key in _OF_CHANNEL}


def _as_json(value: object) -> object:
    """Return a value as JSON has it, with whole numbers as integers, as in the attributes of all packages."""
    return int(value) if type(value) is float and value.is_integer() else value


def revert(folder: Path, begun: Iterable[Recording]) -> None:
    """Turn every HDF5 file back into the row file that it was made from; an existing row file is the original.

    Args:
        folder: the run's `data/recordings`.
        begun: its recordings.

    Raises:
        EvidenceError: if an HDF5 file cannot be read.
        OSError: if the disk is full or fails.
    """
    for event in begun:
        rows, hdf5 = (folder / f"{event.recording}{suffix}" for suffix in (".rows", ".h5"))
        if not hdf5.exists():
            continue
        if not rows.exists():
            _write(rows, hdf5, event)
        hdf5.unlink()


def _write(rows: Path, hdf5: Path, begun: Recording) -> None:
    import numpy as np  # noqa: PLC0415 - slow to import

    part = rows.with_name(rows.name + PART)
    with part.open("wb") as stream:
        stream.write(header_line(begun.recording, [(each.name, each.unit) for each in begun.channels]))
        for block in read_blocks(hdf5):
            stream.write(np.column_stack(block).astype("<f8").tobytes())
    sync_file(part)
    part.replace(rows)
    sync_folder(rows.parent)
