"""The command `hil analyse solar`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import Refused

TABLE = str(Path(__file__).parents[3] / "docs" / "data" / "solar-panel-simulated.csv")
COLUMNS = ("--voltage", "1", "--voltage-unit", "V", "--current", "2", "--current-unit", "A")
CORRECTED = (
    *("--irradiance", "3", "--temperature", "4", "--to", "1367", "28", "--alpha", "0.0006", "--beta", "-0.00211"),
    *("--resistance", "0.12", "--kappa", "0.0029", "--light", "0.035"),
)


def run(*arguments):
    """Run the command; what it raises is raised here."""
    asked = ["solar", *map(str, arguments)]
    return CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)


def test_a_curve_becomes_figures():
    """As lines, with the extrapolation; not corrected where nothing says to what."""
    result = run(TABLE, *COLUMNS)
    assert result.return_value == 0
    lines = result.stdout.splitlines()
    assert lines[0] == f"{TABLE}: 41 points, not corrected"
    assert "  open circuit voltage   2.63191 ± 0.00011 V" in lines
    assert lines[-1] == "extrapolated to short circuit: 1.4% of the open-circuit voltage"


def test_json_holds_the_truth_of_the_simulation():
    """At 1367 W/m^2 and 28 degC, to 0.04 %; the corrected points are exported and drawn."""
    document = json.loads(run(TABLE, *COLUMNS, *CORRECTED, "--json").stdout)
    for name, true in (
        ("short_circuit_current", 0.39995),
        ("open_circuit_voltage", 2.6993),
        ("maximum_power", 0.89751),
        ("fill_factor", 0.83135),
    ):
        assert document[name]["value"] == pytest.approx(true, rel=4e-4), name
        assert 0.0 < document[name]["uncertainty"] < 2e-4
    assert (document["status"], document["corrected_to"], document["procedure"]) == ("conclusive", [1367.0, 28.0], 2)


def test_export_and_plot(tmp_path):
    """The corrected points by rising voltage; a plot of the same."""
    places = (tmp_path / "curve.csv", tmp_path / "curve.svg")
    assert run(TABLE, *COLUMNS, *CORRECTED, "--export", places[0], "--plot", places[1]).return_value == 0
    lines = places[0].read_text(encoding="utf-8").splitlines()
    assert (lines[0], len(lines)) == ("voltage [V],current [A]", 42)
    assert float(lines[-1].split(",")[0]) == pytest.approx(2.699, abs=1e-3)
    assert places[1].read_text(encoding="utf-8").startswith("<?xml")


def test_a_mixed_up_unit_is_inconclusive_and_not_exported(tmp_path):
    """By the name of the column, and by the data sheet; exit code 1."""
    wrong = ["mV" if each == "V" else each for each in COLUMNS]
    result = run(TABLE, *wrong, "--nominal-voltage", 2.7, "--export", tmp_path / "curve.csv")
    assert result.return_value == 1
    said = " ".join(result.stdout.split())
    assert "--unit says mV, but the name of column 'voltage [V]' says V" in said
    assert "the largest is 0.00263 where 2.7 is expected, near 1/1000" in said
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((*COLUMNS, "--to", "1367", "28"), "--to needs what the curve was measured at"),
        (["W" if each == "V" else each for each in COLUMNS], "--voltage-unit"),
    ],
)
def test_what_cannot_be_is_refused(arguments, said):
    """With what to give."""
    with pytest.raises(Refused, match=said):
        run(TABLE, *arguments)


def test_too_few_points_are_refused(tmp_path):
    """In a sentence, not by a traceback."""
    table = tmp_path / "one.csv"
    table.write_text("v,i\n1.0,0.1\n", encoding="utf-8")
    with pytest.raises(Refused, match="at least two points"):
        run(table, *COLUMNS)


@pytest.mark.parametrize("size", [1e300, 1e-200])
def test_a_curve_that_cannot_be_squared_is_refused(tmp_path, size):
    """With the column that holds it."""
    rows = (f"{0.1 * place},{size * (1.0 - 0.01 * place)}" for place in range(30))
    (tmp_path / "far.csv").write_text("voltage,current\n" + "\n".join(rows) + "\n")
    with pytest.raises(Refused, match="column current varies by .*, beyond what can be squared"):
        run(tmp_path / "far.csv", *COLUMNS)
