"""A run's recordings, exported and compared with what the run recorded."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.io import loadmat
from told_as_json import bodies
from workspaces import make

from hil.report.export.csv_table import TableFormat
from hil.report.export.package import ExportRequest, export_package

CASE = """
@pytest.mark.requirement("T-030")
def test_field(field, record, step):
    with step("Record the field"):
        record("field", field, duration=1.0, rate=40.0)
"""


@pytest.fixture(scope="module")
def package(tmp_path_factory):
    """The sealed package of a run that recorded a field, beside what the envelope records."""
    return make(tmp_path_factory.mktemp("exported") / "workspace", CASE).run().package


def test_every_recording_of_a_run_reads_back(package, tmp_path):
    """As a table and as a MATLAB file, sample by sample; files and facts say that the run was simulated."""
    exported = list(export_package(package.folder, ExportRequest(output=tmp_path, table=TableFormat(), mat=True)))
    assert {one.facts["name"] for one in exported} >= {"field"}
    assert len(exported) == len(bodies(package, "recording"))
    for one in exported:
        recorded = package.recording(one.facts["recording"])
        table, _, matrix = (tmp_path / name for name in one.files)
        assert all("SIMULATED" in name for name in one.files)
        assert one.facts["evidence_digest"] == package.evidence_digest
        columns = np.genfromtxt(table, delimiter=",", skip_header=1, ndmin=2).T
        variables = loadmat(matrix, squeeze_me=False)
        for values, name in zip(columns, ("time", *recorded.channels), strict=True):
            expected = recorded.time if name == "time" else recorded[name]
            assert np.array_equal(values, expected, equal_nan=True)
            assert np.array_equal(variables[name][:, 0], expected, equal_nan=True)
