"""What long records cost, beside the libraries that people use for them; `--soak` takes whole sizes."""

from __future__ import annotations

import subprocess
import sys
import time
import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import allantools
import numpy as np
import pytest

from hil.analysis import quality
from hil.analysis.allan import strided
from hil.analysis.allan.deviation import deviation
from hil.analysis.gates import Facts
from hil.analysis.timeline import timeline
from hil.logs.columns import read

WHOLE = 14_400_000  # four hours at 1 kHz


@pytest.fixture
def record(request):
    """Samples at rest on an offset."""
    size = WHOLE if request.config.getoption("--soak") else WHOLE // 5
    return 3.0 + np.random.default_rng(1).standard_normal(size)


def theirs(values):
    """Octaves of the overlapping deviation, without intervals."""
    return allantools.oadev(values, rate=1000.0, data_type="freq", taus="octave")


def against_allantools(pair, name, record):
    """Measure a deviation with intervals and noise types in turns with one without."""
    pair(
        name,
        lambda: deviation(record, 1000.0),
        lambda: theirs(record),
        units=record.size,
        rounds=3,
        clock=time.process_time,
    )


def test_octaves_of_a_long_record(pair, record, monkeypatch):
    """With intervals and noise types against allantools without, a sample: NumPy alone."""
    monkeypatch.setattr(strided, "_fine", lambda: strided._plain)
    against_allantools(pair, "Allan deviation, NumPy / allantools", record)


def test_octaves_of_a_long_record_compiled(pair, record):
    """The same with `hil[fast]`."""
    assert strided.compiled() is not None
    against_allantools(pair, "Allan deviation, Numba / allantools", record)


def test_channels_on_two_cores(pair, record):
    """Nine channels, one after the other or in two threads: on two cores that have nothing else to do."""
    channels = [record] * 9

    def threads():
        with ThreadPoolExecutor(2) as pool:
            return list(pool.map(lambda each: deviation(each, 1000.0), channels))

    pair(
        "nine channels, two threads / one",
        threads,
        lambda: [deviation(each, 1000.0) for each in channels],
        units=9 * record.size,
        rounds=2,
    )


def test_memory_of_a_long_record(record):
    """At most 1.2 times the data, themselves included."""
    tracemalloc.start()
    deviation(record, 1000.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 0.2 * record.nbytes


@pytest.fixture
def log(request, tmp_path):
    """A log as loggers write it: time, three rates, temperature."""
    rows = 10_000_000 if request.config.getoption("--soak") else 400_000
    rates = np.random.default_rng(1).standard_normal((10_000, 3)).tolist()
    path = tmp_path / "log.csv"
    with path.open("w") as file:
        file.write("t,gx,gy,gz,temperature\n")
        for first in range(0, rows, len(rates)):
            file.writelines(
                f"{(first + row) * 1e-3:.3f},{x:.6f},{y:.6f},{z:.6f},{25 + x / 100:.2f}\n"
                for row, (x, y, z) in enumerate(rates)
            )
    return path, rows


@pytest.mark.timeout(600)
@pytest.mark.parametrize("columns", [["t", "gx", "gy", "gz", "temperature"], ["t", "gx"]], ids=["all", "two"])
def test_a_text_log(pair, log, columns):
    """A row of five columns, all or two of them read, against the C reader of pandas."""
    pandas = pytest.importorskip("pandas")
    path, rows = log
    pair(
        f"row of a text log, {len(columns)} columns, hil / pandas",
        lambda: read(path, columns),
        lambda: pandas.read_csv(path, usecols=columns),
        units=rows,
        rounds=5,
        clock=time.process_time,
    )


def test_memory_of_a_text_log(log):
    """What the columns take, and little more."""
    path, rows = log
    tracemalloc.start()
    values = read(path, ["t", "gx"]).values
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert values.shape == (rows, 2)
    assert held < 1.2 * values.nbytes


COMMAND = """
import contextlib, io, resource, sys
from hil.cli.commands.analyse import command
with contextlib.redirect_stdout(io.StringIO()):
    command([*sys.argv[1:], "--unit", "deg/s", "--json"], standalone_mode=False)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024)
"""


@pytest.mark.timeout(600)
def test_memory_of_a_whole_analysis(log):
    """Times and rates as the command holds them, and as much again while it understands the times."""
    path, rows = log

    def peak(*options):
        command = [sys.executable, "-c", COMMAND, "allan", str(path), "--columns", "gx", *options]
        return int(subprocess.run(command, check=True, capture_output=True, text=True).stdout)

    assert peak("--time", "t") - peak("--time", "t", "--to", "1") < 1.2 * 2 * 8 * rows + 20e6


@pytest.mark.parametrize("jitter", [0.0, 0.05])
def test_times_of_a_long_record(cost, record, jitter):
    """Understood, judged and placed, a sample."""
    times = (np.arange(record.size) + jitter * record) / 1000.0
    cost(f"time of a sample, jitter {jitter:.0%}", lambda: timeline(times), units=record.size, rounds=3)


def test_gates_of_a_long_record(cost, record):
    """All gates on one channel, a sample."""
    cost(
        "gates on a sample",
        lambda: quality.read({"x": record}, Facts(lsb=1e-6), 1000.0),
        units=record.size,
        rounds=3,
    )
