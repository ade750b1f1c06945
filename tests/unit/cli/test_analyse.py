"""The command `hil analyse allan`."""

from __future__ import annotations

import json
import math
import re
import subprocess
import sys
from functools import cache

import numpy as np
import pytest
from click.testing import CliRunner

from hil.analysis.allan.noise import characterise
from hil.cli.analyses.allan_text import Axis, Result, as_text, stated
from hil.cli.analyses.log import Log
from hil.cli.commands.analyse import command
from hil.model.errors import Refused
from hil.model.figure import Figure, FigureStatus

pytestmark = pytest.mark.usefixtures("in_the_checkout")

SLICE = "docs/data/gyroscope-xsens-rest.txt"
REST = ("--time", "1", "--columns", "2,3,4", "--unit", "LSB", "--to", "50")
ONE = ("--time", "1", "--columns", "2", "--unit", "LSB", "--to", "50")


def run(*arguments):
    """Run the command; what it raises is raised here. Of the example log, the same is computed once."""
    return _of_the_example(*arguments) if arguments[0] == SLICE else _invoked(*arguments)


def _invoked(*arguments):
    return CliRunner().invoke(command, ["allan", *arguments], catch_exceptions=False)


_of_the_example = cache(_invoked)


def test_a_real_gyroscope_at_rest_is_characterised():
    """The example log: sampling first, then a table and the coefficients of each axis."""
    lines = run(SLICE, *REST).stdout.splitlines()
    assert "5001 samples in 49.9948 s" in lines[0]
    assert lines[1].startswith("sampling: 100.0105 ± 0.0013 Hz, jitter 9.26 us rms")
    assert lines[2] == "times: no gaps, 0 repeated and 0 reversed timestamps"
    assert [line.split(":")[0] for line in lines if "overlapping Allan deviation" in line] == [
        "column 2",
        "column 3",
        "column 4",
    ]
    assert lines[5].split() == ["tau", "[s]", "deviation", "low", "high", "edf", "noise"]
    assert sum(line.startswith("white noise") and line.endswith(" measured") for line in lines) == 3
    assert sum(line.startswith("flicker") and line.endswith("upper limit") for line in lines) == 3


def test_json_is_one_document_with_everything():
    """Standard output parses as a whole; figures have value, unit, uncertainty, dof and status."""
    document = json.loads(run(SLICE, *REST, "--json").stdout)
    assert document["format"] == 1
    assert document["sampling"]["gaps"] == 0
    axis = document["axes"][0]
    white = axis["white"]  # 2.88 is that of the spectrum from 1 to 20 Hz, below the filter
    assert white["value"] == pytest.approx(2.88, abs=white["uncertainty"])
    assert white["uncertainty"] < 0.12
    assert axis["white"]["unit"] == "LSB/sqrt(Hz)"
    assert axis["white"]["status"] == "measured"
    assert axis["random_walk"]["status"] == "upper limit"
    assert set(axis["curve"][0]) == {"tau", "deviation", "low", "high", "edf", "alpha", "m", "terms"}


def test_motion_in_the_record_is_told():
    """Without --to the turn at 52 s is in the record, and the model is rejected."""
    axis = json.loads(run(SLICE, "--time", "1", "--columns", "3", "--unit", "LSB", "--json").stdout)["axes"][0]
    assert axis["white"]["status"] == "model rejected"
    assert "motion" in axis["remark"]


@pytest.mark.parametrize("flag", ["--unit", "--scaled-unit"])
def test_a_unit_that_nobody_knows_is_refused(flag):
    """Before the file is read; the message says how units are written."""
    with pytest.raises(Refused, match=f"{flag}: 'furlong' is not a known unit"):
        run(SLICE, *REST, "--scale", "0.01", "--scaled-unit", "deg/s", flag, "furlong")


def test_counts_are_scaled_into_another_unit():
    """--scale multiplies the numbers, --scaled-unit names the result."""
    counts = json.loads(run(SLICE, *REST, "--json").stdout)["axes"][0]["white"]
    scaled = run(SLICE, *REST, "--scale", "0.01", "--scaled-unit", "deg/s", "--json").stdout
    white = json.loads(scaled)["axes"][0]["white"]
    assert white["value"] == pytest.approx(counts["value"] * 0.01)
    assert white["unit"] == "deg/s/sqrt(Hz)"


def test_a_log_without_timestamps_takes_its_rate_from_the_command_line(tmp_path):
    """--rate stands in for the time column; all columns are analysed."""
    data = np.random.default_rng(0).standard_normal((2000, 2))
    log = tmp_path / "log.csv"
    np.savetxt(log, data, delimiter=",", header="gx,gy", comments="")
    document = json.loads(run(str(log), "--rate", "50", "--unit", "deg/s", "--from", "10", "--json").stdout)
    assert [axis["name"] for axis in document["axes"]] == ["gx", "gy"]
    assert document["axes"][0]["samples"] == 1500
    assert document["sampling"] is None
    assert "as given" in run(str(log), "--rate", "50", "--unit", "deg/s", "--columns", "gx").stdout


def test_timestamps_may_count_milliseconds_and_have_gaps(tmp_path):
    """--time-unit scales them; a gap is told and warned of."""
    times = np.delete(np.arange(1000) * 10.0, np.s_[100:120])
    log = tmp_path / "log.txt"
    np.savetxt(log, np.column_stack([times, np.random.default_rng(0).standard_normal(980)]))
    text = run(str(log), "--time", "1", "--time-unit", "ms", "--unit", "deg/s").stdout
    assert "sampling: 100.000 ± " in text
    assert "1 gap (longest 0.21 s, about 20 samples missing)" in text
    assert "note: 20 samples are missing; averages that miss more than 5 %" in text


def test_a_time_of_the_clock_is_in_seconds_whatever_the_column_says(tmp_path):
    """h:min:s.ms is how the time is written, and its last word no unit."""
    rows = [f"0:00:{n / 2:05.2f},{x:.6f}" for n, x in enumerate(np.random.default_rng(0).standard_normal(100))]
    log = tmp_path / "log.csv"
    log.write_text("\n".join(["Time(h:min:s.ms),rate", *rows]), encoding="utf-8")
    document = json.loads(run(str(log), "--time", "1", "--unit", "deg/s", "--json").stdout)
    assert document["sampling"]["rate"] == pytest.approx(2.0)


def test_no_number_stands_beside_a_rejected_model():
    """What the fit gave is in the JSON for orientation; a person is given no number, and no averaging time either."""
    lines = run(SLICE, "--time", "1", "--columns", "3", "--unit", "LSB").stdout.splitlines()
    rejected = [line.split() for line in lines if line.endswith("model rejected")]
    assert [words[-3] for words in rejected] == ["-"] * 6


def test_a_time_column_among_the_rates_is_warned_of(tmp_path):
    """With --rate, a column that rises with every sample is a time or a counter; noise is not warned of."""
    log = tmp_path / "log.txt"
    noise = np.random.default_rng(0).standard_normal(200)
    np.savetxt(log, np.column_stack([np.arange(200) * 0.01, noise]))
    text = run(str(log), "--rate", "100", "--unit", "deg/s").stdout
    assert "note: column 1 rises with every sample, as a time does" in text
    assert "column 2 rises" not in text
    assert "column 2: overlapping Allan deviation" in text


@pytest.mark.parametrize(("step", "rate"), [(1e7, "1e-07"), (1e-7, "1e+07"), (10.0, "0.1")])
def test_an_unlikely_rate_asks_for_the_unit_of_time(tmp_path, step, rate):
    """Timestamps in ns or ms that are taken as seconds trip a gate, and so do fast ones; not if the unit is typed."""
    log = tmp_path / "log.txt"
    np.savetxt(log, np.column_stack([np.arange(200) * step, np.random.default_rng(0).standard_normal(200)]))
    text = run(str(log), "--time", "1", "--unit", "deg/s").stdout
    assert f"INCONCLUSIVE: time_unit: {step:.4g} s between samples, {rate} Hz" in " ".join(text.split())
    assert "time_unit" not in run(str(log), "--time", "1", "--time-unit", "s", "--unit", "deg/s").stdout


def test_a_gate_that_trips_makes_the_coefficients_inconclusive(tmp_path):
    """The reason with the sample, no number beside the status, exit code 1, lines within 80 columns."""
    values = np.random.default_rng(0).standard_normal(2000)
    values[700] = 500.0
    log = tmp_path / "log.txt"
    np.savetxt(log, values)
    asked = ["allan", str(log), "--rate", "100", "--unit", "deg/s"]
    result = CliRunner().invoke(command, asked, standalone_mode=False)
    assert result.return_value == 1
    assert re.search(r"^INCONCLUSIVE: spikes of 1: .* number\s+701$", result.stdout, re.MULTILINE | re.DOTALL)
    assert re.search(r"^white noise +- +inconclusive$", result.stdout, re.MULTILINE)
    assert max(len(line) for line in result.stdout.splitlines()[1:]) <= 80
    document = json.loads(CliRunner().invoke(command, [*asked, "--json"], standalone_mode=False).stdout)
    assert (
        document["status"] == document["axes"][0]["status"] == document["axes"][0]["white"]["status"] == "inconclusive"
    )
    assert "spikes of 1" in document["axes"][0]["reasons"][0]
    assert [gate["samples"] for gate in document["gates"] if gate["name"] == "spikes"] == [[701]]


def test_facts_of_the_sensor_are_in_the_unit_of_the_file(tmp_path):
    """A full scale in counts trips scaled samples as well."""
    log = tmp_path / "log.txt"
    np.savetxt(log, np.clip(np.rint(30.0 * np.random.default_rng(0).standard_normal(2000)), -80, 80))
    asked = (str(log), "--rate", "100", "--unit", "LSB", "--scale", "-0.01", "--scaled-unit", "deg/s")
    assert "samples are at full scale, 0.8" in " ".join(run(*asked, "--full-scale", "80").stdout.split())
    assert "at full scale" not in run(*asked, "--full-scale", "81").stdout


def test_jitter_below_a_nanosecond_is_none(tmp_path):
    """Rounding errors of even timestamps are not printed as jitter."""
    log = tmp_path / "log.txt"
    np.savetxt(log, np.column_stack([np.arange(200) * 0.01, np.random.default_rng(0).standard_normal(200)]))
    assert "jitter 0 us rms, 0 us peak" in run(str(log), "--time", "1", "--unit", "deg/s").stdout


def test_a_stuck_column_is_not_observable(tmp_path):
    """Nothing is claimed of a channel that always says the same; JSON holds null, not NaN."""
    log = tmp_path / "log.txt"
    log.write_text("17.937\n" * 500)
    axis = json.loads(run(str(log), "--rate", "10", "--unit", "uT", "--json").stdout)["axes"][0]
    assert axis["white"] == {
        "value": None, "unit": "uT/sqrt(Hz)", "uncertainty": None, "dof": None, "status": "not observable",
    }  # fmt: skip
    assert "stuck" in run(str(log), "--rate", "10", "--unit", "uT").stdout


@pytest.mark.parametrize("ending", ["svg", pytest.param("png", marks=pytest.mark.system)])
def test_the_plot_has_the_same_bytes_each_time(tmp_path, ending):
    """Neither date nor random names are in the drawing."""
    for name in ("one", "two"):
        run(SLICE, *ONE, "--plot", str(tmp_path / f"{name}.{ending}"))
    first, second = ((tmp_path / f"{name}.{ending}").read_bytes() for name in ("one", "two"))
    assert first == second
    assert len(first) > 10_000
    assert ending != "svg" or b"stroke-dasharray: 1," in first, "dotted where a filter bends the curve"


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        (("--unit", "LSB"), "give --time COLUMN or --rate HZ"),
        (("--unit", "LSB", "--time", "1", "--rate", "100"), "and not both"),
        (("--unit", "LSB", "--rate", "0"), "--rate 0 is not possible"),
        (("--unit", "LSB", "--time", "5"), "no column '5'; there are 4 columns"),
        (("--unit", "LSB", "--time", "1", "--columns", "2,9"), "no column '9'"),
        (("--unit", "LSB", "--time", "1", "--from", "90"), "no sample lies within --from 90; the log lasts 55.9642 s"),
        (("--unit", "LSB", "--time", "1", "--from", "9", "--to", "8"), "no sample lies within --from 9 --to 8"),
        (("--unit", "LSB", "--time", "1", "--scale", "2"), "--scale and --scaled-unit belong together"),
        (("--unit", "LSB", "--time", "1", "--confidence", "68"), "between 0 and 1"),
        (("--unit", "LSB", "--time", "1", "--plot", "plot.gif"), r"a plot is written as \.svg or \.png"),
        (("--unit", "LSB", "--time", "1", "--plot", "/nowhere/plot.svg"), "No such file or directory"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_sentence(arguments, why):
    """Bad options, columns and ranges are refusals that say what to do, not tracebacks."""
    with pytest.raises(Refused, match=why):
        run(SLICE, *arguments)


def test_a_missing_file_is_refused():
    """The path and the system's own words."""
    with pytest.raises(Refused, match="nowhere.txt: No such file or directory"):
        run("nowhere.txt", "--rate", "1", "--unit", "deg/s")


def test_the_unit_must_be_given():
    """Numbers without a unit are not characterised."""
    result = CliRunner().invoke(command, ["allan", SLICE, "--time", "1"])
    assert result.exit_code != 0
    assert "--unit" in result.stderr


def test_help_loads_nothing_heavy():
    """`--help` starts without numpy, scipy, matplotlib or rich."""
    code = (
        "import sys; from hil.cli.commands.analyse import command; "
        "command(['allan', '--help'], standalone_mode=False); "
        "sys.exit(bool({'numpy', 'scipy', 'matplotlib', 'rich'} & set(sys.modules)))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, check=False)
    assert result.returncode == 0
    assert b"Allan deviation and noise coefficients" in result.stdout


def test_columns_line_up_and_no_line_is_broken():
    """Numbers end under each other; a line is as long as what it says, wherever it is written to."""
    model = characterise(np.random.default_rng(0).standard_normal(500), 10.0, "deg/s")
    axis = Axis(name="x" * 200, model=model, curve=model.curve)
    log = Log(
        file="log.txt",
        unit="deg/s",
        rate=10.0,
        sampling=None,
        channels={axis.name: np.zeros(500)},
        gates=(),
        remarks=(),
    )
    lines = as_text(Result(log=log, axes=(axis,))).splitlines()
    head = next(place for place, line in enumerate(lines) if line.split()[:2] == ["tau", "[s]"])
    assert lines[head - 1].startswith(axis.name)
    rows = [line.split()[:2] for line in lines[head + 1 : head + 1 + model.curve.tau.size]]
    ends = {line.index(cell) + len(cell) for (_, cell), line in zip(rows, lines[head + 1 :], strict=False)}
    assert ends == {lines[head].index("deviation") + len("deviation")}


@pytest.mark.parametrize(
    ("figure", "text"),
    [
        (Figure(value=2.7612, unit="LSB", uncertainty=0.0897), "2.761 ± 0.090 LSB"),
        (Figure(value=3.0366e-9, unit="deg/s", uncertainty=9.87e-11), "(3.037 ± 0.099)e-9 deg/s"),
        (Figure(value=123456.0, unit="LSB", uncertainty=1234.0), "(1.235 ± 0.012)e+5 LSB"),
        (Figure(value=2.0725, unit="LSB", uncertainty=0.3, status=FigureStatus.UPPER_LIMIT), "< 2.07 LSB"),
        (Figure(value=2.0725, unit="LSB", status=FigureStatus.MODEL_REJECTED), "-"),
        (Figure(value=10.239, unit="s", uncertainty=3.1, status=FigureStatus.NOT_OBSERVABLE), "> 10.2 s"),
        (Figure(value=math.nan, unit="LSB", status=FigureStatus.NOT_OBSERVABLE), "-"),
    ],
)
def test_figures_are_stated_with_two_digits_of_uncertainty(figure, text):
    """Value and uncertainty end at the same place; a bound is a bound, and nothing is a dash."""
    assert stated(figure) == text


@pytest.mark.parametrize(
    ("estimator", "title"),
    [("modified", "modified Allan"), ("hadamard", "overlapping Hadamard"), ("total", "total")],
)
def test_other_estimators_stand_beside_the_same_coefficients(estimator, title):
    """Table and JSON hold the deviation that was asked for; the coefficients stay those of the overlapping one."""
    asked = (*REST[:3], "2", *REST[4:], "--estimator", estimator, "--taus", "0.1,1,10")
    assert f"2: {title} deviation in LSB" in run(SLICE, *asked).stdout
    axis = json.loads(run(SLICE, *asked, "--json").stdout)["axes"][0]
    assert [round(row["tau"], 1) for row in axis["curve"]] == [0.1, 1.0, 10.0]
    assert axis["estimator"] == estimator
    white = axis["white"]  # 2.88 is that of the spectrum from 1 to 20 Hz, below the filter
    assert white["value"] == pytest.approx(2.88, abs=white["uncertainty"])
    assert white["uncertainty"] < 0.12


def test_the_nearest_slopes_are_named_legacy():
    """--method nearest-slope adds its numbers under a heading of their own; the coefficients stay those of the fit."""
    asked = (*REST[:3], "2", *REST[4:], "--method", "nearest-slope", "--tau-max", "4")
    assert "legacy method nearest-slope" in run(SLICE, *asked).stdout
    axis = json.loads(run(SLICE, *asked, "--json").stdout)["axes"][0]
    assert axis["legacy_nearest_slope"]["white"]["unit"] == axis["white"]["unit"]
    assert axis["legacy_nearest_slope"]["white"]["value"] != axis["white"]["value"]


@pytest.mark.system
def test_dense_averaging_times_are_drawn(tmp_path):
    """--taus dense gives twenty points a decade."""
    asked = ("--estimator", "hadamard", "--taus", "dense", "--json", "--plot", str(tmp_path / "plot.png"))
    document = json.loads(run(SLICE, *REST, *asked).stdout)
    assert len(document["axes"][0]["curve"]) > 45
    assert (tmp_path / "plot.png").stat().st_size > 10_000


def test_averaging_times_that_are_none_are_refused():
    """Neither a name nor seconds."""
    with pytest.raises(Refused, match="--taus all names no averaging times"):
        run(SLICE, *REST, "--taus", "all")


def test_cells_that_are_nan_are_missing_samples_and_told(tmp_path):
    """NaN in a column without timestamps: a note, and the count in JSON."""
    values = np.random.default_rng(0).standard_normal(2000)
    values[[100, 900]] = math.nan
    log = tmp_path / "log.txt"
    np.savetxt(log, values)
    text = run(str(log), "--rate", "10", "--unit", "deg/s").stdout
    assert "note: column 1: 2 samples are NaN and count as missing" in text
    axis = json.loads(run(str(log), "--rate", "10", "--unit", "deg/s", "--json").stdout)["axes"][0]
    assert (axis["samples"], axis["missing"]) == (2000, 2)


@pytest.mark.parametrize("limits", [("5", "1"), ("nan", "1"), ("-1", "1"), ("1", "nan")])
def test_averaging_times_that_cannot_be_are_refused(limits):
    """The log could be as long as anybody likes."""
    with pytest.raises(Refused, match=r"--tau-min \S+ and --tau-max \S+ leave no averaging time"):
        run(SLICE, *REST, "--tau-min", limits[0], "--tau-max", limits[1])


def test_a_fit_with_too_few_averaging_times_names_both_ways_out():
    """A longer record, or wider limits."""
    text = run(SLICE, *REST, "--tau-min", "5").stdout
    assert "2 averaging times can be fitted and 6 are needed: record longer, or allow" in " ".join(text.split())


def test_milliseconds_in_a_line_of_units_are_understood(tmp_path):
    """A sample each millisecond would pass for one each second."""
    values = np.random.default_rng(0).standard_normal(2000)
    log = tmp_path / "log.csv"
    log.write_text("t,gx\nms,deg/s\n" + "".join(f"{n},{v:.6f}\n" for n, v in enumerate(values)), encoding="utf-8")
    text = run(str(log), "--time", "t", "--unit", "deg/s").stdout
    assert "sampling: 1000" in text
    assert "times are in ms, as the column's name 't [ms]' says" in text


@pytest.mark.parametrize(("name", "other"), [("gx [rad/s]", "rad/s"), ("gx (mdeg/s)", "mdeg/s")])
def test_a_unit_in_the_name_of_a_column_that_contradicts_is_told(tmp_path, name, other):
    """The numbers are taken as was typed; a name that says nothing else, or no unit, is no contradiction."""
    values = np.random.default_rng(0).standard_normal((500, 3))
    log = tmp_path / "log.csv"
    np.savetxt(log, values, delimiter=",", header=f"{name},gy [deg/s],gz (raw)", comments="")
    text = " ".join(run(str(log), "--rate", "50", "--unit", "deg/s").stdout.split())
    assert f"--unit says deg/s, but the name of column '{name}' says {other}: check which is right" in text
    assert text.count("check which is right") == 1
