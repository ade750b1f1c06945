"""`hil trend`: what checks of one parameter found from run to run, as table, CSV and plot."""

from __future__ import annotations

import csv
import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from evidence_runs import DUT, begin, case_end, check, record, recorded_check, stamps, write_report
from typed_events import event_of

from hil.audit.trend import Point, line, spread, trends
from hil.cli.commands.trend import _statistics
from hil.cli.main import main
from hil.evidence.events.cases import Bounds
from hil.evidence.folder import JOURNAL
from hil.evidence.package.sealing import seal
from hil.evidence.package.verification import State
from hil.evidence.runs import RunSummary


def said(capsys, *arguments):
    """Return exit code, output and errors of one command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    return left.value.code, told.out, told.err


def sealed(reports, day, value, serial="SN1", source="hardware"):
    """Seal a run of one case that measured a value."""
    folder = reports / f"run-{serial}-{day[-2:]}abcd"
    journal = begin(folder, stamp=stamps(day), source=source, dut={**DUT, "serial": serial})
    journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
    journal.write(event_of("step", case="test_rest", path=["Hold"], number="1"), 0.0)
    record(folder, journal)
    check(journal, value, of="x")
    check(journal, value / 2, of="y")
    recorded_check(journal)
    journal.write(event_of("step-end", case="test_rest", path=["Hold"], number="1", outcome="done", duration=4.0), 4.0)
    case_end(journal)
    journal.write(event_of("safe-end", ok=True), 5.0)
    seal(folder, journal, exit_code=0, write_reports=write_report)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a workspace with three runs of one unit, and a simulated one of another."""
    root = tmp_path_factory.mktemp("trend")
    (root / "hil.toml").write_text("")
    for day, value in (("2026-11-01", 0.1), ("2026-11-02", 0.2), ("2026-11-03", 0.3)):
        sealed(root / "reports", day, value)
    sealed(root / "reports", "2026-11-04", 0.4, "SN2", "simulated")
    return root


@pytest.fixture
def workspace(runs, tmp_path, monkeypatch):
    """Go to a copy of the workspace, to write to and to damage."""
    own = shutil.copytree(runs, tmp_path / "workspace")
    monkeypatch.chdir(own)
    return own


def test_a_parameter_over_runs_is_a_table(capsys, workspace):
    """What is the same in all rows stands above, what was simulated is marked, and it fits on a terminal."""
    code, out, err = said(capsys, "trend", "rate_error", "--of", "x")
    lines = out.splitlines()
    assert (code, err) == (0, "")
    assert max(map(len, lines)) <= 80
    assert lines[:3] == ["GYR-030  rate_error of x [deg/s]", "  test_rest", "  limit -0.5 to 0.5"]
    assert lines[4].split() == ["2026-11-01", "10:00", "01abcd", "SN1", "0.100", "±", "0.020", "PASS", "hardware"]
    assert lines[-2:] == ["  SN1: n = 3, mean 0.200, s 0.1", "    slope 0.1 deg/s per day, 95% interval"]
    assert "SIMULATED" in next(row for row in lines if "SN2" in row)
    assert "SN2" not in said(capsys, "trend", "rate_error", "--hardware")[1]


def test_a_parameter_over_runs_is_csv(capsys, workspace):
    """It tells the same values; negative limits stay numbers."""
    rows = list(csv.DictReader(said(capsys, "trend", "rate_error", "--csv", "--of", "x")[1].splitlines()))
    assert [(row["dut"], row["value"], row["min"], row["source"]) for row in rows] == [
        *(("SN1", value, "-0.5", "hardware") for value in ("0.1", "0.2", "0.3")),
        ("SN2", "0.4", "-0.5", "simulated"),
    ]


@pytest.mark.system
def test_a_parameter_over_runs_is_drawn(capsys, workspace):
    """The drawing library takes longer to load than all else here."""
    code, out, _ = said(capsys, "trend", "rate_error", "--dut", "SN1", "--plot", "trend.svg")
    assert (code, "SN2" in out) == (0, False)
    assert (workspace / "trend.svg").read_text().startswith("<?xml")


@pytest.mark.parametrize(
    ("arguments", "answer"),
    [
        (("rate_eror",), "did you mean 'rate_error'?"),
        (("rate_error", "--dut", "SN9"), "no run tested unit 'SN9'"),
        (("rate_error", "--requirement", "GYR-010"), "for GYR-010"),
        (("channels", "--plot", "x.svg"), "has no number to draw"),
    ],
)
def test_a_question_without_an_answer_says_what_there_is(capsys, workspace, arguments, answer):
    """The nearest parameter, the units, or which choice to leave out."""
    code, _, err = said(capsys, "trend", *arguments)
    assert (code, answer in err) == (4, True)


def test_a_damaged_package_has_no_value(capsys, workspace):
    """It is left out, and that is said; the index does not bring it back."""
    journal = workspace / "reports/run-SN1-02abcd" / JOURNAL
    journal.chmod(0o644)
    journal.write_bytes(journal.read_bytes()[:-1])
    _, out, err = said(capsys, "trend", "rate_error", "--of", "x")
    assert ("02abcd" in out, err.startswith("1 of 4 runs left out")) == (False, True)


POINT = Point(
    run=RunSummary(folder=Path(), state=State.SEALED),
    case="test_one",
    requirement="R-1",
    parameter="current",
    of="",
    value=1.0,
    unit="A",
    uncertainty=0.1,
    dof=None,
    expanded=0.2,
    limit=Bounds(min=None, max="2", equals=None),
    limit_unit="A",
    decision="guarded",
    verdict="PASS",
)


def at(day, value, **changes):
    """Return the point with a value on a day of November."""
    return replace(POINT, run=replace(POINT.run, began=f"2026-11-{day:02d}T00:00:00Z"), value=value, **changes)


def test_numbers_come_in_the_unit_of_the_newest_limit():
    """A value in mA, judged against A, is no jump; one that does not convert stands apart."""
    (found,) = trends([at(1, 1500.0, unit="mA", uncertainty=5.0, expanded=0.01), at(2, 1.6)])
    assert [point.value for point in found.points] == [1.5, 1.6]
    assert (found.unit, found.points[0].expanded) == ("A", 0.01)
    assert found.points[0].uncertainty == pytest.approx(0.005)
    older = at(1, 1.0, limit=Bounds(min=None, max="1500", equals=None), limit_unit="mA", expanded=200.0)
    (found,) = trends([older, at(2, 1.6)])
    assert (found.points[0].limit.max, found.points[0].expanded) == ("1.5", 0.2)
    assert len(trends([at(1, 5.0, unit="V", limit_unit="V"), at(2, 1.6)])) == 2


def test_a_limit_whose_unit_changed_leaves_two_series():
    """Differences in K and temperatures in degC are two tables, not one for each older check."""
    kelvin = [at(day, float(day), unit="K", limit_unit="K") for day in (1, 2, 3)]
    now = [at(day, 20.0, unit="degC", limit_unit="degC") for day in (4, 5)]
    assert [(each.unit, len(each.points)) for each in trends([*kelvin, *now])] == [("degC", 2), ("K", 3)]


def test_statistics_are_of_one_bench_and_end_where_their_uncertainty_does():
    """A simulated bench is not pooled with another one; a slope has its unit."""
    numbers = [at(day, value, unit="degC", limit_unit="degC") for day, value in ((1, 1.0), (2, 2.0), (3, 4.0))]
    here, there = (
        [replace(each, run=replace(each.run, dut="SN1", bench=bench, source="hardware")) for each in numbers]
        for bench in ("lab", "cleanroom")
    )
    (found,) = trends([*here, *there])
    assert list(_statistics(found)) == [
        "  SN1, bench lab: n = 3, mean 2.33, s 1.5",
        "    slope (1.5 ± 3.7) K per day, 95% interval",
        "  SN1, bench cleanroom: n = 3, mean 2.33, s 1.5",
        "    slope (1.5 ± 3.7) K per day, 95% interval",
    ]


def test_runs_of_one_day_have_no_slope():
    """A slope per day of what took minutes says nothing."""
    hours = ("08", "09", "23")
    runs = [replace(at(1, 1.0), run=replace(POINT.run, began=f"2026-11-01T{hour}:00:00Z")) for hour in hours]
    assert line(runs) is None


def test_a_slope_needs_three_moments_and_has_an_interval():
    """By hand: 1, 2, 4 over three days has slope 1.5, s^2 = 1/6, u = sqrt(1/12), and t(1) = 12.706."""
    assert line([at(1, 1.0), at(2, 2.0)]) is None
    assert line([at(1, 1.0), at(1, 2.0), at(2, 3.0)]) is None
    found = line([at(1, 1.0), at(2, 2.0), at(3, 4.0)])
    assert found.slope == pytest.approx(1.5)
    assert found.high - found.slope == pytest.approx(12.7062 / 12**0.5, rel=1e-5)
    assert found.low + found.high == pytest.approx(3.0)
    assert spread([1.0, 2.0, 4.0])[1:] == pytest.approx((7 / 3, (7 / 3) ** 0.5))
    assert spread([5.0]) == (1, 5.0, None)


@pytest.mark.system
def test_one_moment_is_drawn_over_one_day():
    """A date axis with a single date on it would be four years long."""
    from hil.cli.analyses.plots import _trend  # noqa: PLC0415 - the drawing library takes long to load

    (first, last) = _trend("rate_error", trends([at(1, 1.5)])).axes[0].get_xlim()
    assert last - first == pytest.approx(1.0)
