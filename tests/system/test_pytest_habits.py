"""What people are used to from pytest: options and well-known plugins work with plans, or are refused in a sentence."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace

import pytest
from told_as_json import bodies, results_as_json
from workspaces import DUT, Ended, make

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = pytest.mark.system

PLAN = """
from waveform import RATIO


@pytest.fixture
def powered(supply):
    supply.coil.configure(1.0, 0.01)
    supply.coil.enable()
    yield supply.coil
    supply.coil.disable()


@pytest.mark.requirement("T-030")
def test_one(field, record):
    record("field", field, duration=1.0, rate=40.0)


@pytest.mark.requirement("T-010")
def test_two(check, powered):
    check("T-010", "ratio", RATIO)


@pytest.mark.requirement("T-010")
def test_three(check, record, field):
    record("field", field, duration=1.0, rate=40.0)
    check("T-010", "ratio", RATIO)
"""
ON = ("testplans", "--bench", "adcs", "--dut", DUT)
OTHERS = ("benchmark", "hypothesispytest", "timeout", "xdist", "randomly", "repeat", "rerunfailures", "pytest_cov")


def with_plugins(folder, *arguments, plugins=(), given="") -> Ended:
    """Run pytest in a folder, with its own plugins, ours and these."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTEST_")}
    without = [part for plugin in OTHERS if plugin not in plugins for part in ("-p", f"no:{plugin}")]
    command = [sys.executable, "-m", "pytest", *without, *arguments]
    done = subprocess.run(
        command, cwd=folder, env=environment, input=given, capture_output=True, text=True, timeout=100, check=False
    )
    return Ended(done.returncode, done.stdout, done.stderr)


def workspace_with(folder, source=PLAN, ratio="1.0"):
    """Return a workspace with a plan and a module beside its cases."""
    workspace = make(folder, source)
    (workspace.plan / "waveform.py").write_text(f"RATIO = {ratio}\n", encoding="utf-8")
    return workspace


def newest(workspace) -> Package:
    """Return the package of the run that began last."""
    return Package(max(workspace.folders(), key=lambda folder: folder.stat().st_mtime_ns))


def verdicts(package) -> dict[str, str]:
    """Return the verdict of every case by its own name."""
    return {case["case"].rpartition("::")[2]: case["verdict"] for case in results_as_json(package)["cases"]}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory):
    """A workspace with a plan of three cases and a module beside them."""
    return workspace_with(tmp_path_factory.mktemp("habits") / "workspace")


@pytest.fixture(scope="module")
def digest(workspace):
    """The evidence digest of the plan under plain pytest without any other plugin."""
    ended = with_plugins(workspace.root, *ON)
    assert ended.code == 0, ended.out + ended.err
    assert "hil:" not in ended.out
    return newest(workspace).content_digest


@pytest.mark.parametrize(
    ("plugin", "options", "told"),
    [
        ("randomly", ("-p", "randomly", "-p", "no:cacheprovider", "--randomly-seed=1"), "in the order of their plan"),
        ("pytest_cov", ("--cov=fixtures", "--cov-report=term"), "tests coverage"),
        ("rerunfailures", (), ""),
        ("repeat", ("--count", "1"), ""),
        ("xdist", ("-n", "0"), ""),
        ("", ("--ff", "--nf"), ""),
    ],
)
def test_plugins_and_options_that_change_no_evidence_work(workspace, digest, plugin, options, told):
    """A shuffled order is put right and told, coverage is measured: the evidence is the same to the last digit."""
    ended = with_plugins(workspace.root, *ON, *options, plugins=(plugin,))
    assert ended.code == 0, ended.out + ended.err
    assert told in ended.out
    assert newest(workspace).content_digest == digest


@pytest.mark.parametrize(
    ("plugin", "options", "told"),
    [
        ("repeat", ("--count", "2"), "pytest-repeat: a case has one verdict in a run"),
        ("rerunfailures", ("--reruns", "1"), "pytest-rerunfailures: a case has one verdict in a run"),
        ("rerunfailures", ("-o", "reruns=1"), "pytest-rerunfailures: a case has one verdict in a run"),
        ("xdist", ("-n", "2"), "pytest-xdist: a bench has one executive"),
        ("xdist", ("--dist", "load", "--tx", "popen"), "pytest-xdist: a bench has one executive"),
    ],
)
def test_what_would_repeat_or_distribute_cases_is_refused(workspace, plugin, options, told):
    """One sentence and exit code 4, and no run."""
    before = workspace.folders()
    ended = with_plugins(workspace.root, *ON, *options, plugins=(plugin,))
    assert ended.code == 4, ended.out
    assert told in ended.err
    assert workspace.folders() == before


def test_markers_that_would_repeat_a_case_are_refused(tmp_path):
    """They are told with their place, as `hil run` does."""
    marked = PLAN.replace("def test_two", "@pytest.mark.flaky(reruns=2)\n@pytest.mark.repeat(2)\ndef test_two")
    workspace = workspace_with(tmp_path / "workspace", marked)
    ended = with_plugins(workspace.root, *ON, plugins=("repeat", "rerunfailures"))
    assert ended.code == 4
    assert "unknown marker 'flaky'" in ended.out + ended.err
    assert "unknown marker 'repeat', did you mean 'repeatable'?" in ended.out + ended.err
    assert workspace.folders() == []


def test_no_plugin_and_no_variable_reaches_hil_run(workspace, digest):
    """With everything installed and asked for, `hil run` makes the same evidence as plain pytest alone."""
    asked = {"PYTEST_ADDOPTS": "-p randomly -p repeat --count 2", "PYTEST_PLUGINS": "pytest_repeat"}
    ended = replace(workspace, environment={**workspace.environment, **asked}).hil(*workspace.run_arguments)
    assert ended.code == 0, ended.out + ended.err
    assert newest(workspace).content_digest == digest


def test_the_last_failed_case_runs_alone(tmp_path):
    """`--lf` takes the others out after they were planned; the run is no pass although the case passes now."""
    workspace = workspace_with(tmp_path / "workspace", ratio="9.0")
    assert with_plugins(workspace.root, *ON, "--deselect", "testplans/small/test_small.py::test_three").code == 1
    (workspace.plan / "waveform.py").write_text("RATIO = 1.0\n", encoding="utf-8")
    ended = with_plugins(workspace.root, *ON, "--lf")
    assert "looks like a case" not in ended.out + ended.err
    assert verdicts(newest(workspace)) == {"test_one": "NOT_RUN", "test_two": "PASS", "test_three": "NOT_RUN"}
    assert ended.code == 1


def test_a_debugger_that_is_left_ends_the_run_safely(tmp_path):
    """`q` tears the fixtures down before the seal: the package verifies, and holds what the teardown did."""
    workspace = workspace_with(tmp_path / "workspace", PLAN.replace("RATIO)\n\n", "RATIO)\n    assert False\n\n", 1))
    ended = with_plugins(workspace.root, *ON, "--pdb", given="q\n")
    assert "(Pdb)" in ended.out
    assert "closed file" not in ended.out + ended.err
    package = newest(workspace)
    assert verify(package.folder).ok
    assert verdicts(package) == {"test_one": "RECORDED", "test_two": "ERROR", "test_three": "NOT_RUN"}
    assert "supply.coil.disable" in [effect["name"] for effect in bodies(package, "effect")]


def test_a_breakpoint_stops_plain_pytest_and_is_refused_by_hil_run(tmp_path):
    """On the simulated bench of plain pytest a debugger disturbs nobody; `hil run` says where to debug."""
    source = "import pdb\n\n\ndef test_one():\n    breakpoint()\n\n\ndef test_two():\n    pdb.set_trace()\n"
    workspace = make(tmp_path / "workspace", source)
    ended = with_plugins(workspace.root, *ON, given="c\nc\n")
    assert ended.out.count("(Pdb)") == 2, ended.out
    ended = workspace.hil(*workspace.run_arguments)
    assert ended.code == 1
    assert verdicts(newest(workspace)) == {"test_one": "ERROR", "test_two": "ERROR"}
    assert ended.out.count("a debugger would hold the case while outputs are on") >= 2
    assert "pytest PLAN --bench NAME --dut SERIAL" in ended.out


def test_what_is_not_python_is_told_in_a_few_lines(tmp_path):
    """File, line and mistake; nothing of how the file came to be read."""
    workspace = workspace_with(tmp_path / "workspace")
    (workspace.plan / "test_bad.py").write_text("def test_x(:\n", encoding="utf-8")
    ended = with_plugins(workspace.root, *ON)
    assert ended.code == 2
    assert 'test_bad.py", line 1' in ended.out
    assert "SyntaxError: invalid syntax" in ended.out
    assert "importlib" not in ended.out
    assert "user_properties" not in ended.out


def test_without_a_bench_pytest_collects_the_plans_and_says_what_they_need(workspace, digest):
    """Markers are known, evidence is not collected, and cases are not told that a fixture is missing."""
    assert (newest(workspace).folder / "data/sources/testplans/small/test_small.py").is_file()
    ended = with_plugins(workspace.root, "--collect-only", "-q", "--strict-markers")
    assert ended.code == 0, ended.out
    assert "3 tests collected" in ended.out
    assert "reports/" not in ended.out
    ended = with_plugins(workspace.root)
    assert ended.code == 4
    assert "the cases of testplans/small need a bench: add --bench NAME (adcs) and --dut SERIAL" in ended.err
    (workspace.root / "test_own.py").write_text("def test_own():\n    pass\n", encoding="utf-8")
    ended = with_plugins(workspace.root)
    (workspace.root / "test_own.py").unlink()
    assert ended.code == 1
    assert "1 passed, 3 errors" in ended.out
    assert "need a bench: add --bench NAME (adcs)" in ended.out


def test_a_module_beside_the_cases_is_imported_by_its_name_and_frozen(workspace, digest):
    """Under `hil run`, too; the package has its source, so that it can be replayed without the workspace."""
    assert (newest(workspace).folder / "data/sources/testplans/small/waveform.py").read_text() == "RATIO = 1.0\n"
    ended = workspace.hil("verify", newest(workspace).name, "--replay")
    assert ended.code == 0, ended.out + ended.err
    assert "no difference" in ended.out


def test_a_module_beside_the_cases_whose_name_means_another_is_refused(tmp_path):
    """A case that says `statistics` would get Python's."""
    workspace = workspace_with(
        tmp_path / "workspace", PLAN.replace("from waveform", "import statistics\nfrom waveform")
    )
    (workspace.plan / "statistics.py").write_text("RATIO = 1.0\n", encoding="utf-8")
    ended = with_plugins(workspace.root, *ON)
    assert ended.code == 4
    assert "'statistics' is also a module of Python or an installed package: rename" in ended.err


def test_a_folder_of_plans_runs_those_that_are_for_the_article(tmp_path):
    """What is left out is told, so that nobody takes it for run."""
    workspace = workspace_with(tmp_path / "workspace")
    other = workspace.plan.parent / "battery"
    other.mkdir()
    for path in workspace.plan.iterdir():
        if path.is_file() and path.name != "requirements.lock.json":
            text = path.read_text(encoding="utf-8").replace("T-0", "B-0").replace("id: T,", "id: B,")
            text = text.replace("requirements:\n", "part_numbers: [BAT-1]\nrequirements:\n", 1)
            (other / path.name).write_text(text, encoding="utf-8")
    assert workspace.hil("requirements", "lock", "battery").code == 0
    ended = with_plugins(workspace.root, *ON)
    assert ended.code == 0, ended.out + ended.err
    assert f"hil: not for {DUT}, left out: battery" in ended.out
    assert len(verdicts(newest(workspace))) == 3
