"""The command `hil analyse magnetometer`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hil.analysis.magnetometer.interchange import magnetometer_from_json
from hil.cli.commands.analyse import command
from hil.model.errors import Refused

ROOT = Path(__file__).parents[3]
TABLE = str(ROOT / "docs" / "data" / "magnetometer-simulated.csv")
REST = ("--columns", "x,y,z", "--unit", "uT")
KNOWN = (*REST, "--field-column", "field")


def run(*arguments):
    """Run the command; what it raises is raised here."""
    asked = ["magnetometer", *map(str, arguments)]
    return CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)


def test_readings_become_a_calibration():
    """Bias, matrix, field, the two wrong readings by number, and what nobody can see."""
    result = run(TABLE, *KNOWN)
    assert result.return_value == 0
    text = result.stdout
    assert text.startswith(
        f"{TABLE}: 300 readings in uT\n\nfield = matrix · (measured - bias), by likelihood, shape general"
    )
    assert "outliers   2 left out: readings 41, 172" in text
    assert "coverage   100% of the sphere" in text
    assert "a rotation or a reflection" in " ".join(text.split())
    assert "self-check: the exported numbers reproduce every reading" in text


@pytest.mark.parametrize("method", ["likelihood", "twostep"])
def test_json_holds_the_truth_of_the_simulation(method):
    """Within four standard uncertainties; figures as evidence encodes them."""
    document = json.loads(run(TABLE, *KNOWN, "--method", method, "--json").stdout)
    for axis, true in zip("xyz", (14.2, -31.5, 6.8), strict=True):
        figure = document["bias"][axis]
        assert abs(figure["value"] - true) < 4.0 * figure["uncertainty"] < 0.5
    assert (document["status"], document["outliers"], document["method"]) == ("conclusive", [41, 172], method)
    assert document["calibration"]["absolute"] is True


def test_a_varying_field_taken_as_constant_is_inconclusive_and_not_exported(tmp_path):
    """Without the magnitudes the residuals are no noise; exit code 1, and no file."""
    result = run(TABLE, *REST, "--export", tmp_path / "c.json", "--c-header", tmp_path / "c.h")
    assert result.return_value == 1
    assert "INCONCLUSIVE: scatter: calibrated magnitudes differ" in result.stdout
    assert not list(tmp_path.iterdir())


def test_a_part_of_the_sphere_is_inconclusive(tmp_path):
    """Readings in one direction only: no figure is told, and the exit code is 1."""
    lines = Path(TABLE).read_text(encoding="utf-8").splitlines()
    some = [line for line in lines[1:] if float(line.split(",")[2]) > 30.0]
    part = tmp_path / "part.csv"
    part.write_text("\n".join([lines[0], *some]), encoding="utf-8")
    result = run(part, *KNOWN)
    assert result.return_value == 1
    assert "INCONCLUSIVE: coverage: the directions reach" in result.stdout
    assert "x  not observable  not observable" in result.stdout
    document = json.loads(run(part, *KNOWN, "--json").stdout)
    assert (document["status"], document["calibration"]) == ("inconclusive", None)
    assert document["bias"]["x"]["status"] == "not observable"


def test_readings_in_a_plane_have_no_numbers(tmp_path):
    """Nothing to draw, and null in the JSON."""
    flat = tmp_path / "flat.csv"
    angles = np.linspace(0.0, 6.0, 60)
    np.savetxt(flat, np.stack([np.cos(angles), np.sin(angles), 1e-13 * angles], axis=1), delimiter=",")
    arguments = (flat, "--columns", "1,2,3", "--unit", "uT")
    assert "INCONCLUSIVE: ellipsoid: the readings lie on no ellipsoid" in run(*arguments).stdout
    assert json.loads(run(*arguments, "--json").stdout)["bias"]["x"]["value"] is None
    with pytest.raises(Refused, match="no ellipsoid to draw"):
        run(*arguments, "--plot", tmp_path / "flat.svg")


def test_exports_and_plot_are_written(tmp_path):
    """The JSON is a calibration again, the header carries its fingerprint, and the plot repeats byte by byte."""
    export, header, plots = tmp_path / "c.json", tmp_path / "c.h", [tmp_path / "a.svg", tmp_path / "b.svg"]
    run(TABLE, *KNOWN, "--export", export, "--c-header", header, "--plot", plots[0])
    run(TABLE, *KNOWN, "--plot", plots[1])
    found = magnetometer_from_json(export.read_text(encoding="utf-8"))
    assert found.bias == pytest.approx([14.2, -31.5, 6.8], abs=0.2)
    assert json.loads(export.read_text(encoding="utf-8"))["fingerprint"] in header.read_text(encoding="utf-8")
    assert plots[0].read_bytes() == plots[1].read_bytes()


def test_units_are_converted(tmp_path):
    """Counts of 0.1 uT in a field in nT give the same bias."""
    rows = np.loadtxt(TABLE, delimiter=",", skiprows=1) * [10.0, 10.0, 10.0, 1000.0]
    counts = tmp_path / "counts.csv"
    np.savetxt(counts, rows, delimiter=",", header="x [LSB],y [LSB],z [LSB],F", comments="")
    arguments = ("--columns", "1,2,3", "--unit", "LSB", "--scale", "0.1", "--scaled-unit", "uT")
    document = json.loads(run(counts, *arguments, "--field-column", "F", "--field-unit", "nT", "--json").stdout)
    plain = json.loads(run(TABLE, *KNOWN, "--json").stdout)
    assert document["bias"]["x"]["value"] == pytest.approx(plain["bias"]["x"]["value"], rel=1e-6)
    wrong = ("--columns", "1,2,3", "--unit", "uT", "--field-column", "F")
    assert "unit of x [LSB]: --unit says uT" in " ".join(run(counts, *wrong).stdout.split())


def test_a_full_scale_and_rows_without_numbers_are_told(tmp_path):
    """A reading at full scale trips its gate; a row that holds no number is left out and counted."""
    holed = tmp_path / "holed.csv"
    holed.write_text(Path(TABLE).read_text(encoding="utf-8") + "nan,1,2,40\n", encoding="utf-8")
    result = run(holed, *KNOWN, "--full-scale", "50")
    assert result.return_value == 1
    assert "INCONCLUSIVE: saturated of" in result.stdout
    assert "note: 1 row holds no finite number in a column, and is left out" in result.stdout


def test_noise_and_temperature_are_taken(tmp_path):
    """A slope of the bias from a column, and a noise that the residuals contradict."""
    rows = np.loadtxt(TABLE, delimiter=",", skiprows=1)
    degrees = np.linspace(5.0, 45.0, len(rows))
    rows[:, 0] += 0.2 * (degrees - 25.0)
    table, export = tmp_path / "warm.csv", tmp_path / "c.json"
    np.savetxt(table, np.column_stack([rows, degrees]), delimiter=",", header="x,y,z,field,T", comments="")
    result = run(
        table, *KNOWN, "--temperature", "T", "--noise", "0.3", "--export", export, "--plot", tmp_path / "p.svg"
    )
    assert result.return_value == 0
    assert "drift      of the bias x 0." in result.stdout
    assert "deg in the worst direction" in result.stdout
    assert magnetometer_from_json(export.read_text(encoding="utf-8")).warmth.drift[0] == pytest.approx(0.2, abs=0.01)
    document = json.loads(run(table, *KNOWN, "--temperature", "T", "--noise", "0.05", "--json").stdout)
    assert document["drift"]["x"]["unit"] == "uT/K"
    assert ("noise", False) in [(gate["name"], gate["ok"]) for gate in document["gates"]]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--columns", "x,y", "--unit", "uT"), "names 2 columns"),
        ((*KNOWN, "--field", "48"), "exclude each other"),
        ((*REST, "--scale", "2"), "belong together"),
        ((*REST, "--field", "48", "--field-unit", "V"), "--field-unit"),
        ((*REST, "--method", "twostep"), "needs the magnitude"),
    ],
)
def test_what_is_refused(options, told):
    """Options that do not go together say so."""
    with pytest.raises(Refused, match=told):
        run(TABLE, *options)


@pytest.mark.parametrize("size", [1e300, 1e-200])
def test_readings_that_cannot_be_squared_are_refused(tmp_path, size):
    """With the column that holds them."""
    values = np.loadtxt(TABLE, delimiter=",", skiprows=1) * [size, 1.0, 1.0, 1.0]
    np.savetxt(tmp_path / "far.csv", values, delimiter=",", header="x,y,z,field", comments="")
    with pytest.raises(Refused, match="column x varies by .*, beyond what can be squared"):
        run(tmp_path / "far.csv", *KNOWN)
