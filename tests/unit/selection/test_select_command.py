"""`hil select` on sealed packages: what it prints and writes, what it leaves out, and what it refuses."""

from __future__ import annotations

import csv
import json
import shutil

import pytest
from evidence_runs import DUT, DUTS_FILE, begin, case_end, check, record, recorded_check, stamps, write_report
from typed_events import event_of

from hil.cli.main import main
from hil.documents.canonical import canonical
from hil.evidence.folder import JOURNAL
from hil.evidence.package.sealing import seal

_CRITERIA = """\
schema: hil/selection/1
title: Rate sensors
candidates:
  One: {roles: [gyroscope], duts: [SN1]}
  Two: {roles: [gyroscope], duts: [SN2]}
criteria:
  Smallest error: {parameter: rate_error, units: {gyroscope: deg/s}, axes: [x, y]}
"""


def said(capsys, *arguments):
    """Return exit code, output and errors of one command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    return left.value.code, told.out, told.err


def sealed(reports, day, value, serial, source="hardware", **doubt):
    """Seal a run of one case that measured an error of a unit."""
    folder = reports / f"run-{serial}-{day[-2:]}"
    dut = {**DUT, "serial": serial}
    files = {
        "data/dut.json": canonical({**dut, "format": 1}),
        "data/bench/duts.yaml": DUTS_FILE.replace("SN1", serial).encode(),
    }
    journal = begin(folder, stamp=stamps(day), source=source, dut=dut, files=files)
    journal.write(event_of("case", case="test_rest", attempt=1), 0.0)
    journal.write(event_of("step", case="test_rest", path=["Hold"], number="1"), 0.0)
    record(folder, journal)
    check(journal, value, of="x", **doubt)
    check(journal, value / 2, of="y")
    recorded_check(journal)
    journal.write(event_of("step-end", case="test_rest", path=["Hold"], number="1", outcome="done", duration=4.0), 4.0)
    verdict = "INCONCLUSIVE" if doubt else "PASS"
    case_end(journal, verdict)
    journal.write(event_of("safe-end", ok=True), 5.0)
    seal(folder, journal, exit_code=0, write_reports=write_report)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a workspace with a run of one unit, a simulated one of another, and one whose data are in doubt."""
    root = tmp_path_factory.mktemp("select")
    (root / "hil.toml").write_text("")
    (root / "criteria.yaml").write_text(_CRITERIA)
    sealed(root / "reports", "2026-11-01", 0.1, "SN1")
    sealed(root / "reports", "2026-11-02", 0.3, "SN2", "simulated")
    doubt = {"doubts": ["stuck of x: one value throughout"], "verdict": "INCONCLUSIVE", "reason": "stuck of x"}
    sealed(root / "reports", "2026-11-03", 0.01, "SN2", **doubt)
    return root


@pytest.fixture
def workspace(runs, tmp_path, monkeypatch):
    """Go to a copy of the workspace, to write to and to damage."""
    own = shutil.copytree(runs, tmp_path / "workspace")
    monkeypatch.chdir(own)
    return own


def test_all_packages_of_a_workspace_take_part(capsys, workspace):
    """Who is best, how surely, and that one package is simulated; a figure in doubt makes nobody better.

    The other axis of that run counts, and its two runs differ by far more than they know.
    """
    code, out, err = said(capsys, "select", "criteria.yaml")
    assert (code, err) == (0, "")
    assert out.splitlines() == [
        "SIMULATED: 1 of 3 packages that count is simulated; this says nothing about real sensors",
        "gyroscope:",
        "  Smallest error  One  (0.100 ± 0.020) deg/s  100.0%",
        "  overall: One 100%, Two 0%",
        "  Smallest error: By the mean of the axes it would be One or Two",
        "1 did not count; --format html --output DIR lists each with its reason",
    ]


def test_what_is_not_given_is_said_and_its_candidate_is_not_judged(capsys, workspace):
    """Whoever leaves a package out is told which, and the exit code says that the table has a gap."""
    code, out, _ = said(capsys, "select", "criteria.yaml", "run-SN1-01", "run-SN2-03", "--format", "json")
    document = json.loads(out)
    assert code == 1
    assert "Not given, though it has such figures: run-SN2-02" in document["warnings"]
    (cell,) = document["cells"]
    assert cell["unjudged"] == [
        {"candidate": "Two", "reasons": ["x: its data are in DOUBT: stuck of x: one value throughout"]}
    ]
    assert [package["digest"] != "" for package in document["packages"]] == [True, True]


def test_files_are_the_same_bytes_for_any_order(capsys, workspace):
    """The page needs no network and no script; a line of the CSV is a rank, an axis or an exclusion."""
    for names in (("run-SN1-01", "run-SN2-02"), ("run-SN2-02", "run-SN1-01")):
        arguments = [text for form in ("html", "csv", "json") for text in ("--format", form)]
        assert said(capsys, "select", "criteria.yaml", *names, *arguments, "--output", names[0])[0] == 0
    first, second = ({each.name: each.read_bytes() for each in (workspace / name).iterdir()} for name in names)
    assert first == second
    page = first["selection.html"].decode()
    assert page.index("SIMULATED") < page.index("<table") < page.index("Smallest error")
    assert "http" not in page.replace("http-equiv", "")
    assert "<script" not in page
    rows = list(csv.DictReader(first["selection.csv"].decode().splitlines()))
    assert [(row["line"], row["candidate"], row["value"]) for row in rows if row["line"] in {"ranked", "axis"}] == [
        ("ranked", "One", "0.1"), ("axis", "One", "0.1"), ("axis", "One", "0.05"),
        ("ranked", "Two", "0.3"), ("axis", "Two", "0.3"), ("axis", "Two", "0.15"),
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("arguments", "answer"),
    [
        (("nothing.yaml",), "nothing.yaml"),
        (("criteria.yaml", "run-SN1-07"), "there is no run 'run-SN1-07', did you mean 'run-SN1-01'?"),
        (("criteria.yaml", "--format", "html", "--format", "csv"), "cannot go to standard output together"),
        (("criteria.yaml", "--format", "pdf"), "'pdf'"),
    ],
)
def test_what_cannot_be_done_is_refused(capsys, workspace, arguments, answer):
    """With exit code 4 and the nearest thing that there is."""
    code, _, err = said(capsys, "select", *arguments)
    assert (code, answer in err) == (4, True)


def test_a_package_that_is_damaged_or_gone_is_told(capsys, workspace):
    """The one stays in the list, without a digest; the other is in the ledger of the workspace."""
    (workspace / "reports/run-SN2-03").rename(workspace / "elsewhere")
    journal = workspace / "reports/run-SN2-02" / JOURNAL
    journal.chmod(0o644)
    journal.write_bytes(journal.read_bytes()[:-1])
    code, out, _ = said(capsys, "select", "criteria.yaml", "--format", "json")
    document = json.loads(out)
    assert (code, document["cells"][0]["best"]) == (1, ["One"])
    (damaged,) = [each for each in document["excluded"] if each["what"] == "the whole package"]
    assert (damaged["run"], damaged["reason"].startswith("it does not verify: ")) == ("run-SN2-02", True)
    assert "The ledger names runs that are missing here and may have such figures: run-SN2-03" in document["warnings"]
    assert "These do not count, as they fail verification: run-SN2-02" in document["warnings"]
