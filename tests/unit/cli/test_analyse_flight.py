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
    assert "phases begin and end to within 2 s; rest 54%, rotation 40%, unsteady 5%" in result.stdout
    assert result.stdout.endswith(f" rest: hil analyse allan {LOG} --time t --columns gx,gy,gz --unit deg/s --to 118\n")
    assert "rotation" not in (tmp_path / "flight.svg").read_text()[:200]


def test_the_command_for_the_longest_rest_names_the_same_samples():
    """Where a part of the log is meant, the rest is found in the whole of it, and the times say where they begin."""
    result = run(LOG, *BOTH, "--from", "100", "--scale", "0.5", "--scaled-unit", "deg/s")
    assert "note: times count from 100 s of the log (--from)" in result.stdout
    *_, last = result.stdout.splitlines()
    prefix = "flicker and random walk of the longest rest: hil analyse allan "
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
    document = json.loads(run(LOG, *RATES, "--json").stdout)
    assert document["remarks"] == ["without a magnetometer a steady turn of less than 1 deg/s is taken for rest"]
    assert document["field_sampling"] is None


def test_counts_are_scaled_or_their_limit_is_given():
    """1 deg/s is no number of counts; rates in counts cannot be held against the field."""
    with pytest.raises(Refused, match="LSB is not a unit of rate"):
        run(LOG, *RATES[:-1], "LSB")
    result = run(LOG, *RATES[:-1], "LSB", "--still", 1, *BOTH[6:])
    assert result.return_value == 0
    scaled = run(LOG, *RATES[:-1], "LSB", "--scale", 1, "--scaled-unit", "deg/s", *BOTH[6:])
    assert scaled.stdout.splitlines()[:-1] == run(LOG, *BOTH).stdout.splitlines()[:-1]


@pytest.mark.parametrize(
    ("options", "reason"),
    [
        (("--time", "t", "--unit", "deg/s"), "--columns is missing: rest is detected from the rates"),
        (("--time", "t", "--unit", "deg/s", *BOTH[6:]), "missing: a constant field allows rotation about itself"),
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


def _merged(path, how):
    """Write the log with every fifth reading of the magnetometer, as programs merge logs; return the file."""
    lines = [line for line in Path(LOG).read_text().splitlines() if not line.startswith("#")]
    rows, field, last = lines[:1], [], []
    for place, line in enumerate(lines[1:]):
        cells = line.split(",")
        last = cells[4:] if place % 5 == 0 else last
        if how == "events":
            rows.append(",".join((*cells[:4], "", "", "")))
            rows += [",".join((f"{float(cells[0]) + 0.07:.2f}", "", "", "", *last))] if place % 5 == 0 else []
        else:
            field = last if place % 5 == 0 or how == "held" else [how] * 3
            rows.append(",".join((*cells[:4], *field)))
    path.write_text("\n".join(rows) + "\n")
    return path


@pytest.mark.parametrize("how", ["held", "nan", "", "events"])
def test_a_slower_magnetometer_is_read_at_its_own_rate(tmp_path, how):
    """However two logs were merged: the same phases, no gate trips, and a note says how many readings there are."""
    result = run(_merged(tmp_path / "log.csv", how), *BOTH, "--plot", tmp_path / "flight.png")
    assert result.return_value == 0
    table = result.stdout.partition("rates/field\n")[2].partition("phases begin")[0]
    rows = [line.split() for line in table.splitlines()]
    assert [cells[3] for cells in rows] == ["rest", "rotation", "unsteady", "rest", "rotation", "rest"]
    told = " ".join(result.stdout.split())
    assert f"note: 560 of {3360 if how == 'events' else 2800} rows hold a reading of mx, my, mz, at 1 Hz" in told
    assert "samples are missing" not in told
    document = json.loads(run(tmp_path / "log.csv", *BOTH, "--json").stdout)
    assert any(each.startswith("560 of ") for each in document["remarks"])
    assert (document["sampling"]["rate"], document["field_sampling"]["rate"]) == pytest.approx((5.0, 1.0), rel=1e-3)
    ratio = float(next(cells for cells in rows if cells[3] == "rotation")[-3])
    assert abs(ratio - 1.0) < 0.02


def test_a_slower_gyroscope_and_a_rate_that_was_given(tmp_path):
    """Rows that repeat the rates are none of theirs: white noise and rate are those of the readings."""
    rows = [line for line in Path(LOG).read_text().splitlines() if not line.startswith("#")]
    cells = [line.split(",") for line in rows[1:]]
    held = [",".join((*cells[place - place % 5][1:4], *line[4:])) for place, line in enumerate(cells)]
    (tmp_path / "log.csv").write_text("\n".join((rows[0].removeprefix("t,"), *held)) + "\n")
    result = run(tmp_path / "log.csv", "--rate", "5", *BOTH[2:])
    assert "log.csv: 560 samples in 559 s sampling: 1.0000" in " ".join(result.stdout.split())
    assert result.return_value == 0


def test_a_log_without_windows_of_both_sensors_is_refused(tmp_path):
    """One was switched off before the other was switched on: nothing is called missing from end to end."""
    lines = [line for line in Path(LOG).read_text().splitlines() if not line.startswith("#")]
    rows = [line.split(",") for line in lines[1:]]
    half = [",".join((*row[:4], *(["nan"] * 3 if place < 1400 else row[4:]))) for place, row in enumerate(rows)]
    half = [
        line if place < 1400 else ",".join((rows[place][0], *["nan"] * 3, *rows[place][4:]))
        for place, line in enumerate(half)
    ]
    (tmp_path / "log.csv").write_text("\n".join((lines[0], *half)) + "\n")
    with pytest.raises(Refused, match="no window of 2 s has half of the samples of every column"):
        run(tmp_path / "log.csv", *BOTH)


@pytest.mark.parametrize("name", ["flight", "drift"])
def test_columns_that_must_be_named_have_no_default(name):
    """The help of other analyses says which columns they take by themselves."""
    told = CliRunner().invoke(command, [name, "--help"]).output
    assert "by default" not in told.partition("--columns A,B,C")[2].partition("--unit")[0]
