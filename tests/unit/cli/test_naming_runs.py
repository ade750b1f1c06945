"""How a person names a run, what is told of it, and what is told of a package that is not whole."""

from __future__ import annotations

import json
import os
import shutil

import pytest
from evidence_runs import begin, sealed_run, whole_case

from hil.cli.commands import runs as runs_command
from hil.cli.main import main
from hil.evidence.folder import hold
from hil.evidence.package.contents import Package

FIRST = "20261119T100000Z-flight-SN1-aaaaaa"
SECOND = "20261120T100000Z-flight-SN1-bbbbbb"
NEWEST = "20261121T100000Z-adcs-SN2-abcdef"


@pytest.fixture(scope="module")
def reports(tmp_path_factory):
    """A workspace's reports with three sealed runs."""
    root = tmp_path_factory.mktemp("naming")
    (root / "hil.toml").write_text("")
    for name, changes in (
        (FIRST, {}),
        (SECOND, {"plans": ["battery"]}),
        (NEWEST, {"bench": "adcs", "source": "simulated", "dut": {"serial": "SN2"}}),
    ):
        sealed_run(root / "reports" / name, **changes)
    return root / "reports"


@pytest.fixture
def inside(reports, tmp_path, monkeypatch):
    """Be in a writable copy of that workspace; every run began when its name says."""
    shutil.copytree(reports.parent, tmp_path / "w", copy_function=shutil.copyfile)
    for path in (tmp_path / "w").rglob("*"):
        path.chmod(0o755)
    monkeypatch.chdir(tmp_path / "w")
    monkeypatch.setattr("hil.cli.commands.replay.pin", lambda: None)  # it would restart this process
    monkeypatch.setattr("hil.evidence.runs._began", lambda folder: folder.name[:16])
    return tmp_path / "w/reports"


def said(capsys, *arguments):
    """Return exit code, output and errors of one command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    return left.value.code, told.out, told.err


@pytest.mark.parametrize(
    ("asked", "meant"),
    [
        (FIRST, FIRST),
        ("20261120", SECOND),
        ("bbbbbb", SECOND),
        ("latest", NEWEST),
        (f"reports/{FIRST}", FIRST),
        (f"reports/{FIRST}/", FIRST),
        (f"{FIRST}/", FIRST),
    ],
)
@pytest.mark.usefixtures("inside")
def test_a_run_is_named_by_path_name_beginning_short_id_or_latest(capsys, asked, meant):
    """Each way leads to one run."""
    _, out, _ = said(capsys, "verify", asked)
    assert out.splitlines()[0].partition(": ")[0] == meant


@pytest.mark.parametrize("command", ["verify", "status", "report"])
@pytest.mark.usefixtures("inside")
def test_latest_is_known_to_every_command(capsys, command):
    """The newest run is the one that a person means most often."""
    code, _, err = said(capsys, command, "latest")
    assert "there is no run" not in err
    assert code in {0, 1}


@pytest.mark.parametrize("asked", ["", "  ", "flight", "SN1", "-", "Z-flight"])
@pytest.mark.usefixtures("inside")
def test_any_other_part_of_a_name_is_nobody(capsys, asked):
    """Neither nothing nor a piece from the middle picks a run."""
    code, _, err = said(capsys, "verify", "--", asked)
    assert code == 4
    assert "names no run" in err or "there is no run" in err


@pytest.mark.usefixtures("inside")
def test_a_beginning_of_several_lists_them(capsys):
    """All of them are named, and none is taken."""
    code, _, err = said(capsys, "verify", "2026")
    assert code == 4
    assert f"'2026' could be {FIRST}, {SECOND}, {NEWEST}" in err


def test_latest_without_runs_says_how_to_get_one(capsys, tmp_path, monkeypatch):
    """A fresh workspace has no newest run."""
    (tmp_path / "hil.toml").write_text("")
    monkeypatch.chdir(tmp_path)
    code, _, err = said(capsys, "status", "latest")
    assert (code, err) == (4, "hil: there is no run yet\n     hil run starts one\n")


def test_a_run_that_cannot_be_read_is_listed_with_the_others(capsys, inside):
    """Its problem stands below it, and the list goes on; the newest is last."""
    (inside / SECOND / "data/journal.jsonl").write_bytes(b"\xff\xfe nonsense\n")
    code, out, _ = said(capsys, "runs")
    lines = out.splitlines()
    assert code == 0
    assert [line.split()[0] for line in lines] == [FIRST, SECOND, "data/journal.jsonl:", NEWEST]
    assert "DAMAGED" in lines[1]
    assert lines[3].split()[1:] == ["SEALED", "1/1", "cases", "PASS", "simulated", "qualification", "SN2"]


def test_a_verdict_of_a_run_that_deviates_is_marked(capsys, tmp_path, monkeypatch):
    """A PASS with changed parameters does not look like one of the plan."""
    (tmp_path / "hil.toml").touch()
    for name, deviations in ((FIRST, []), (SECOND, ["parameter current is 1 A instead of 2 A"])):
        sealed_run(tmp_path / "reports" / name, deviations=deviations)
    monkeypatch.chdir(tmp_path)
    lines = said(capsys, "runs")[1].splitlines()
    found = {line.split()[0]: " ".join(line.split()[4:6]) for line in lines}
    assert found == {FIRST: "PASS hardware", SECOND: "PASS, deviates"}


@pytest.mark.parametrize(
    ("options", "found"),
    [
        (("--bench", "flight"), [FIRST, SECOND]),
        (("--dut", "SN2"), [NEWEST]),
        (("--plan", "gyro"), [FIRST, NEWEST]),
        (("--verdict", "pass", "--bench", "adcs"), [NEWEST]),
        (("--verdict", "FAIL"), ["no"]),
    ],
)
@pytest.mark.usefixtures("inside")
def test_runs_are_chosen_by_what_they_say(capsys, options, found):
    """Bench, article, plan and verdict, alone or together."""
    code, out, _ = said(capsys, "runs", *options)
    assert (code, [line.split()[0] for line in out.splitlines()]) == (0, found)


@pytest.mark.usefixtures("inside")
def test_a_verdict_that_there_is_not_is_refused(capsys):
    """A misspelt verdict finds nothing for ever; the known ones are named."""
    code, out, err = said(capsys, "runs", "--verdict", "pas")
    assert (code, out) == (4, "")
    assert "there is no verdict 'pas', did you mean 'PASS'?" in err
    assert "NOT_EVALUATED" in err


@pytest.mark.usefixtures("inside")
def test_a_choice_that_no_run_meets_says_what_there_is(capsys):
    """Benches, articles and plans of the runs are listed for the choice that found none."""
    _, out, _ = said(capsys, "runs", "--bench", "adsc", "--dut", "SN2")
    assert out == "no matching runs\n  no run has --bench adsc; known: adcs, flight\n"


@pytest.mark.usefixtures("inside")
def test_sealing_twice_changes_nothing_and_says_so(capsys):
    """A sealed package gives its digest and path again, after a word that it was sealed already."""
    code, out, _ = said(capsys, "seal", FIRST)
    lines = out.splitlines()
    assert (code, lines[0], lines[-1]) == (
        0,
        f"{FIRST} is already sealed, and stays as it is",
        f"reports/{FIRST}",
    )


@pytest.mark.usefixtures("inside")
def test_a_narrow_terminal_gets_two_lines_per_run(capsys, monkeypatch):
    """No line is broken within a column."""
    monkeypatch.setattr(runs_command, "_width", lambda: 80)
    _, out, _ = said(capsys, "runs", "--bench", "adcs")
    assert out.splitlines() == [NEWEST, "  SEALED  1/1 cases  PASS  simulated  qualification  SN2"]


def test_a_damaged_package_shows_no_digest(capsys, inside):
    """What was found and the state, and nothing that could be copied into a paper."""
    (inside / FIRST / "data/dut.json").write_bytes(b"{}")
    code, out, err = said(capsys, "verify", FIRST)
    assert (code, out) == (1, f"{FIRST}: DAMAGED\n")
    assert "data/dut.json: it is not what was frozen before the first step" in err


@pytest.mark.parametrize("command", ["verify", "report", "replay"])
def test_a_package_of_another_format_is_told_in_one_sentence(capsys, inside, command):
    """Which format it has, which this version reads, and what to use."""
    sealed_run(inside / "other", format=2)
    code, _, err = said(capsys, command, "other")
    assert code == (1 if command == "verify" else 4)
    assert "the package has format 2, and this version of hil reads format 1" in err


def test_a_run_that_goes_on_is_running(capsys, inside):
    """Half a line at the end of its journal is no damage while it is being written."""
    with begin(inside / "going") as journal, hold(inside / "going"):
        whole_case(inside / "going", journal)
        with (inside / "going/data/journal.jsonl").open("ab") as stream:
            stream.write(b'{"body":')
        code, out, err = said(capsys, "verify", "going")
    assert (code, out, err) == (1, "going: RUNNING\n", "bagit.txt: the run is still running\n")


@pytest.mark.parametrize("name", ["a\nb", "a\x1b[2Jb", os.fsdecode(b"a\xff")])
@pytest.mark.parametrize("command", ["verify", "status", "report", "runs"])
def test_odd_names_of_packages_are_printed_harmlessly(capsys, inside, name, command):
    """No name moves the cursor, or ends a command."""
    (inside / FIRST).rename(inside / name)
    code, out, err = said(capsys, *([command] if command == "runs" else [command, f"reports/{name}"]))
    assert code in {0, 1, 4}
    assert name not in out + err


def test_nothing_special_is_opened_by_any_command(capsys, inside):
    """A pipe for a journal ends every command with words, at once."""
    path = inside / FIRST / "data/journal.jsonl"
    path.unlink()
    os.mkfifo(path)
    for command, due in (("verify", 1), ("status", 1), ("report", 4), ("replay", 4), ("seal", 1)):
        assert said(capsys, command, FIRST)[0] == due, command
    assert said(capsys, "runs")[0] == 0


def test_what_to_type_for_a_damaged_package_elsewhere_names_its_path(capsys, inside, tmp_path):
    """The name alone leads to no run where the package lies outside of the workspace."""
    elsewhere = shutil.move(inside / FIRST, tmp_path / "elsewhere")
    (elsewhere / "data/report/report.html").write_text("x")
    assert f"hil verify {elsewhere} shows everything that is wrong" in said(capsys, "report", str(elsewhere))[2]


def test_no_command_gives_a_damaged_package_a_verdict(capsys, inside):
    """One changed byte of a recording: whoever reads all of it says DAMAGED, gives no digest, and ends with 1."""
    path = next((inside / FIRST / "data/recordings").iterdir())
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    digest = Package(inside / FIRST).evidence_digest
    for command in ("verify", "status", "report", "seal"):
        code, out, err = said(capsys, command, FIRST)
        assert (code, "DAMAGED" in out + err, path.name in out + err) == (1, True, True), command
        assert "PASS" not in out + err
        assert digest not in out + err
    assert "verdict  -\n" in said(capsys, "status", FIRST)[1]
    (listed,) = [line for line in said(capsys, "runs")[1].splitlines() if line.startswith(FIRST)]
    assert listed.split()[1:5] == ["SEALED", "1/1", "cases", "PASS"]  # it does not claim to have read recordings
    assert "reads everything" in said(capsys, "runs")[2]
    path.unlink()
    (listed,) = [line for line in said(capsys, "runs")[1].splitlines() if line.startswith(FIRST)]
    assert listed.split()[1:4] == ["DAMAGED", "-", "-"]
    code, out, _ = said(capsys, "status", FIRST, "--json")
    assert (code, json.loads(out)["verdict"]) == (1, "")
    assert "DAMAGED" in said(capsys, "status", FIRST, "--follow")[1]
