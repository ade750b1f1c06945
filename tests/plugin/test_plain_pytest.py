"""Plain pytest: a simulated bench where one is named, and nothing at all where none is."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
from told_as_json import bodies, results_as_json
from workspaces import DUT, ROOT, Ended, make

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

GOOD = """
@pytest.mark.requirement("T-030")
def test_one(field, record):
    record("field", field, duration=1.0, rate=40.0)


@pytest.mark.requirement("T-010")
def test_two(check):
    check("T-010", "ratio", 1.0)
"""
BENCH = ("testplans", "--bench", "adcs", "--dut", DUT)


ONLY_OURS = ("no:benchmark", "no:hypothesispytest", "no:timeout", "no:xdist")  # their import takes longer than a run


@pytest.fixture
def pytest_here(monkeypatch, capsys):
    """Return what runs pytest in a folder, in this process: for what a process of its own would show no better."""

    def run(folder, *arguments) -> Ended:
        for name in [name for name in os.environ if name.startswith("PYTEST_")]:
            monkeypatch.delenv(name)
        monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")
        monkeypatch.chdir(folder)
        plugins = ("-p", "no:cacheprovider", "-p", "hil.plugin.options")
        before = set(sys.modules)
        code = pytest.main([*plugins, *arguments])
        for name in set(sys.modules) - before:  # the next test's plan has a module of the same name
            if str(getattr(sys.modules[name], "__file__", None)).startswith(str(folder)):
                del sys.modules[name]
        return Ended(int(code), *capsys.readouterr())

    return run


def pytest_in(folder, *arguments) -> Ended:
    """Run pytest in a folder, in a process of its own, which finds our plugin by its entry point."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    without = [part for plugin in ("no:cacheprovider", *ONLY_OURS) for part in ("-p", plugin)]
    command = [sys.executable, "-m", "pytest", *without, *arguments]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=50, check=False)
    return Ended(done.returncode, done.stdout, done.stderr)


@pytest.mark.system
def test_plain_pytest_runs_a_plan_and_seals(tmp_path):
    """A named bench makes a run of an ordinary pytest, with a package at its end."""
    workspace = make(tmp_path / "workspace", GOOD)
    ended = pytest_in(workspace.root, *BENCH, "-v")
    (folder,) = workspace.folders()
    assert ended.code == 0, ended.out
    assert f"package: {folder}" in ended.out
    assert "test_one RECORDED" in ended.out
    assert verify(folder).ok
    assert bodies(Package(folder), "end")[0]["exit_code"] == 0


@pytest.mark.system
def test_plain_pytest_runs_the_plans_of_this_repository(capfd, monkeypatch):
    """Its own settings do not keep the plugin out; without an article it says which option is missing."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setattr(sys, "argv", ["pytest"])
    for name in [name for name in os.environ if name.startswith("PYTEST_")]:
        monkeypatch.delenv(name)
    code = pytest.main(["testplans/magnetorquer", "--bench", "adcs", "--collect-only", "-p", "no:cacheprovider"])
    said = capfd.readouterr()
    assert code == pytest.ExitCode.USAGE_ERROR
    assert "no device under test is named; add --dut SERIAL; fixtures/duts.yaml has SIM-ADCS-1, " in said.err


@pytest.mark.system
def test_plain_pytest_tells_verdicts_and_keeps_deselected_cases(tmp_path, pytest_here):
    """A case that pytest takes out was planned all the same, and the run is no pass."""
    workspace = make(tmp_path / "workspace", GOOD.replace('"ratio", 1.0', '"ratio", 9.0'))
    ended = pytest_here(workspace.root, *BENCH, "-k", "test_two")
    (folder,) = workspace.folders()
    results = results_as_json(Package(folder))
    assert ended.code == 1
    assert "T-010 ratio is FAIL" in ended.out
    assert (results["cases"][0]["verdict"], results["cases"][0]["reasons"]) == ("NOT_RUN", ["deselected"])
    assert results["cases"][1]["verdict"] == "FAIL"


@pytest.mark.system
def test_a_case_named_alone_leaves_the_others_of_its_plan_not_run(tmp_path, pytest_here):
    """A run of one case is no pass of its plan: all were planned, the run says so, and its package replays."""
    workspace = make(tmp_path / "workspace", GOOD)
    place = workspace.plan.relative_to(workspace.root) / "test_small.py"
    ended = pytest_here(workspace.root, f"{place}::test_two", *BENCH[1:])
    (folder,) = workspace.folders()
    results = results_as_json(Package(folder))
    assert ended.code == 1, ended.out
    assert "NOT_RUN  2 cases: 1 not run, 1 passed." in ended.out
    assert {case["case"].partition("::")[2]: case["verdict"] for case in results["cases"]} == {
        "test_one": "NOT_RUN",
        "test_two": "PASS",
    }
    assert results["verdict"] == "NOT_RUN"
    assert replay(Package(folder)).differences == ()


def test_plain_pytest_refuses_a_case_that_is_not_there(tmp_path, pytest_here):
    """A misspelt case is no run of nothing."""
    workspace = make(tmp_path / "workspace", GOOD)
    place = workspace.plan.relative_to(workspace.root) / "test_small.py"
    ended = pytest_here(workspace.root, f"{place}::test_tow", *BENCH[1:])
    assert ended.code == 4
    assert f"there is no case {place}::test_tow" in ended.out + ended.err
    assert workspace.folders() == []


def test_plain_pytest_refuses_a_root_that_names_cases_otherwise(tmp_path, pytest_here):
    """Cases of one plan have the same names in every run, or packages cannot be compared and replayed."""
    workspace = make(tmp_path / "workspace", GOOD)
    ended = pytest_here(workspace.root, *BENCH, "--rootdir", str(tmp_path))
    assert ended.code == 4
    assert f"give pytest --rootdir {workspace.root}" in ended.out + ended.err
    assert workspace.folders() == []


def test_plain_pytest_refuses_hardware(tmp_path, pytest_here):
    """What reaches out of the process needs `hil run`."""
    workspace = make(tmp_path / "workspace", GOOD)
    ended = pytest_here(workspace.root, *BENCH, "--source", "hardware")
    assert ended.code == 4
    assert "use hil run" in ended.err
    assert workspace.folders() == []


def test_plain_pytest_refuses_wrong_files_and_names(tmp_path, pytest_here):
    """What is wrong is a sentence and exit code 4, not a traceback."""
    workspace = make(tmp_path / "workspace", GOOD.replace("T-030", "T-03O"))
    ended = pytest_here(workspace.root, *BENCH)
    assert ended.code == 4
    assert "unknown requirement 'T-03O', did you mean 'T-030'?" in ended.out + ended.err
    ended = pytest_here(workspace.root, "testplans", "--bench", "adsc", "--dut", DUT)
    assert ended.code == 4
    assert "Traceback" not in ended.out + ended.err
    assert workspace.folders() == []


@pytest.mark.system
def test_an_unrelated_pytest_run_is_untouched(tmp_path, pytest_here):
    """Without a bench the plugin adds options and nothing else: no fixture, no marker, no import."""
    (tmp_path / "test_other.py").write_text(
        "import sys\n\n"
        "import pytest\n\n"
        "@pytest.fixture\ndef check():\n    return 'mine'\n\n"
        "def test_other(check):\n"
        "    assert check == 'mine'\n"
        "    assert not {name for name in sys.modules if name.startswith('hil.') and name != 'hil.plugin.options'} "
        "- {'hil.plugin'}\n\n"
        "def test_no_role(request):\n"
        "    with pytest.raises(pytest.FixtureLookupError):\n"
        "        request.getfixturevalue('supply')\n"
    )
    ended = pytest_in(tmp_path, "-c", os.devnull, "--rootdir", str(tmp_path), "test_other.py")
    assert ended.code == 0, ended.out
    assert "--bench" in pytest_here(tmp_path, "-c", os.devnull, "--help").out


def test_plain_pytest_tells_what_cannot_be_collected(tmp_path, pytest_here):
    """A broken module of a plan is told with its place, and is no error of the plugin."""
    workspace = make(tmp_path / "workspace", GOOD, "import nosuchthing")
    ended = pytest_here(workspace.root, *BENCH, "-ra")
    assert ended.code == 2
    assert "No module named 'nosuchthing'" in ended.out
    assert "INTERNALERROR" not in ended.out + ended.err
    assert workspace.folders() == []


def test_plain_pytest_refuses_a_conftest_around_the_plans(tmp_path, pytest_here):
    """Its hooks would take part in the verdicts here, too."""
    workspace = make(tmp_path / "workspace", GOOD)
    (workspace.plan.parent / "conftest.py").write_text(
        "def pytest_runtest_makereport(call):\n    call.excinfo = None\n"
    )
    ended = pytest_here(workspace.root, *BENCH)
    assert ended.code == 4
    assert "testplans/conftest.py: a conftest.py takes part in the verdicts" in ended.err
    assert workspace.folders() == []


def test_plain_pytest_tells_a_name_with_its_place(tmp_path, pytest_here):
    """A misspelt parameter is told before anything is armed."""
    workspace = make(tmp_path / "workspace", "def test_one(parameters):\n    parameters.curent")
    ended = pytest_here(workspace.root, *BENCH)
    assert ended.code == 4
    assert "test_small.py:9:5: the plan has no parameter 'curent', did you mean 'current'?" in ended.out + ended.err
    assert workspace.folders() == []
