"""Whole runs from a workspace that holds its own environment, as `make setup` makes it."""

from __future__ import annotations

import os
import sys

from workspaces import agreed, make

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


def test_what_a_case_does_to_its_interpreter_does_not_end_the_run(tmp_path, monkeypatch):
    """It clears the environment, or lowers the limit of recursion: the run goes on and is sealed."""
    monkeypatch.setattr(os, "environ", os.environ.copy())
    workspace = make(tmp_path / "workspace", "import inspect, os, sys\n" + UNDONE)
    agreed(workspace.run(), {"test_cleared": "PASS", "test_shallow": "ERROR"}, "ERROR", 1)


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
