"""The command `hil analyse gyroscope-temperature`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from hil.analysis.gyroscope.interchange import from_json
from hil.cli.commands.analyse import command
from hil.model.errors import Refused

ROOT = Path(__file__).parents[3]
TABLE = str(ROOT / "docs" / "data" / "gyroscope-temperature-simulated.csv")
REST = ("--unit", "deg/s", "--temperature", "temperature", "--means", "x,y,z")
ALL = (*REST, "--rates", "rate_x,rate_y,rate_z", "--uncertainties", "ux,uy,uz")


def run(*arguments):
    """Run the command; what it raises is raised here."""
    return CliRunner().invoke(command, ["gyroscope-temperature", *arguments], catch_exceptions=False)


def test_a_table_becomes_a_calibration():
    """The example table: known truth within the stated uncertainties, degree by degree, and the range."""
    text = run(TABLE, *ALL).stdout
    assert text.startswith(f"{TABLE}: 24 readings of x, y, z in deg/s")
    assert "x: bias(T), degree 1 about 25 degC" in text
    assert "z: scale(T), degree 1 about 25 degC" in text
    assert "self-check: the exported numbers reproduce the table" in text
    assert "alignment, sensor to table axes" in text


def test_json_is_one_document_with_the_truth_of_the_simulation():
    """Slopes within four standard uncertainties of what the table was made from."""
    document = json.loads(run(TABLE, *ALL, "--json").stdout)
    assert document["readings"] == 24
    bias = document["calibration"]["axes"]["x"]["bias"]
    assert abs(bias["coefficients"][1] - 0.0121) < 4.0 * bias["covariance"][1][1] ** 0.5
    scale = document["calibration"]["axes"]["z"]["scale"]
    assert abs(scale["coefficients"][1] + 0.0005) < 4.0 * scale["covariance"][1][1] ** 0.5
    assert document["scale"]["x"]["candidates"][0]["aicc"] is None
    assert {"temperature", "value", "residual", "leverage", "deviation"} == set(document["bias"]["y"]["points"][0])


def test_the_degree_can_be_given():
    """It is used for the bias, and told with how it was chosen."""
    assert "x: bias(T), degree 2 about 25 degC, given" in run(TABLE, *ALL, "--degree", "2").stdout
    assert "x: bias(T), degree 1 about 25 degC, chosen by " in run(TABLE, *ALL).stdout


def test_exports_are_written_and_read_back(tmp_path):
    """The JSON is a calibration again, and the header carries its fingerprint."""
    run(TABLE, *ALL, "--export", str(tmp_path / "c.json"), "--c-header", str(tmp_path / "c.h"), "--margin", "1")
    text = (tmp_path / "c.json").read_text(encoding="utf-8")
    calibration = from_json(text)
    assert calibration.low < 10.0
    assert json.loads(text)["fingerprint"] in (tmp_path / "c.h").read_text(encoding="utf-8")


def test_kelvin_is_doubted_and_nothing_is_exported(tmp_path):
    """The gate names kelvin; no file is written, and the exit code is 1."""
    lines = Path(TABLE).read_text(encoding="utf-8").splitlines()
    warm = [f"{float(line.split(',')[0]) + 273.15},{line.split(',', 1)[1]}" for line in lines[1:]]
    table = tmp_path / "kelvin.csv"
    table.write_text("\n".join([lines[0], *warm]), encoding="utf-8")
    asked = ["gyroscope-temperature", str(table), *ALL, "--export", str(tmp_path / "c.json")]
    result = CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)
    assert result.return_value == 1
    assert "as of kelvin" in " ".join(result.stdout.split())
    assert not (tmp_path / "c.json").exists()


def test_rates_of_the_wrong_sign_are_doubted_and_nothing_is_exported(tmp_path):
    """The gate names axis and sign; no file is written, and the exit code is 1."""
    head, *lines = Path(TABLE).read_text(encoding="utf-8").splitlines()
    table = tmp_path / "sign.csv"
    turned = (line.split(",") for line in lines)
    rows = [",".join([*row[:4], *(f"{-float(each):g}" for each in row[4:7]), *row[7:]]) for row in turned]
    table.write_text("\n".join([head, *rows]), encoding="utf-8")
    asked = ["gyroscope-temperature", str(table), *ALL, "--export", str(tmp_path / "c.json")]
    result = CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)
    assert result.return_value == 1
    assert "gain of x: " in " ".join(result.stdout.split())
    assert not (tmp_path / "c.json").exists()


def test_rest_alone_calibrates_the_bias(tmp_path):
    """Rows at rest only: the scale is not measured, and that is said."""
    lines = Path(TABLE).read_text(encoding="utf-8").splitlines()
    rest = tmp_path / "rest.csv"
    rest.write_text("\n".join([lines[0], *(line for line in lines if ",0,0,0," in line), ""]), encoding="utf-8")
    text = run(str(rest), *REST, "--uncertainty", "0.002").stdout
    assert "scale of axis x, y, z: not measured" in text
    assert "alignment: not measured" in text


@pytest.mark.system
@pytest.mark.parametrize("ending", ["svg", "png"])
def test_the_plot_has_the_same_bytes_each_time(tmp_path, ending):
    """Neither date nor random names are in the drawing."""
    for name in ("one", "two"):
        run(TABLE, *ALL, "--plot", str(tmp_path / f"{name}.{ending}"))
    first, second = ((tmp_path / f"{name}.{ending}").read_bytes() for name in ("one", "two"))
    assert first == second
    assert len(first) > 10_000


def test_residuals_are_drawn_below_bias_and_scale(tmp_path):
    """A panel for each, in its unit."""
    run(TABLE, *ALL, "--plot", str(tmp_path / "fits.svg"))
    drawn = (tmp_path / "fits.svg").read_text(encoding="utf-8")
    for label in ("bias [deg/s]", "residual [deg/s]", "scale [1]", "residual [1]"):
        assert drawn.count(f"<!-- {label} -->") == 1


@pytest.mark.parametrize(
    ("arguments", "why"),
    [
        ((*ALL, "--uncertainty", "1"), "--uncertainties and --uncertainty exclude each other"),
        ((*REST, "--uncertainty", "0"), "an uncertainty is not above zero"),
        ((*REST, "--rates", "rate_x"), "--rates names 1 columns for 3 axes"),
        ((*REST, "--axes", "x,x,z"), "two axes have the same name"),
        ((*REST[:-1], "x,y,w"), "no column 'w'"),
        ((*ALL, "--plot", "plot.gif"), r"a plot is written as \.svg or \.png"),
        ((*ALL, "--export", "/nowhere/c.json"), "No such file or directory"),
        ((*ALL, "--c-header", "/nowhere/c.h"), "No such file or directory"),
    ],
)
def test_what_cannot_be_done_is_refused_in_a_sentence(arguments, why):
    """Bad options, columns and places are refusals that say what to do."""
    with pytest.raises(Refused, match=why):
        run(TABLE, *arguments)
