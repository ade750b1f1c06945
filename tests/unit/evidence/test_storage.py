"""How a recording is stored: in its own file, with what every HDF5 library reads; anything else is never followed."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
from evidence_runs import begin, record, whole_case, write_report

from hil.evidence.events import Recording, RecordingEnd
from hil.evidence.folder import create, hold
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import seal
from hil.evidence.package.verification import verify
from hil.evidence.recordings.hdf5 import convert, differing_facts, read_blocks, read_hdf5
from hil.model.errors import EvidenceError


@pytest.fixture
def recording(tmp_path):
    """Return an HDF5 file with its two events, and a file beside it that holds the same numbers."""
    with begin(tmp_path) as journal:
        record(tmp_path, journal)
    package, place = Package(tmp_path), tmp_path / "data/recordings"
    begun, ended = package.of(Recording)[0], package.of(RecordingEnd)[0]
    convert(place / "001-rest.rows", place / "001-rest.h5", begun=begun, ended=ended)
    with h5py.File(tmp_path / "elsewhere.h5", "w") as file:
        file["x"] = np.zeros(100)
    (tmp_path / "elsewhere.bin").write_bytes(bytes(800))
    return place / "001-rest.h5", begun, ended


def external_link(group, beside):
    """Let a name lead into another file."""
    group["x"] = h5py.ExternalLink(beside / "elsewhere.h5", "/x")


def soft_link(group, _):
    """Let a name lead to another place of the file."""
    group["x"] = h5py.SoftLink("/time")


def external_data(group, beside):
    """Keep the numbers in another file."""
    group.create_dataset("x", (100,), "<f8", external=[(str(beside / "elsewhere.bin"), 0, 800)])


def view(group, beside):
    """Put the numbers together out of another file's."""
    layout = h5py.VirtualLayout((100,), "<f8")
    layout[:] = h5py.VirtualSource(beside / "elsewhere.h5", "x", (100,))
    group.create_virtual_dataset("x", layout)


def foreign_filter(group, _):
    """Store the numbers so that a plug-in would have to be loaded to read them."""
    made = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    made.set_chunk((100,))
    made.set_filter(h5py.h5z.FILTER_SCALEOFFSET, h5py.h5z.FLAG_OPTIONAL, (0, 2))
    space = h5py.h5s.create_simple((100,))
    h5py.h5d.create(group.id, b"x", h5py.h5t.IEEE_F64LE, space, made)


def references(group, _):
    """Store references to objects in the place of numbers."""
    group.create_dataset("x", (100,), h5py.ref_dtype)


def single(group, _):
    """Store numbers of 32 bits."""
    group.create_dataset("x", (100,), "<f4")


@pytest.mark.parametrize(
    ("replace", "told"),
    [
        (external_link, "'x' is a link to another place"),
        (soft_link, "'x' is a link to another place"),
        (external_data, "the numbers of 'x' are in another file"),
        (view, "'x' is a view of other datasets"),
        (foreign_filter, "'x' is stored with a filter that no recording has: 6"),
        (references, "'x' does not hold numbers of 64 bits, little-endian"),
        (single, "'x' does not hold numbers of 64 bits, little-endian"),
    ],
)
def test_numbers_that_are_not_in_the_file_are_refused(recording, tmp_path, replace, told):
    """External links, external raw data, views, plug-ins and references: refused wherever a recording is read."""
    path, *_ = recording
    with h5py.File(path, "r+") as file:
        del file["channels/x"]
        replace(file["channels"], tmp_path)
    for other in tmp_path.glob("elsewhere.*"):
        other.unlink()  # whoever looked there would say so
    for read in (read_hdf5, lambda path: list(read_blocks(path))):
        with pytest.raises(EvidenceError, match=told):
            read(path)


def test_a_channel_group_that_leads_elsewhere_is_refused(recording, tmp_path):
    """The group of the channels itself is in another file."""
    path, *_ = recording
    with h5py.File(path, "r+") as file:
        del file["channels"]
        file["channels"] = h5py.ExternalLink(tmp_path / "elsewhere.h5", "/")
    with pytest.raises(EvidenceError, match="'channels' is a link to another place"):
        read_hdf5(path)


@pytest.mark.parametrize("place", ["/", "/channels"])
def test_what_is_no_channel_is_refused(recording, place):
    """A second dataset that no journal names would be read by other programs."""
    path, *_ = recording
    with h5py.File(path, "r+") as file:
        file[place]["better"] = np.zeros(100)
    with pytest.raises(EvidenceError, match="'better' is no part of a recording"):
        read_hdf5(path)


@pytest.mark.parametrize(
    ("thing", "key", "value", "told"),
    [
        ("channels/x", "unit", "rad/s", "x: attribute 'unit' is 'rad/s', and the journal has 'deg/s'"),
        ("channels/x", "calibration", "C-9", "x: attribute 'calibration' is 'C-9', and the journal has 'C-1'"),
        ("channels/x", "uncertainty", 0.1, "x: attribute 'uncertainty' is 0.1, and the journal has None"),
        ("time", "unit", "ms", "time: attribute 'unit' is 'ms', and the journal has 's'"),
        ("/", "source", "simulated", "attribute 'source' is 'simulated', and the journal has 'hardware'"),
        ("/", "rate", 50.0, "attribute 'rate' is 50.0, and the journal has 100"),
        ("/", "note", "better", "attribute 'note' is 'better', and the journal has None"),
    ],
)
def test_facts_in_a_recording_are_those_of_the_journal(recording, thing, key, value, told):
    """Unit, instrument, certificate and source stand in the journal and beside the numbers."""
    path, begun, ended = recording
    assert list(differing_facts(path, begun=begun, ended=ended)) == []
    with h5py.File(path, "r+") as file:
        file[thing].attrs[key] = value
    assert list(differing_facts(path, begun=begun, ended=ended)) == [told]


def test_a_reference_among_the_facts_is_refused(recording):
    """An attribute that leads to an object is none that a recording has."""
    path, begun, ended = recording
    with h5py.File(path, "r+") as file:
        file.attrs["source"] = file.ref
    with pytest.raises(EvidenceError, match="attribute 'source' is neither a word nor a number"):
        list(differing_facts(path, begun=begun, ended=ended))


def test_a_package_with_such_a_recording_is_damaged(tmp_path, monkeypatch):
    """A recording whose numbers are elsewhere, sealed as if a run had written it, is found by verification."""
    folder = create(tmp_path / "reports", bench="flight", dut="SN1")
    (tmp_path / "elsewhere.bin").write_bytes(bytes(800))

    def inventory_after(run):
        with h5py.File(run / "data/recordings/001-rest.h5", "r+") as file:
            del file["channels/x"]
            external_data(file["channels"], tmp_path)
        return before(run)

    from hil.evidence.package import sealing  # noqa: PLC0415 - patched here alone

    before = sealing.inventory
    with hold(folder):
        journal = begin(folder)
        whole_case(folder, journal)
        monkeypatch.setattr(sealing, "inventory", inventory_after)
        seal(folder, journal, exit_code=0, write_reports=write_report)
    found = [str(finding) for finding in verify(folder).findings]
    assert any("the numbers of 'x' are in another file" in line for line in found), found
