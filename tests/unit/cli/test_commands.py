"""A walk over every command: its help, its mistakes, and what it says of runs."""

from __future__ import annotations

import shutil
import signal
from dataclasses import replace
from pathlib import Path

import click
import pytest
from workspaces import ROOT, make

from hil.cli.main import COMMANDS, cli, main
from hil.evidence.ledger import packages
from hil.evidence.ledger.book import ledger_file, read
from hil.evidence.ledger.entries import Replayed
from hil.evidence.package import verification
from hil.executive.setup.pins import PINNED
from hil.model.errors import EvidenceError

GOOD = """
@pytest.mark.requirement("T-010")
def test_one(check, supply, step):
    with step("Look at the voltage"):
        supply.coil.voltage()
    check("T-010", "ratio", 1.0)
"""


def walk(command=cli, path=()):
    """Yield every command that does something, with its path."""
    if isinstance(command, click.Group):
        context = click.Context(command)
        for name in command.list_commands(context):
            yield from walk(command.get_command(context, name), (*path, name))
    else:
        yield path


PATHS = list(walk())


def said(capsys, *arguments):
    """Return exit code, output and errors of one command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    return left.value.code, told.out, told.err


@pytest.mark.parametrize("path", PATHS, ids=" ".join)
def test_every_command_has_help_with_an_example(capsys, path):
    """What it does, and one line that can be typed."""
    code, out, _ = said(capsys, *path, "--help")
    assert code == 0
    assert f"Usage: hil {' '.join(path)}" in out
    assert "Example" in out
    assert f"hil {' '.join(path)} " in " ".join(out.partition("Example")[2].split()) + " "


def test_help_lists_every_command(capsys):
    """Each with its line, and none of them loaded for it."""
    _, out, _ = said(capsys, "--help")
    for name, line in COMMANDS.items():
        assert f"{name} " in out
        assert line in out


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("rnu",), "there is no command 'rnu', did you mean 'run'?"),
        (("verfy", "x"), "did you mean 'verify'?"),
        (("bench", "chek", "adcs"), "'check'"),
        (("run", "--bnech", "x"), "'--bench'"),
        (("run", "small"), "--bench"),
        (("run", "p", "--bench", "b", "--dut", "d", "--source", "real"), "'simulated'"),
        (("verify",), "RUN"),
        (("run", "p", "--bench", "b", "--dut", "d", "--answers", "nowhere.yaml"), "nowhere.yaml"),
    ],
)
def test_a_mistake_is_a_sentence_and_exit_code_4(capsys, arguments, message):
    """Wrong commands and options name the nearest, and what is missing."""
    code, _, err = said(capsys, *arguments)
    assert code == 4
    assert message in err


@pytest.mark.parametrize(
    "arguments",
    [
        ("bench", "check", "battery"),
        ("bench", "safe", "battery"),
        pytest.param(("run", "battery_charge", "--bench", "battery", "--dut", "SIM-BAT-1"), marks=pytest.mark.system),
    ],
    ids=" ".join,
)
def test_a_server_that_has_ended_is_told_with_how_to_start_it_again(tmp_path, monkeypatch, capfd, arguments):
    """Its folder has gone with it, and nothing is begun."""
    monkeypatch.chdir(ROOT)
    code, out, err = said(capfd, *arguments, "--source", "simulated", "--served", str(tmp_path / "gone"))
    assert (code, out) == (4, "")
    assert "gone: the folder does not exist; its server has ended, or you meant another folder" in err
    assert f"start it again with: hil simulate battery --folder {tmp_path / 'gone'}" in err


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    """A workspace with one sealed run."""
    workspace = make(tmp_path_factory.mktemp("cli") / "workspace", GOOD)
    return workspace, workspace.run().package.name


@pytest.fixture
def inside(ran, monkeypatch):
    """Be in that workspace, and return the run's name."""
    workspace, name = ran
    monkeypatch.chdir(workspace.root)
    return name


@pytest.mark.parametrize(
    "arguments",
    [
        ("status", "nothing"),
        ("verify", "nothing"),
        ("report", "nothing"),
        ("seal", "nothing"),
        ("note", "nothing", "text"),
        ("stop", "nothing"),
    ],
    ids=lambda arguments: arguments[0],
)
@pytest.mark.usefixtures("inside")
def test_a_run_that_does_not_exist_is_told(capsys, arguments):
    """Every command that names a run says where the runs are listed."""
    code, _, err = said(capsys, *arguments)
    assert (code, err) == (4, "hil: there is no run 'nothing'\n     hil runs lists the runs\n")


def test_outside_of_a_workspace_there_is_a_way_in(capsys, tmp_path, monkeypatch):
    """Commands that need a workspace say how to make one."""
    monkeypatch.chdir(tmp_path)
    for arguments in (("runs",), ("status", "x"), ("bench", "check", "adcs")):
        code, _, err = said(capsys, *arguments)
        assert code == 4
        assert "put a hil.toml" in err


def test_runs_status_and_verify_say_the_same(capsys, inside):
    """A sealed run is listed, shown and verified by a part of its name."""
    _, out, _ = said(capsys, "runs")
    assert inside in out
    assert "SEALED" in out
    assert "PASS" in out
    code, out, _ = said(capsys, "status", inside[:-3])
    assert code == 0
    assert {"state       SEALED", "cases       1 of 1 ended", "verdict     PASS"} <= set(out.splitlines())
    code, out, err = said(capsys, "verify", f"reports/{inside}")
    assert (code, err) == (0, "")
    assert out.startswith(f"{inside}: SEALED\nverdict          PASS, SIMULATED\n")


def test_verify_tells_what_a_verdict_is_worth(capsys, inside, tmp_path, monkeypatch):
    """A folder of another name is told with the run's own, and a run that deviates beside its verdict."""
    copy = tmp_path / "FM-7-acceptance"
    shutil.copytree(Path("reports") / inside, copy)
    code, out, err = said(capsys, "verify", str(copy))
    assert (code, err) == (0, "")
    assert f"FM-7-acceptance: SEALED\nrun              {inside}, in a folder of another name\nverdict" in out
    found = replace(verification.verify(copy), source="hardware", deviates=True)
    monkeypatch.setattr(verification, "verify", lambda _: found)
    assert "verdict          PASS, deviates\n" in said(capsys, "verify", str(copy))[1]


def test_report_derives_the_same_bytes(capsys, inside):
    """The reports in the package are those that its data give."""
    code, out, _ = said(capsys, "report", inside)
    assert code == 0
    assert out.count("identical to the one in the package") == 2


def test_a_sealed_run_takes_nothing(capsys, inside, tmp_path):
    """Notes, files and stops are for runs that go on."""
    (tmp_path / "photo.jpg").touch()
    for arguments in (("note", inside, "x"), ("stop", inside), ("attach", inside, str(tmp_path / "photo.jpg"))):
        code, _, err = said(capsys, *arguments)
        assert code == 4
        assert f"{inside} is sealed" in err


def test_a_name_that_could_be_two_runs_is_told(capsys, inside, ran):
    """Both are named, and neither is taken."""
    other = ran[0].reports / f"{inside}-copy/data"
    other.mkdir(parents=True)
    code, _, err = said(capsys, "status", inside[:8])
    other.rmdir()
    other.parent.rmdir()
    assert code == 4
    assert f"could be {inside}, {inside}-copy" in err


@pytest.mark.usefixtures("inside")
def test_bench_check_and_safe_look_at_the_simulated_bench(capsys):
    """The gates are shown one by one; without --energise nothing is driven."""
    code, out, _ = said(capsys, "bench", "check", "adcs", "--source", "simulated")
    assert code == 0
    assert "identity of psu1" in out
    assert "reduced level" not in out
    code, out, _ = said(capsys, "bench", "check", "adcs", "--source", "simulated", "--energise")
    assert code == 0
    assert out.splitlines()[-1] == "ready"
    assert "reduced level of supply.coil" in out
    code, out, _ = said(capsys, "bench", "safe", "adcs", "--source", "simulated")
    assert code == 0
    assert out.count("safe ") >= 3


@pytest.mark.usefixtures("inside")
def test_bench_check_tells_every_port_that_is_not_there(capsys):
    """A bench that is not as its file says is a gate that does not hold, and no wrong call."""
    code, out, err = said(capsys, "bench", "check", "adcs")
    assert (code, err) == (1, "")
    told = out.splitlines()
    ports = [line for line in told if line.startswith("NOT OK  port of ")]
    buses = [line for line in told if line.startswith("NOT OK  bus ")]
    assert all(" is not there" in line for line in ports)
    assert all(" cannot be opened: " in line for line in buses)
    assert told == [*ports, *buses, "not ready"]


SAME = "1 case with 1 check replayed from their bytes: no difference"
SMALL = ("small", "--bench", "adcs", "--dut", "SIM-ADCS-1")


@pytest.mark.system
def test_plan_prints_the_procedure(ran):
    """Steps and what they do are printed, and no package is kept."""
    workspace, name = ran
    ended = workspace.hil("plan", *SMALL)
    assert (ended.code, ended.err) == (0, "")
    assert "Look at the voltage" in ended.out
    assert [folder.name for folder in workspace.folders()] == [name]


@pytest.mark.system
def test_plan_leaves_cases_out_as_a_run_does(ran):
    """A skipped case is named with its reason among the deviations, and is not run."""
    workspace, name = ran
    case = next(line.split()[-1] for line in workspace.hil("plan", *SMALL).out.splitlines() if line.startswith("[1/"))
    ended = workspace.hil("plan", *SMALL, "--skip", case, "--reason", "no board today")
    assert (ended.code, ended.err) == (0, "")
    assert f"deviation      case {case} is skipped: no board today" in ended.out
    assert "not run: " in ended.out
    assert "Look at the voltage" not in ended.out.split("[1/")[1].split("\n", 2)[2]
    assert [folder.name for folder in workspace.folders()] == [name]


@pytest.mark.system
def test_replay_says_how_much_it_compared(ran):
    """A package that is whole replays to the same."""
    workspace, name = ran
    ended = workspace.hil("replay", name)
    told, entered = ended.out.splitlines()
    assert (ended.code, ended.err, told) == (0, "", SAME)
    assert entered.startswith("in the ledger as line ")
    assert isinstance(read(workspace.reports).entries[int(entered.split()[-1]) - 1], Replayed)


def test_replay_enters_nothing_where_it_may_not_write_and_says_so(capsys, inside, monkeypatch):
    """An auditor who may only read gets the same answer; that it was not entered is told beside it."""
    for name, value in PINNED.items():
        monkeypatch.setenv(name, value)
    before = ledger_file(Path("reports")).read_bytes()

    def refuse(reports, *_):
        raise EvidenceError(f"{reports.name}: the ledger cannot be written: Permission denied", "make it writable")

    monkeypatch.setattr(packages, "append_once", refuse)
    code, out, err = said(capsys, "replay", inside)
    assert (code, out) == (0, f"{SAME}\n")
    assert (
        err == "not entered in the ledger: reports: the ledger cannot be written: Permission denied; make it writable\n"
    )
    assert ledger_file(Path("reports")).read_bytes() == before


def test_ctrl_c_before_the_first_word_leaves_no_traceback(capsys, monkeypatch):
    """Where signals are let through for the first time, one that waited ends the command with code 130."""
    install = signal.signal

    def at_once(number, handler):
        before = install(number, handler)
        if handler is signal.default_int_handler:
            signal.raise_signal(number)
        return before

    before = install(signal.SIGINT, signal.SIG_DFL)
    monkeypatch.setattr(signal, "signal", at_once)
    try:
        with pytest.raises(SystemExit) as ended:
            main(["runs"])
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    finally:
        install(signal.SIGINT, before)
    assert ended.value.code == 130
    assert capsys.readouterr() == ("", "")


def test_an_error_of_hil_is_told_apart(capsys, monkeypatch):
    """What nobody can mend but us has its own exit code, and keeps its traceback."""

    def broken():
        raise ZeroDivisionError

    monkeypatch.setattr("hil.cli.run_names.reports_folder", broken)
    with pytest.raises(SystemExit) as left:
        main(["status", "x"])
    assert left.value.code == 3
    err = capsys.readouterr().err
    assert "ZeroDivisionError" in err
    assert "this is a bug in hil" in err
