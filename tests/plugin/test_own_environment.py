"""Whole runs from a workspace that holds its own environment, as `make setup` makes it."""

from __future__ import annotations

import inspect
import os
import re
import sys

import pytest
from told_as_json import results_as_json
from workspaces import agreed, make

from hil.cli import entry
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.executive.setup.pins import pinned_environment
from hil.model.errors import Refused

CASE = '''
@pytest.mark.requirement("T-010")
def test_one(check):
    """A package of the workspace's environment is loaded by a case first."""
    import lazily_loaded
    check("T-010", "ratio", 1.0)
'''

UNDONE = """
@pytest.mark.requirement("T-010")
def test_cleared(check):
    \"\"\"Takes every variable of the environment away.\"\"\"
    os.environ.clear()
    check("T-010", "ratio", 1.0)

@pytest.mark.requirement("T-010")
def test_shallow(check):
    \"\"\"Leaves the interpreter no room for calls.\"\"\"
    sys.setrecursionlimit(max(120, len(inspect.stack()) + 20))
    check("T-010", "ratio", 1.0)
    deep(120)

def deep(count):
    return deep(count - 1) if count else 0
"""

LIMITED = """
@pytest.mark.requirement("T-010")
def test_one(check, step):
    \"\"\"Says what its limit is.\"\"\"
    with step(f"maximum recursion depth {sys.getrecursionlimit()}"):
        check("T-010", "ratio", 1.0)
"""

SHALLOW = """
@pytest.mark.requirement("T-010")
def test_too_shallow(check):
    \"\"\"Leaves less room than the calls that are there.\"\"\"
    sys.setrecursionlimit(60)
    check("T-010", "ratio", 1.0)

@pytest.mark.requirement("T-010")
def test_too_shallow_by_thread(check):
    \"\"\"Lets a thread do so, which has few calls of its own.\"\"\"
    lower = threading.Thread(target=sys.setrecursionlimit, args=(60,))
    lower.start()
    lower.join()
    check("T-010", "ratio", 1.0)

@pytest.mark.requirement("T-010")
def test_after_them(check):
    \"\"\"Has its room again.\"\"\"
    check("T-010", "ratio", 1.0)
"""


def test_what_a_case_does_to_its_interpreter_does_not_end_the_run(tmp_path, monkeypatch):
    """It clears the environment, or lowers the limit of recursion: the run goes on and is sealed."""
    monkeypatch.setattr(os, "environ", os.environ.copy())
    workspace = make(tmp_path / "workspace", "import inspect, os, sys\n" + UNDONE)
    agreed(workspace.run(), {"test_cleared": "PASS", "test_shallow": "ERROR"}, "ERROR", 1)


@pytest.mark.system
def test_cases_that_leave_less_room_than_the_calls_that_are_there(tmp_path):
    """Attack: a limit of 60 nested calls. Each such case is an ERROR that says so; those after it run as ever."""
    workspace = make(tmp_path / "workspace", "import sys, threading\n" + SHALLOW)
    ended = workspace.hil(*workspace.run_arguments)
    (folder,) = workspace.folders()
    found = results_as_json(Package(folder))
    said = "RecursionError: maximum recursion depth exceeded (testplans/small/test_small.py:"
    assert (ended.code, [case["verdict"] for case in found["cases"]]) == (1, ["ERROR", "ERROR", "PASS"])
    assert [case["reasons"][0].startswith(said) for case in found["cases"][:2]] == [True, True]
    assert not any(each["eligible"] for each in found["requirements"])
    assert "Traceback" not in ended.out + ended.err
    assert verify(folder).ok


def test_a_module_that_lowers_the_limit_of_recursion_lowers_it_for_itself(tmp_path):
    """Attack: 60 nested calls while a plan is collected, which ended pytest in a traceback."""
    limit = sys.getrecursionlimit()
    lower = f"import sys\n\nsys.setrecursionlimit({limit - 100})\n"
    ran = make(tmp_path / "workspace", lower, LIMITED).run()
    assert (sys.getrecursionlimit(), ran.verdicts()) == (limit, {"test_one": "PASS"})
    assert f"maximum recursion depth {limit}" in ran.page()


@pytest.mark.parametrize("option", ["error", "e", "error::DeprecationWarning", "error:::numpy"])
def test_a_python_that_makes_errors_of_warnings_is_refused(option):
    """Attack: PYTHONWARNINGS=error. NumPy's warnings about a pinned processor ended the run in a traceback."""
    with pytest.raises(Refused, match="turns warnings into errors") as refused:
        pinned_environment([option])
    assert refused.value.hint == "unset PYTHONWARNINGS, and start Python without -W"


def test_a_python_that_shows_warnings_is_taken():
    """What only shows or hides them changes nothing."""
    assert pinned_environment(["default", "ignore::DeprecationWarning", "always"]) == pinned_environment([])


def test_a_python_without_room_for_calls_is_refused(capsys):
    """Attack: a limit of 60 nested calls before hil began. A sentence says so."""
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(len(inspect.stack()) + 60)
    try:
        with pytest.raises(SystemExit) as left:
            entry.main()
    finally:
        sys.setrecursionlimit(limit)
    told = capsys.readouterr().err
    assert left.value.code == 4
    assert re.match(r"hil: this Python allows only \d+ nested calls, and hil may need 500\n     something", told)


@pytest.mark.system
def test_packages_of_an_environment_in_the_workspace_stay_loaded(tmp_path, monkeypatch):
    """What is installed below the workspace is not forgotten after a run; modules of plans and fixtures are."""
    workspace = make(tmp_path / "workspace", CASE)
    packages = workspace.root / ".venv/lib/python3/site-packages"
    packages.mkdir(parents=True)
    (packages / "lazily_loaded.py").write_text("")
    monkeypatch.syspath_prepend(str(packages))
    try:
        agreed(workspace.run(), {"test_one": "PASS"}, "PASS", 0)
        assert "lazily_loaded" in sys.modules
        assert not [name for name in sys.modules if name.endswith("test_small")]
    finally:
        sys.modules.pop("lazily_loaded", None)
