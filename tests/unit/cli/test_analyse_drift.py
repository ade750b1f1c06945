"""The command `hil analyse drift`."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import HilError, Refused

LAMP = str(Path(__file__).parents[3] / "docs" / "data" / "gyroscope-heat-lamp-simulated.csv")
UNDER_LAMP = (LAMP, "--time", "t", "--temperature", "temperature", "--columns", "x,y,z", "--unit", "deg/s")
TRUE = {"x": (0.074197, 0.42), "y": (0.046638, -1.31), "z": (-0.0084739, 0.77)}
COLUMNS = ("--time", "t", "--temperature", "T", "--columns", "x", "--unit", "deg/s")
COUNT = 1200


def run(*arguments):
    """Run the command; what it raises is raised here."""
    return CliRunner().invoke(command, ["drift", *arguments], catch_exceptions=False, standalone_mode=False)


def made(folder, *, head="t,T,x", rows=slice(None), **changes):
    """Write a log of one axis that drifts by 0.01 deg/s/K, heats by 30 K and cools again; return its path."""
    time = np.arange(COUNT) * 0.5
    warm = 25.0 + 30.0 * np.sin(np.pi * time / 600.0)
    values = 0.1 + 0.01 * (warm - 25.0) + 0.01 * np.random.default_rng(2).standard_normal(COUNT)
    columns = {"time": time, "warm": warm, "values": values} | {
        name: change({"time": time, "warm": warm, "values": values}) for name, change in changes.items()
    }
    lines = [",".join(f"{cell:.6g}" for cell in row) for row in zip(*columns.values(), strict=True)]
    path = folder / "log.csv"
    path.write_text("\n".join([head, *np.array(lines)[rows]]) + "\n", encoding="utf-8")
    return str(path)


def axes_of(result, fragment=0):
    """Return the axes of a fragment of a JSON document."""
    return {axis["name"]: axis for axis in json.loads(result.stdout)["fragments"][fragment]["axes"]}


def test_drift_and_offset_of_a_sensor_under_a_lamp():
    """Each is within four uncertainties of the truth of the log; the loop has the sign of elements that lag."""
    result = run(*UNDER_LAMP, "--json")
    axes = axes_of(result)
    for name, (drift, offset) in TRUE.items():
        for figure, true in (("slope", drift), ("offset", offset)):
            found = axes[name][figure]
            assert abs(found["value"] - true) < 4.0 * found["uncertainty"]
        assert axes[name]["hysteresis"]["value"] * drift < 0.0
        assert axes[name]["probability"] < 1e-3
    assert {point["heating"] for point in axes["x"]["points"]} == {-1, 0, 1}
    assert result.return_value == 0


def test_the_table_is_for_people():
    """Where the fragment lies, its branches, and every figure with its unit."""
    lines = run(*UNDER_LAMP[:5], "--columns", "z", "--unit", "deg/s").stdout.splitlines()
    assert "fragment 1 of 1: 0 to 600 s, 1201 samples, 24.5 to 58.8 degC" in lines
    assert "heating in 29 of 60 bins, cooling in 30" in lines
    (z,) = (line for line in lines if line.startswith("z "))
    assert [part.strip() for part in z.split("  ") if part] == [
        "z", "-0.00846 ± 0.00024 deg/s/K", "0.7705 ± 0.0041 deg/s", "0.0153 ± 0.0016 deg/s", "1.10 ± 0.74 deg/s/h",
    ]  # fmt: skip


def test_times_of_a_part_say_where_they_begin():
    """They count from where the part begins, as `--from` does; jitter is told in the unit that suits it."""
    printed = run(*UNDER_LAMP, "--from", "100").stdout
    assert "sampling: 2.0000000 ± " in printed
    assert "us rms, " in printed
    assert " ms peak\n" in printed
    assert "note: times count from 100 s of the log (--from)\n" in printed
    assert "fragment 1 of 1: 0 to 500 s" in printed
    assert "times count" not in run(*UNDER_LAMP).stdout


def test_a_log_with_gaps_falls_into_fragments(tmp_path):
    """Each tells what it shows, or why not; a longer gap that is allowed leaves one."""
    log = made(tmp_path, rows=np.r_[0:300, 420:800, 820:COUNT])
    result = run(log, *COLUMNS, "--json")
    document = json.loads(result.stdout)
    assert [fragment["samples"] for fragment in document["fragments"]] == [300, 380, 380]
    reasons = [axes_of(result, place)["x"]["reasons"] for place in range(3)]
    little = "the temperature changed by 3.9 K only, 5 K are needed"
    said = ["the temperature only rose", little, "the temperature only fell"]
    assert [each.get("hysteresis") for each in reasons] == said
    assert ["slope" in each for each in reasons] == [False, True, False]
    assert "slope" not in axes_of(run(log, *COLUMNS, "--json", "--least-range", "3"), 1)["x"]["reasons"]
    assert len(json.loads(run(log, *COLUMNS, "--json", "--longest-gap", "100").stdout)["fragments"]) == 1


def test_counts_are_scaled_and_the_temperature_is_not(tmp_path):
    """The slope is in the scaled unit per kelvin; the offset is that at the temperature that was asked for."""
    log = made(tmp_path, values=lambda log: np.round(log["values"] / 0.005))
    found = run(log, *COLUMNS[:-1], "LSB", "--scale", "0.005", "--scaled-unit", "deg/s", "--reference", "40", "--json")
    axis = axes_of(found)["x"]
    assert axis["slope"]["unit"] == "deg/s/K"
    assert axis["slope"]["value"] == pytest.approx(0.01, abs=4.0 * axis["slope"]["uncertainty"])
    assert axis["offset"]["value"] == pytest.approx(0.25, abs=4.0 * axis["offset"]["uncertainty"])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"warm": lambda log: log["warm"] + 273.15}, "as of kelvin; not degrees Celsius"),
        ({"warm": lambda log: np.round(100.0 * log["warm"])}, "raw counts; not degrees Celsius"),
        ({"head": "t,T [K],x"}, "the name of column 'T [K]' says K"),
        ({"values": lambda log: 0.0 * log["values"] + 0.25}, "stuck of x: all samples are 0.25"),
        ({"time": lambda log: log["time"] % 300.0}, "order"),
    ],
    ids=["kelvin", "counts", "named kelvin", "stuck", "times that run back"],
)
def test_what_speaks_against_the_log_is_inconclusive(tmp_path, changes, said):
    """The exit code is 1, no figure is printed, and nothing is exported."""
    log, export = made(tmp_path, **changes), tmp_path / "drift.csv"
    result = run(log, "--time", "1", "--temperature", "2", "--columns", "3", "--unit", "deg/s", "--export", str(export))
    text = " ".join(result.stdout.split())
    assert result.return_value == 1
    assert said in text.partition("fragment")[0]
    assert "x inconclusive inconclusive inconclusive inconclusive" in text
    assert not export.exists()


def test_what_is_exported_and_plotted(tmp_path):
    """A row for every axis of every fragment, with why figures are missing; a panel for every axis."""
    export, plot = tmp_path / "drift.csv", tmp_path / "drift.svg"
    run(made(tmp_path, rows=np.r_[0:300, 420:800]), *COLUMNS, "--export", str(export), "--plot", str(plot))
    rows = [*csv.DictReader(export.read_text(encoding="utf-8").splitlines())]
    assert [(row["fragment"], row["axis"]) for row in rows] == [("1", "x"), ("2", "x")]
    assert float(rows[0]["slope"]) == pytest.approx(0.01, rel=0.05)
    assert (rows[0]["slope unit"], rows[0]["reasons"]) == ("deg/s/K", "no hysteresis: the temperature only rose")
    assert rows[1]["slope"] == ""
    assert "temperature [degC]" in plot.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("--time", "t", "--temperature", "T", "--unit", "deg/s"), "--columns names no axis"),
        (("--time", "t", "--temperature", "U", "--columns", "x", "--unit", "deg/s"), "no column 'U'"),
        (
            ("--time", "t", "--temperature", "x", "--columns", "x", "--unit", "deg/s"),
            "--temperature is one of --columns",
        ),
        ((*COLUMNS, "--plot", "drift.pdf"), "a plot is written as .svg or .png"),
    ],
)
def test_what_cannot_be_meant_is_refused(tmp_path, arguments, said):
    """Each error says what to do."""
    with pytest.raises(Refused, match=said) as refused:
        run(made(tmp_path), *arguments)
    assert refused.value.hint


def test_a_row_without_a_number_is_left_out(tmp_path):
    """A thermometer that is read less often than the axes leaves the rows that it has; one that has none is refused."""
    log = made(tmp_path, warm=lambda log: np.where(np.arange(COUNT) % 10, np.nan, log["warm"]))
    axis = axes_of(run(log, *COLUMNS, "--json"))["x"]
    assert axis["slope"]["value"] == pytest.approx(0.01, abs=4.0 * axis["slope"]["uncertainty"])
    never = made(tmp_path, warm=lambda log: np.nan * log["warm"])
    with pytest.raises(HilError, match="column T holds no number"):
        run(never, *COLUMNS)
