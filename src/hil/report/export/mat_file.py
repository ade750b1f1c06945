"""A recording as a MATLAB 5 file: a variable per channel, and structures with units, channels and facts."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from hil.evidence.package.listing import shown
from hil.evidence.recordings.hdf5 import read_column
from hil.model.errors import EvidenceError, Refused
from hil.report.export.selection import Facts

__all__ = ["matlab_names", "write_mat"]

_KEYWORDS = (
    "break case catch classdef continue else elseif end for function global if otherwise parfor persistent return"
    " spmd switch try while"
)
_OURS = ("time", "units", "channels", "facts")
_LONGEST = 63
_DESCRIPTION = 116
"""Bytes of free text at the beginning of a MATLAB 5 file."""
_MOST_BYTES = 2**31 - 64
"""A variable of a MATLAB 5 file is shorter than 2 GiB, its description included."""


def write_mat(recording: Path, file: Path, facts: Facts, *, compressed: bool) -> None:
    """Write a recording as a MATLAB 5 file, one channel at a time, and prove by reading back that nothing was lost.

    Its variables are `time` and one per channel, columns of doubles of shape (rows, 1), then `units` by variable,
    `channels` as an array of structures, and `facts`. The same recording gives the same bytes.

    Args:
        recording: its HDF5 file.
        file: the file to write.
        facts: the recording's facts.
        compressed: whether the variables are compressed.

    Raises:
        Refused: where a channel is too long for such a file.
        EvidenceError: where the recording cannot be read, or does not come back equal.
        OSError: where the file cannot be written.
    """
    from scipy.io import savemat  # noqa: PLC0415 - slow to import

    if facts["rows"] * 8 >= _MOST_BYTES:
        raise Refused(f"{facts['recording']}: its channels are too long for a MATLAB 5 file", "export it with --csv")
    columns = ["time", *(channel["name"] for channel in facts["channels"])]
    variables = dict(zip(["time", *matlab_names(columns[1:])], columns, strict=True))
    stream: Any  # which scipy takes, and its published types do not know
    with file.open("wb") as stream:
        for variable, column in variables.items():  # a stream that has begun is continued
            values = {variable: read_column(recording, column).reshape(-1, 1)}
            savemat(stream, values, do_compression=compressed)
        savemat(stream, _structures(variables, facts), do_compression=compressed, long_field_names=True)
        stream.seek(0)  # scipy writes the time of day there, and an equal export should be equal
        stream.write(_description(facts))
    _prove(file, recording, variables)


def matlab_names(channels: Sequence[str]) -> list[str]:
    """Return a valid and free name of a MATLAB variable for each channel."""
    taken = {*_KEYWORDS.split(), *_OURS}
    names = []
    for channel in channels:
        plain = re.sub(r"[^A-Za-z0-9_]+", "_", channel)
        plain = plain if re.match("[A-Za-z]", plain) else f"x{plain}"
        name, count = plain[:_LONGEST], 1
        while name in taken:
            count += 1
            name = f"{plain[: _LONGEST - len(f'_{count}')]}_{count}"
        taken.add(name)
        names.append(name)
    return names


def _structures(variables: Mapping[str, str], facts: Facts) -> dict[str, Any]:
    import numpy as np  # noqa: PLC0415 - slow to import

    units = dict(zip(variables, ["s", *(channel["unit"] for channel in facts["channels"])], strict=True))
    told = [
        channel | {"variable": variable} for variable, channel in zip([*variables][1:], facts["channels"], strict=True)
    ]
    fields = [*told[0]] if told else ["name"]
    channels = np.empty((len(told), 1), dtype=[(field, object) for field in fields])
    for index, channel in enumerate(told):
        channels[index, 0] = tuple(_plain(channel[field]) for field in fields)
    rest = {name: _plain(value) for name, value in facts.items() if name != "channels"}
    return {"units": units, "channels": channels, "facts": rest}


def _plain(value: object) -> Any:  # noqa: ANN401 - whatever MATLAB has for it
    """Return a fact as MATLAB has it: an unknown fact is an empty matrix, a list of words a cell array."""
    import numpy as np  # noqa: PLC0415 - slow to import

    if value is None:
        return np.empty((0, 0))
    if isinstance(value, Mapping):
        return {name: _plain(part) for name, part in value.items()}
    if isinstance(value, list):
        cells = np.empty((len(value), 1), dtype=object)
        cells[:, 0] = value
        return cells
    if isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    return value


def _description(facts: Facts) -> bytes:
    """Return the text that tools show for the file, with mark and digest."""
    mark = f"{facts['mark']}, " if facts["mark"] else ""
    text = shown(f"MATLAB 5.0 MAT-file, {mark}evidence digest {facts['evidence_digest']}")
    return text.encode("ascii", "replace")[:_DESCRIPTION].ljust(_DESCRIPTION)


def _prove(file: Path, recording: Path, variables: Mapping[str, str]) -> None:
    import numpy as np  # noqa: PLC0415 - slow to import
    from scipy.io import loadmat  # noqa: PLC0415 - slow to import

    for variable, column in variables.items():
        found = loadmat(file, variable_names=[variable])[variable]
        if not np.array_equal(found[:, 0], read_column(recording, column), equal_nan=True):
            raise EvidenceError(f"{file}: {variable} does not read back as it was recorded", "check the disk")
