"""Exports: the same numbers for other programs, whole files only, and never from a package that is not whole."""

from __future__ import annotations

import csv
import errno
import hashlib
import json
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest
from evidence_runs import begin, case_end, check, record, recorded_check, sealed_run, write_report
from scipy.io import loadmat
from told_as_json import bodies
from typed_events import event_of

from hil.evidence.folder import JOURNAL, RECORDINGS
from hil.evidence.package.contents import Package
from hil.evidence.package.sealing import recover, seal
from hil.evidence.recordings.datasets import add_dataset, write_part
from hil.model.errors import EvidenceError, Refused
from hil.report.export import package as exporting
from hil.report.export.csv_table import TableFormat, write_csv
from hil.report.export.mat_file import matlab_names, write_mat
from hil.report.export.package import ExportRequest, export_package
from hil.report.export.selection import choose

BOTH = {"table": TableFormat(), "mat": True}


def exported(folder, output, **request):
    """Export everything, and return what was written."""
    return list(export_package(folder, ExportRequest(output=output, **request)))


@pytest.fixture(scope="module")
def sealed(tmp_path_factory):
    """A sealed run of hardware with one recording of 100 rows, and its evidence digest."""
    folder = tmp_path_factory.mktemp("export") / "run"
    return folder, sealed_run(folder)


def test_a_table_holds_every_number(sealed, tmp_path):
    """One line of names with units, then rows whose numbers are the recorded ones; NaN is empty."""
    folder, _ = sealed
    exported(folder, tmp_path, table=TableFormat())
    names, *rows = csv.reader((tmp_path / "001-rest.csv").read_text(encoding="utf-8").splitlines())
    assert names == ["time [s]", "x [deg/s]"]
    assert rows[3][1] == ""
    read = np.array([[float(text or "nan") for text in row] for row in rows])
    recorded = Package(folder).recording("001-rest")
    assert np.array_equal(read[:, 0], recorded.time)
    assert np.array_equal(read[:, 1], recorded["x"], equal_nan=True)


def test_facts_stand_beside_a_table_and_are_bound_to_it(sealed, tmp_path):
    """Run, digest, instrument, unit and calibration, with the hash of the table they speak of."""
    folder, digest = sealed
    exported(folder, tmp_path, table=TableFormat())
    facts = json.loads((tmp_path / "001-rest.json").read_text(encoding="utf-8"))
    assert (facts["run"], facts["evidence_digest"], facts["mark"]) == ("run", digest, "")
    assert facts["file"]["sha256"] == hashlib.sha256((tmp_path / "001-rest.csv").read_bytes()).hexdigest()
    assert facts["channels"] == [
        {"name": "x", "unit": "deg/s", "instrument": "psu1", "uncertainty": None, "calibration": "C-1",
         "calibration_due": "2026-12-31"}
    ]  # fmt: skip
    assert (facts["rate"], facts["rows"], facts["complete"], facts["run_complete"]) == (100, 100, True, True)
    assert (facts["stream"], facts["dut"]["serial"]) == (None, "SN1")


def test_facts_stand_above_a_table(sealed, tmp_path):
    """As lines that begin with a hash sign, and then there is no second file."""
    folder, digest = sealed
    exported(folder, tmp_path, table=TableFormat(commented=True))
    assert [path.name for path in tmp_path.iterdir()] == ["001-rest.csv"]
    lines = (tmp_path / "001-rest.csv").read_text(encoding="utf-8").splitlines()
    above = [line for line in lines if line.startswith("#")]
    assert f"# evidence_digest: {digest}" in above
    assert lines[len(above)] == "time [s],x [deg/s]"


def test_a_decimal_comma_and_a_tab(sealed, tmp_path):
    """Every number has a comma for a point, and nothing else changes."""
    folder, _ = sealed
    exported(folder, tmp_path / "plain", table=TableFormat())
    exported(folder, tmp_path / "tab", table=TableFormat(separator="\t", decimal=","))
    plain, tab = ((tmp_path / name / "001-rest.csv").read_text(encoding="utf-8") for name in ("plain", "tab"))
    assert tab.replace("\t", ";").replace(",", ".").replace(";", ",") == plain
    with pytest.raises(Refused, match="separator ';'"):
        TableFormat(decimal=",")


def test_a_matlab_file_holds_every_number_and_fact(sealed, tmp_path):
    """A column per channel, units by variable, channels and facts as structures; compressed or not."""
    folder, digest = sealed
    recorded = Package(folder).recording("001-rest")
    for compressed in (False, True):
        exported(folder, tmp_path / str(compressed), mat=True, compressed=compressed)
        found = loadmat(tmp_path / str(compressed) / "001-rest.mat", squeeze_me=True, struct_as_record=False)
        assert np.array_equal(found["time"], recorded.time)
        assert np.array_equal(found["x"], recorded["x"], equal_nan=True)
        assert (found["units"].time, found["units"].x) == ("s", "deg/s")
        assert (found["channels"].variable, found["channels"].calibration) == ("x", "C-1")
        assert (found["facts"].evidence_digest, found["facts"].dut.serial) == (digest, "SN1")
        assert found["facts"].stream.size == 0


def test_an_equal_export_has_equal_bytes(sealed, tmp_path):
    """No time of day is in any file."""
    folder, _ = sealed
    for name in "ab":
        exported(folder, tmp_path / name, **BOTH)
    for path in (tmp_path / "a").iterdir():
        assert path.read_bytes() == (tmp_path / "b" / path.name).read_bytes(), path.name


@pytest.mark.parametrize(("source", "mark"), [("simulated", "SIMULATED"), ("replayed", "REPLAYED")])
def test_what_is_not_of_hardware_is_marked_everywhere(tmp_path, source, mark):
    """In the name of every file, in the facts, and where tools show what a MATLAB file is."""
    digest = sealed_run(tmp_path / "run", source=source)
    (one,) = exported(tmp_path / "run", tmp_path / "out", **BOTH)
    assert one.files == tuple(f"001-rest-{mark}.{ending}" for ending in ("csv", "json", "mat"))
    assert json.loads((tmp_path / "out" / one.files[1]).read_text(encoding="utf-8"))["mark"] == mark
    assert (
        (tmp_path / "out" / one.files[2])
        .read_bytes()
        .startswith(f"MATLAB 5.0 MAT-file, {mark}, evidence digest {digest} ".encode())
    )


def test_a_damaged_package_is_not_exported(tmp_path):
    """Not even a recording that is whole, for the digest would name the damage."""
    sealed_run(tmp_path / "run")
    path = tmp_path / "run" / RECORDINGS / "001-rest.h5"
    path.chmod(0o644)
    data = bytearray(path.read_bytes())
    data[-1] ^= 1
    path.write_bytes(data)
    with pytest.raises(EvidenceError, match=r"DAMAGED.*001-rest\.h5"):
        exported(tmp_path / "run", tmp_path / "out", **BOTH)
    assert not (tmp_path / "out").exists()


def test_a_run_without_a_seal_is_not_exported(tmp_path):
    """What to do first is said."""
    with begin(tmp_path / "run") as journal:
        record(tmp_path / "run", journal)
    with pytest.raises(Refused, match=r"INTERRUPTED.*hil seal"):
        exported(tmp_path / "run", tmp_path / "out", **BOTH)


def test_an_interrupted_recording_says_so(tmp_path):
    """A run that was sealed as it is gives the rows that are there, and says that they are not all."""
    folder = tmp_path / "run"
    with begin(folder) as journal:
        journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
        record(folder, journal, 7, complete=False)
    recover(folder, write_reports=write_report)
    (one,) = exported(folder, tmp_path / "out", **BOTH)
    assert (one.facts["complete"], one.facts["run_complete"], one.facts["rows"]) == (False, False, 7)
    found = loadmat(tmp_path / "out/001-rest.mat", squeeze_me=True, struct_as_record=False)
    assert (found["facts"].complete, found["time"].shape) == (0, (7,))


def test_a_recording_without_rows_is_exported(tmp_path):
    """A line of names, and empty columns."""
    folder = tmp_path / "run"
    with begin(folder) as journal:
        record(folder, journal, 0, complete=False)
    recover(folder, write_reports=write_report)
    exported(folder, tmp_path / "out", **BOTH)
    assert (tmp_path / "out/001-rest.csv").read_text(encoding="utf-8") == "time [s],x [deg/s]\n"
    assert loadmat(tmp_path / "out/001-rest.mat")["x"].size == 0


def test_how_a_stream_went_is_among_the_facts(tmp_path):
    """Losses and the drift of the device's clock come from the effect that took the recording."""
    folder = tmp_path / "run"
    journal = begin(folder)
    journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
    record(folder, journal)
    rows = bodies(Package(folder), "recording-end")[0]["sha256"]
    told = {
        "frames": 10, "lost": 1, "lost_samples": 3, "losses_known": False, "drift": 1e-5, "drift_uncertainty": None,
        "time_uncertainty": 0.25,
    }  # fmt: skip
    taken = {"name": "record.rest", "ordinal": 1, "effect": "records", "result": {"sha256": rows, **told}}
    journal.write(event_of("effect", case="test_rest", step="1", **taken), 2.0)
    check(journal, of="x")
    check(journal, of="y")
    recorded_check(journal)
    case_end(journal)
    journal.write(event_of("safe-end", ok=True), 5.0)
    seal(folder, journal, exit_code=0, write_reports=write_report)
    (one,) = exported(folder, tmp_path / "out", **BOTH)
    assert one.facts["stream"] == told


def begun(identifier, name, case):
    """Return what chooses a recording."""
    return event_of("recording", recording=identifier, name=name, case=case)


RECORDINGS_OF_A_RUN = (
    begun("envelope-current", "current", None),
    begun("001-a-rest", "rest", "p.py::test_a[x]"),
    begun("002-a-turn", "turn", "p.py::test_a[x]"),
    begun("003-b-rest", "rest", "p.py::test_b"),
)


@pytest.mark.parametrize(
    ("recordings", "cases", "ids"),
    [
        ((), (), ("envelope-current", "001-a-rest", "002-a-turn", "003-b-rest")),
        (("rest",), (), ("001-a-rest", "003-b-rest")),
        (("002-a-turn", "current"), (), ("envelope-current", "002-a-turn")),
        ((), ("test_a",), ("001-a-rest", "002-a-turn")),
        ((), ("p.py::test_b", "test_a[x]"), ("001-a-rest", "002-a-turn", "003-b-rest")),
        (("rest",), ("test_b",), ("003-b-rest",)),
    ],
)
def test_recordings_are_chosen_by_name_id_and_case(recordings, cases, ids):
    """Several words mean any of them; recordings and cases together mean both."""
    assert tuple(one.recording for one in choose(RECORDINGS_OF_A_RUN, recordings, cases)) == ids


@pytest.mark.parametrize(
    ("recordings", "cases", "message"),
    [
        (("rset",), (), "there is no recording 'rset', did you mean 'rest'"),
        (("rest", "trun"), (), "did you mean 'turn'"),
        ((), ("test_c",), "did you mean 'test_"),
        (("turn",), ("test_b",), "none of these recordings"),
    ],
)
def test_an_unknown_word_names_the_nearest(recordings, cases, message):
    """Nothing is exported where one of several words fits nothing."""
    with pytest.raises(Refused, match=message):
        choose(RECORDINGS_OF_A_RUN, recordings, cases)


def test_nothing_is_overwritten(sealed, tmp_path):
    """A file that is there stays, and no other one is written; another format beside it is."""
    folder, _ = sealed
    (tmp_path / "001-rest.mat").write_text("mine", encoding="ascii")
    with pytest.raises(Refused, match=r"001-rest\.mat exists already"):
        exported(folder, tmp_path, **BOTH)
    assert [path.name for path in tmp_path.iterdir()] == ["001-rest.mat"]
    exported(folder, tmp_path, table=TableFormat())
    assert (tmp_path / "001-rest.mat").read_text(encoding="ascii") == "mine"


def test_nothing_is_written_into_a_package(sealed):
    """However deep inside, and whoever may write there."""
    folder, _ = sealed
    for place in (folder, folder / "data/recordings/out"):
        with pytest.raises(Refused, match="inside the sealed package run"):
            exported(folder, place, **BOTH)


@pytest.mark.parametrize("writer", ["write_csv", "write_mat"])
def test_a_full_disk_leaves_no_half_file(sealed, tmp_path, monkeypatch, writer):
    """Nor the folder that was made for it; the person is told what to do."""
    folder, _ = sealed

    def full(_, path, *__, **___):
        Path(path).write_bytes(b"half")
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(exporting, writer, full)
    with pytest.raises(Refused, match="disk full"):
        exported(folder, tmp_path / "out", **BOTH)
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_told(sealed, tmp_path):
    """A file where a folder should be, as the folder itself and above it."""
    folder, _ = sealed
    (tmp_path / "file").write_text("", encoding="ascii")
    for place in (tmp_path / "file", tmp_path / "file/out"):
        with pytest.raises(Refused, match="another --output"):
            exported(folder, place, **BOTH)


def test_names_of_variables_are_valid_and_differ():
    """Letters, digits and underscores, 63 at most, no keyword, none of the file's own, and none twice."""
    channels = ["x", "x ", "x?", "1st", "_y", "end", "time", "facts", "field.x", "n" * 70, "n" * 71, "µ"]
    names = matlab_names(channels)
    assert names[:9] == ["x", "x_", "x__2", "x1st", "x_y", "end_2", "time_2", "facts_2", "field_x"]
    assert len({*names}) == len(channels)
    assert all(name.isidentifier() and name.isascii() and len(name) <= 63 for name in names)


def large(path, *, rows, names):
    """Write the HDF5 file of a recording, and return its facts."""
    with h5py.File(path, "w") as file:
        file.attrs["order"] = list(names)
        group = file.create_group("channels")
        for place, name in ((file, "time"), *((group, name) for name in names)):
            write_part(add_dataset(place, name, rows), 0, np.arange(rows) / 7)
    channels = [{"name": name, "unit": "deg/s"} for name in names]
    return {"rows": rows, "recording": "r", "mark": "", "evidence_digest": "0" * 64, "channels": channels}


def peak(function):
    """Return the most memory that a function had at one time, in bytes."""
    tracemalloc.start()
    try:
        function()
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


@pytest.mark.system
def test_memory_of_a_table_does_not_grow_with_its_rows(tmp_path):
    """It is written block by block."""
    peaks = []
    for rows in (33_000, 99_000):
        path = tmp_path / f"{rows}.h5"
        facts = large(path, rows=rows, names="x")
        peaks.append(peak(lambda path=path, facts=facts: write_csv(path, tmp_path / "t.csv", facts, TableFormat())))
    assert peaks[1] < 1.2 * peaks[0]


@pytest.mark.system
def test_memory_of_a_matlab_file_does_not_grow_with_its_channels(tmp_path):
    """It is written channel by channel, and read back so."""
    path, peaks = tmp_path / "r.h5", []
    for names in ("x", "x", "abcdefghijkl"):  # the first time what is imported counts, too
        facts = large(path, rows=50_000, names=names)
        peaks.append(peak(lambda facts=facts: write_mat(path, tmp_path / "r.mat", facts, compressed=False)))
    assert peaks[2] < 1.2 * peaks[1]


def test_a_channel_that_no_matlab_file_holds_is_refused(tmp_path):
    """Before anything is written, with the way out."""
    facts = {"rows": 2**28, "recording": "r", "channels": []}
    with pytest.raises(Refused, match="--csv"):
        write_mat(tmp_path / "r.h5", tmp_path / "r.mat", facts, compressed=False)
    assert list(tmp_path.iterdir()) == []


def test_the_package_is_left_as_it_was(sealed, tmp_path):
    """An export only reads."""
    folder, digest = sealed
    before = (folder / JOURNAL).read_bytes()
    exported(folder, tmp_path, **BOTH)
    assert (Package(folder).evidence_digest, (folder / JOURNAL).read_bytes()) == (digest, before)
