"""`hil export`: what a person asks for, and what is answered."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from hil.cli.main import main

REFERENCE = str(Path(__file__).parents[3] / "reports" / "reference")
ID = "001-test_background-background-SIMULATED"


def said(capsys, *arguments):
    """Return exit code, output and errors of one export of the reference package."""
    with pytest.raises(SystemExit) as left:
        main(("export", REFERENCE, *arguments))
    told = capsys.readouterr()
    return left.value.code, told.out, told.err


@pytest.fixture(autouse=True)
def place(tmp_path, monkeypatch):
    """Be in an empty folder."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_new_folder_here_by_default(capsys, place):
    """Every recording, a line for each, and the folder last."""
    code, out, _ = said(capsys, "--csv", "--mat")
    assert code == 0
    *lines, last = out.splitlines()
    assert last == "reference-export"
    assert f"{ID}.csv, {ID}.json, {ID}.mat: 100 rows" in lines
    assert sorted(path.name for path in (place / last).iterdir()) == sorted(
        name for line in lines for name in line.partition(":")[0].split(", ")
    )


def test_one_recording_as_a_spreadsheet_here_reads_it(capsys, place):
    """Chosen by name and case, with semicolons and decimal commas, the facts above."""
    options = ("--recording", "background", "--case", "test_background", "--facts", "above")
    code, out, _ = said(capsys, "--csv", "--separator", ";", "--decimal", ",", *options, "--output", "out")
    assert (code, out) == (0, f"{ID}.csv: 100 rows\nout\n")
    text = (place / "out" / f"{ID}.csv").read_text(encoding="utf-8")
    assert "# mark: SIMULATED\n" in text
    assert "\ntime [s];x [uT];y [uT];z [uT];temperature [degC]\n4,082805349;" in text


def test_tabs_are_named_by_a_word(capsys, place):
    """Nobody can type one in every shell."""
    said(capsys, "--csv", "--separator", "tab", "--output", "out")
    assert json.loads((place / "out" / f"{ID}.json").read_bytes())["file"]["separator"] == "\t"
    assert (place / "out" / f"{ID}.csv").read_text(encoding="utf-8").startswith("time [s]\tx [uT]\t")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "add --csv or --mat"),
        (("--csv", "--decimal", ","), "add --separator ';'"),
        (("--mat", "--facts", "above"), "add --csv"),
        (("--csv", "--compress"), "add --mat"),
        (("--csv", "--output", ""), "--output names no folder"),
        (("--csv", "--recording", "backgruond"), "did you mean 'background'?"),
        (("--csv", "--recording", "bad\nname"), "there is no recording 'bad\\nname'"),
        (("--csv", "--case", "test_backgroud"), "did you mean 'test_background'?"),
        (("--csv", "--separator", "|"), "'tab'"),
        (("--csv", "--output", REFERENCE), "inside the sealed package"),
    ],
)
def test_a_call_that_cannot_be_met_is_refused(capsys, place, arguments, message):
    """In a sentence with a way out, and before anything is written."""
    code, out, err = said(capsys, *arguments)
    assert (code, out) == (4, "")
    assert message in err
    assert list(place.iterdir()) == []


def test_a_second_export_overwrites_nothing(capsys):
    """The first one stays as it is."""
    assert said(capsys, "--csv")[0] == 0
    code, _, err = said(capsys, "--csv")
    assert (code, "exists already" in err) == (4, True)
