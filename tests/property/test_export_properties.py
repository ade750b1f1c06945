"""Exports and any numbers whatever: what is read back is what was recorded."""

from __future__ import annotations

import csv
import io

import h5py
import numpy as np
import sweeps
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.io import loadmat

from hil.evidence.recordings.datasets import add_dataset, write_part
from hil.report.export.csv_table import TableFormat, header, lines_of
from hil.report.export.mat_file import matlab_names, write_mat

NUMBERS = arrays(np.float64, st.tuples(st.integers(0, 30), st.integers(1, 4)), elements=st.floats(width=64))
FORMATS = st.sampled_from(
    [TableFormat(), TableFormat(separator=";", decimal=","), TableFormat(separator="\t", decimal=",")]
)
NAMES = st.lists(st.text(min_size=1, max_size=70), unique=True, max_size=6)


def same(left, right):
    """Return whether two arrays hold the same float64, signs of zeros included; one NaN is like another."""
    return np.array_equal(left, right, equal_nan=True) and np.array_equal(
        np.signbit(left[~np.isnan(left)]), np.signbit(right[~np.isnan(right)])
    )


@given(numbers=NUMBERS, form=FORMATS)
def test_every_number_of_a_table_reads_back(numbers, form):
    """Subnormal, huge and infinite ones too, in every way to write a table."""
    text = lines_of([*numbers.T], form)
    rows = list(csv.reader(io.StringIO(text), delimiter=form.separator))
    read = [[float(field.replace(form.decimal, ".") or "nan") for field in row or [""]] for row in rows]
    assert same(np.array(read).reshape(numbers.shape), numbers)


@given(names=NAMES, form=FORMATS)
def test_every_name_of_a_channel_is_one_field_of_one_line(names, form):
    """Separators, quotes and line ends in names move no column."""
    facts = {"channels": [{"name": name, "unit": "V"} for name in names]}
    (row,) = csv.reader(io.StringIO(header(facts, form), newline=""), delimiter=form.separator)
    assert len(row) == 1 + len(names)
    assert header(facts, form).count("\n") == 1


@given(names=NAMES)
def test_every_channel_has_a_variable_of_its_own(names):
    """Valid in MATLAB whatever the channel is called."""
    found = matlab_names(names)
    assert len({*found}) == len(names)
    assert all(name.isidentifier() and name.isascii() and len(name) <= 63 and name[0] != "_" for name in found)


@settings(max_examples=sweeps.examples(25), suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(numbers=NUMBERS, compressed=st.booleans())
def test_every_number_of_a_matlab_file_reads_back(tmp_path, numbers, compressed):
    """Shape, order and every float64."""
    names = [f"c{index}" for index in range(numbers.shape[1] - 1)]
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.attrs["order"] = names or [""]
        group = file.create_group("channels")
        places = [(file, "time"), *((group, name) for name in names)]
        for (place, name), column in zip(places, numbers.T, strict=True):
            write_part(add_dataset(place, name, len(numbers)), 0, column)
    facts = {"rows": len(numbers), "recording": "r", "mark": "", "evidence_digest": "0" * 64}
    facts |= {"channels": [{"name": name, "unit": "V"} for name in names]}
    write_mat(tmp_path / "r.h5", tmp_path / "r.mat", facts, compressed=compressed)
    found = loadmat(tmp_path / "r.mat")
    for name, column in zip(["time", *names], numbers.T, strict=True):
        assert found[name].shape == ((len(numbers), 1) if len(numbers) else (0, 1))
        assert same(found[name][:, 0], column)
