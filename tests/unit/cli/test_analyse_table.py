"""The command `hil analyse table`."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import ConfigurationError, Refused

pytestmark = pytest.mark.usefixtures("in_the_checkout")

DATA = Path("docs/data")

THESIS = {
    ("4.6", "y", "flicker"): (893.17, "4.3 had 7.5690e-5, not 7.5660e-5"),
    ("4.6", "z", "white"): (-53.634, "the same number is printed in 4.9, row z, column white"),
    ("4.29", "z", "random walk"): (6606.5, "4.27 had 1.563e-6, not 81.563e-6"),
    ("4.46", "x", "drift"): (-147.02, "no usual slip"),
    ("4.46", "x", "offset"): (-682.29, "no usual slip"),
    ("4.46", "y", "drift"): (-29.25, "no usual slip"),
    ("4.46", "y", "offset"): (40.61, "no usual slip"),
    ("4.46", "z", "drift"): (-160.22, "no usual slip"),
    ("4.46", "z", "offset"): (-66.91, "no usual slip"),
}
"""The cells of 120 that do not follow, what they should be, and what would explain it."""


def run(*arguments):
    """Run the command; what it raises is raised here."""
    return CliRunner().invoke(command, ["table", *map(str, arguments)], catch_exceptions=False, standalone_mode=False)


def written(folder, **files):
    """Write files, and return their paths in order."""
    for name, text in files.items():
        (folder / name.replace("_", ".")).write_text(text, encoding="utf-8")
    return [folder / name.replace("_", ".") for name in files]


@pytest.fixture(scope="module")
def thesis():
    """Return what is said of the percentage tables of a thesis."""
    found = run(DATA / "imu-tables.yaml", "--json")
    return found.return_value, json.loads(found.stdout)


def test_nine_cells_of_a_thesis_do_not_follow(thesis):
    """84 cells of seven tables of noise, and 36 of six tables of temperature: nine do not follow."""
    code, document = thesis
    cells = {
        (each["published"], cell["row"], cell["column"]): cell for each in document["tables"] for cell in each["cells"]
    }
    wrong = {key: cell for key, cell in cells.items() if cell["verdict"] != "follows"}
    assert (code, document["status"], len(cells), sorted(wrong)) == (1, "inconsistent", 120, sorted(THESIS))
    for key, (value, cause) in THESIS.items():
        middle = (wrong[key]["low"] + wrong[key]["high"]) / 2
        assert middle == pytest.approx(value, rel=2e-4)
        assert any(cause in each for each in wrong[key]["causes"]), wrong[key]["causes"]
    assert document["counts"] == {"follows": 111, "does not follow": 9, "unknown": 0}
    assert cells["4.6", "z", "white"]["at"].endswith("imu-noise-tables.csv:13:15")


def test_a_factor_of_ten_a_count_and_two_signs_are_found():
    """The energies of a battery test, its cycles, and the equations of a gyroscope."""
    document = json.loads(run(DATA / "pocketqube-tables.yaml", "--json").stdout)
    itself, table, equations = (
        {(each["row"], each["column"]): each for each in part["cells"]} for part in document["tables"]
    )
    assert {each["verdict"] for each in itself.values()} == {"follows"}
    assert table["energy at the beginning", "value"]["causes"] == ["it is about 10 times the recomputed value"]
    assert table["loss per cycle", "value"]["causes"] == ["it is 10 times the recomputed value"]
    cycles = table["cycles", "value"]
    assert (cycles["verdict"], cycles["low"]) == ("does not follow", pytest.approx(119.7, abs=0.1))
    assert table["duration of a cycle", "value"]["low"] == pytest.approx(7.05, abs=0.01)
    wrong = {row for (row, _), each in equations.items() if each["verdict"] != "follows"}
    signs = {
        row for (row, column), each in equations.items() if column.endswith("25 degC") and "sign" in str(each["causes"])
    }
    assert (wrong, signs) == ({"X", "Y", "Z"}, {"X", "Z"})


def test_it_is_told_in_eighty_columns():
    """A part for each table; cells that do not follow with their causes, the others with --all."""
    text = run(DATA / "pocketqube-tables.yaml").stdout
    assert max(map(len, text.splitlines())) <= 80
    assert "  energy at the beginni…  value        70  7.0700 ± 0.0050\n" in text
    assert "12 cells in 3 tables: 3 follow, 9 do not" in text
    assert "  6 cells: 1 follows, 5 do not" in text
    assert not re.search(" follows$", text, re.MULTILINE)
    assert re.search(" follows$", run(DATA / "pocketqube-tables.yaml", "--all").stdout, re.MULTILINE)


def test_a_table_in_csv_needs_no_job(tmp_path):
    """Semicolons, decimal commas, comments, units in brackets, blank cells; one column with a formula of its own."""
    published, before, after = written(
        tmp_path,
        p_csv="part;mass [%];note\nframe;10,0;ok\nlid;25;-\n",
        a_csv="# in grams\npart;mass [g]\nframe;200\nlid;4,0\n",
        b_csv="part;mass [g]\nframe;220\nlid;5\n",
    )
    options = ("--from", f"a={before}", "--from", f"b={after}", "--formula", "100*(b-a)/a")
    found = run(published, *options)
    assert found.return_value == 0
    assert "2 cells in 1 table: 2 follow" in found.stdout
    found = run(published, *options, "--column", "mass=b-a")
    assert found.return_value == 1
    assert "2 cells: 2 do not" in found.stdout


def test_a_cell_that_cannot_be_recomputed_is_no_success(tmp_path):
    """A source that is blank: exit code 1, and the reason."""
    published, before, after = written(tmp_path, p_csv="k,v\nx,10\n", a_csv="k,v\nx,\ny,1\n", b_csv="k,v\nx,2\n")
    found = run(published, "--from", f"a={before}", "--from", f"b={after}", "--formula", "b-a")
    assert found.return_value == 1
    assert "has no number in row x, column v" in " ".join(found.stdout.split())


def test_rows_may_have_two_names_and_numbers_their_digits(tmp_path):
    """A row is named by device and axis; five digits make 2.5 differ from what follows, and a count is exact."""
    job, _, _ = written(
        tmp_path,
        job_yaml="""schema: hil/published-tables/1
tables:
- {name: p, file: p.csv, rows: [device, axis], digits: "5"}
- {name: q, file: q.csv, rows: [device, axis], digits: exact}
checks:
- {published: p, from: {a: q}, formula: a/4}
""",
        p_csv="device,axis,v\nA,x,2.5\nA,y,0.75\n",
        q_csv="axis,device,v\nx,A,10.001\ny,A,3\n",
    )
    found = run(job, "--all")
    assert "A x  v           2.5  2.50025" in found.stdout
    assert "2 cells in 1 table: 1 follows, 1 does not" in found.stdout


JOB = """schema: hil/published-tables/1
tables:
- {file: all.csv, split: table}
checks:
- {published: p, from: {a: q}, formula: FORMULA}
"""
ALL = "table,k,v\np,x,1\nq,x,2\n"


def job(old="FORMULA", new="a"):
    """Return the job with another part."""
    return JOB.replace(old, new).replace("FORMULA", "a")


@pytest.mark.parametrize(
    ("job", "data", "message"),
    [
        (job(new="a + c"), ALL, r"job.yaml:5:41: unknown name 'c' \(at character 5"),
        (job("a: q", "a: r"), ALL, r"job.yaml:5:28: there is no table 'r'"),
        (job("published: p", "published: pp"), ALL, r"job.yaml:5:15: there is no table 'pp'"),
        (job("formula: FORMULA", "columns: {w: a}"), ALL, r"job.yaml:5:\d+: p has no column 'w'"),
        (
            job("formula: FORMULA", "cells: [{row: y, column: v, formula: a}]"),
            ALL,
            r"job.yaml:5:\d+: p has no row 'y'",
        ),
        (job(", formula: FORMULA", ""), ALL, r"job.yaml:5:3: no formula is given"),
        (job("split: table", "split: tabel"), ALL, r"all.csv:1:1: there is no column 'tabel', did you mean 'table'\?"),
        (job(), ALL + "q,y\n", r"all.csv:4:1: this row has 2 cells, and the line of names 3"),
        (job(), ALL + "q,x,3\n", r"all.csv:4:3: q has two rows 'x'"),
        (job(), ALL + "q,y,3\nq,z,about 4\n", r"all.csv:5:5: 'about 4' is not a number"),
        (job(), "table,v,v\n" + ALL, r"all.csv:1:9: two columns are called 'v'"),
        (job(), "table,k,v\n", r"all.csv: a table has a line of names"),
        (job("formula", "formulla"), ALL, r"job.yaml:5:\d+: unknown key 'formulla', did you mean 'formula'"),
        (job("split: table", 'digits: "20"'), ALL, r"job.yaml:3:\d+: .*'digits' must be a number of digits"),
        (job("all.csv", "none.csv"), ALL, r"none.csv: the file is missing"),
    ],
)
def test_errors_name_file_line_and_column(tmp_path, job, data, message):
    """What is wrong with a job or its tables is told at its place."""
    path, _ = written(tmp_path, job_yaml=job, all_csv=data)
    with pytest.raises(ConfigurationError, match=message):
        run(path)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ((), "tables that it was computed from are missing"),
        (("--from", "a=FILE"), "the formula is missing"),
        (("--from", "aFILE", "--formula", "a"), "has no '='"),
        (("--from", "a=FILE", "--from", "a=FILE", "--formula", "a"), "names 'a' twice"),
    ],
)
def test_options_that_do_not_fit_are_refused(tmp_path, options, message):
    """Each says what to give."""
    (path,) = written(tmp_path, p_csv="k,v\nx,1\n")
    with pytest.raises(Refused, match=message):
        run(path, *(each.replace("FILE", str(path)) for each in options))
    path_of_job, _ = written(tmp_path, job_yaml=job(), all_csv=ALL)
    with pytest.raises(Refused, match="are for a table in CSV"):
        run(path_of_job, "--formula", "a")
    with pytest.raises(ConfigurationError, match="--formula: unknown name 'b'"):
        run(path, "--from", f"a={path}", "--formula", "b")


UNREAD = ("1.0 ± 0.14", "1,000", "1 000", "1'000", "1 V", "12.5*", "1.5(1)", "< 1", "1e400", "1.500,5")
"""What people print, and what is no number to the command."""


@pytest.mark.parametrize("formula", [("--formula", "a"), ("--column", "v=a")])
@pytest.mark.parametrize("text", UNREAD)
def test_a_cell_that_cannot_be_read_never_passes_unchecked(tmp_path, text, formula):
    """Not even where every other cell of its column is like it, so that it could be one of remarks."""
    published, source = written(tmp_path, p_csv=f'k,w,v\nx,1,"{text}"\ny,2,\n', a_csv="k,w,v\nx,1,1\ny,2,2\n")
    with pytest.raises(ConfigurationError, match=r"p\.csv:2:6: '.*' is not a number: correct it"):
        run(published, "--from", f"a={source}", *formula)


def test_remarks_are_left_out(tmp_path):
    """A column of words beside numbers."""
    published, source = written(tmp_path, p_csv="k,v,remark\nx,1,windy\ny,2,\n", a_csv="k,v\nx,1\ny,2\n")
    result = run(published, "--from", f"a={source}", "--formula", "a")
    assert (result.return_value, "2 cells: 2 follow" in result.stdout) == (0, True)


def test_a_table_without_a_checked_cell_does_not_pass(tmp_path):
    """It says so, where it said that no cells follow, with exit code 0."""
    published, source = written(tmp_path, p_csv="k,v\nx,none\n", a_csv="k,v\nx,1\n")
    with pytest.raises(ConfigurationError, match=r"p\.csv has no number that could be checked"):
        run(published, "--from", f"a={source}", "--formula", "a")
    with pytest.raises(ConfigurationError, match=r"p\.csv:2:3: 'none' is not a number"):
        run(published, "--from", f"a={source}", "--column", "v=a")
