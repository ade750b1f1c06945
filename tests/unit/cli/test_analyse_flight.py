"""The command `hil analyse flight`."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import Refused

pytestmark = pytest.mark.usefixtures("in_the_checkout")

LOG = "docs/data/flight-simulated.csv"
RATES = ("--time", "t", "--columns", "gx,gy,gz", "--unit", "deg/s")
BOTH = (*RATES, "--field", "mx,my,mz", "--field-unit", "uT")


def run(*arguments):
    """Run the command; what it raises is raised here."""
    asked = ["flight", *map(str, arguments)]
    return CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)


def test_the_example_shows_six_phases(tmp_path):
    """As its description says; nothing speaks against them, and they are drawn."""
    result = run(LOG, *BOTH, "--plot", tmp_path / "flight.svg")
    assert result.return_value == 0
    kinds = [line.split()[3] for line in result.stdout.splitlines()[5:11]]
    assert kinds == ["rest", "rotation", "unsteady", "rest", "rotation", "rest"]
    assert "beginnings and ends to 2 s; rest 54%, rotation 40%, unsteady 5%" in result.stdout
    assert result.stdout.endswith(f" rest: hil analyse allan {LOG} --time t --columns gx,gy,gz --unit deg/s --to 118\n")
    assert "rotation" not in (tmp_path / "flight.svg").read_text()[:200]


def test_the_command_for_the_longest_rest_names_the_same_samples():
    """Where a part of the log is meant, the rest is found in the whole of it, and the times say where they begin."""
    result = run(LOG, *BOTH, "--from", "100", "--scale", "0.5", "--scaled-unit", "deg/s")
    assert "note: times count from 100 s of the log (--from)" in result.stdout
    *_, last = result.stdout.splitlines()
    prefix = "all noise of the longest rest: hil analyse allan "
    begin = "--scale 0.5 --scaled-unit deg/s --from 270 --to 378"
    assert last == f"{prefix}{LOG} --time t --columns gx,gy,gz --unit deg/s {begin}"
    again = CliRunner().invoke(command, ["allan", *last.removeprefix(prefix).split()], standalone_mode=False)
    assert "541 samples in 108 s" in again.stdout


def test_json_says_the_same(tmp_path):
    """Samples counted from 1, figures as evidence encodes them, and the gates of each phase."""
    document = json.loads(run(LOG, *BOTH, "--json").stdout)
    assert [each["kind"] for each in document["phases"]][:3] == ["rest", "rotation", "unsteady"]
    spin = document["phases"][1]
    assert (spin["begin"], spin["first"]) == (118.0, 591)
    assert abs(spin["agreement"]["value"]) < 4 * spin["agreement"]["uncertainty"]
    assert {gate["name"] for gate in spin["gates"]} >= {"finite", "stuck", "saturated", "repeated", "agrees"}
    assert document["status"] == "conclusive"


def test_a_unit_that_is_wrong_is_inconclusive():
    """The field tells the rates' unit; exit code 1."""
    result = run(LOG, *RATES[:-1], "rad/s", *BOTH[6:])
    assert result.return_value == 1
    assert "INCONCLUSIVE: phase 2, agrees: the rates turn 57.3" in " ".join(result.stdout.split())


def test_without_a_magnetometer_it_says_what_it_cannot_see():
    """Phases come from the rates alone."""
    result = run(LOG, *RATES)
    assert result.return_value == 0
    told = " ".join(result.stdout.split())
    assert "note: without a magnetometer a steady turn of less than 1 deg/s is taken for rest" in told


def test_counts_are_scaled_or_their_limit_is_given():
    """1 deg/s is no number of counts; rates in counts cannot be held against the field."""
    with pytest.raises(Refused, match="LSB is no unit of a rate"):
        run(LOG, *RATES[:-1], "LSB")
    result = run(LOG, *RATES[:-1], "LSB", "--still", 1, *BOTH[6:])
    assert result.return_value == 0
    scaled = run(LOG, *RATES[:-1], "LSB", "--scale", 1, "--scaled-unit", "deg/s", *BOTH[6:])
    assert scaled.stdout.splitlines()[:-1] == run(LOG, *BOTH).stdout.splitlines()[:-1]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--time", "t", "--unit", "deg/s"), "--columns is missing"),
        (("--time", "t", "--columns", "gx,gy", "--unit", "deg/s"), "--columns names 2 columns"),
        ((*RATES, "--field", "mx,my", "--field-unit", "uT"), "--field names 2 columns"),
        ((*RATES, "--field", "mx,my,mz"), "--field and --field-unit belong together"),
        ((*BOTH, "--to", "15"), "less than 10 windows"),
        ((*RATES, "--field", "gx,my,mz", "--field-unit", "uT"), "column 'gx' is named twice"),
    ],
)
def test_what_cannot_be_is_refused(options, reason):
    """In a sentence that says what to give."""
    with pytest.raises(Refused, match=reason):
        run(LOG, *options)


def test_an_infinite_reading_is_told(tmp_path):
    """It is left out as one that is missing, and the log is in doubt."""
    lines = Path(LOG).read_text().splitlines()
    header = next(number for number, line in enumerate(lines) if line.startswith("t,"))
    cells = lines[header + 800].split(",")
    lines[header + 800] = ",".join([cells[0], "inf", *cells[2:]])
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    result = run(tmp_path / "log.csv", *BOTH)
    assert result.return_value == 1
    assert "INCONCLUSIVE: finite of gx: 1 of 2800 samples are not finite numbers" in " ".join(result.stdout.split())


@pytest.mark.parametrize("name", ["flight", "drift"])
def test_columns_that_must_be_named_have_no_default(name):
    """The help of other analyses says which columns they take by themselves."""
    told = CliRunner().invoke(command, [name, "--help"]).output
    assert "by default" not in told.partition("--columns A,B,C")[2].partition("--unit")[0]
