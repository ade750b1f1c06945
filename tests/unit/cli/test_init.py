"""`hil init`: a workspace at once, and nothing is overwritten."""

from __future__ import annotations

import subprocess
import sys

import pytest
import yaml

from hil.cli.main import main
from hil.executive.setup.workspace import find_workspace
from hil.requirements.catalogue import load_catalogue

RUN = ("run", "load", "--bench", "load", "--source", "simulated", "--dut", "SIM-LOAD-1", "--strict")


def said(capsys, *arguments):
    """Return exit code, output and errors of one command."""
    with pytest.raises(SystemExit) as left:
        main(arguments)
    told = capsys.readouterr()
    assert "Traceback" not in told.out + told.err
    return left.value.code, told.out, told.err


def content(root):
    """Return every file below a folder with its bytes."""
    return {str(path.relative_to(root)): path.read_bytes() for path in root.rglob("*") if path.is_file()}


def test_a_workspace_is_made_at_once(capsys, tmp_path, monkeypatch):
    """Its catalogue is locked, its CI files run the plan that it has, and the next command is told."""
    monkeypatch.chdir(tmp_path)
    code, out, err = said(capsys, "init", "my bench")
    root = tmp_path / "my bench"
    assert (code, err) == (0, "")
    assert out.splitlines()[-2:] == ["  cd 'my bench'", f"  hil {' '.join(RUN[:-1])}"]
    assert all(f"made  {name}" in out.splitlines() for name in content(root))
    assert find_workspace(root).root == root
    load_catalogue(root, [root / "testplans/load"], locked=True)
    github = yaml.safe_load((root / ".github/workflows/hil.yml").read_text())
    gitlab = yaml.safe_load((root / ".gitlab-ci.yml").read_text())
    ran = [step.get("run") for step in github["jobs"]["simulated-bench"]["steps"]]
    for commands in (ran, gitlab["simulated-bench"]["script"]):
        assert f"hil {' '.join(RUN)}" in commands
        assert "pip install wheels/hil-*.whl" in commands, "what a registry has under this name is something else"


def test_nothing_is_overwritten(capsys, tmp_path):
    """A file of a workspace is refused before anything is written; what a repository has besides stays as it is."""
    (tmp_path / "fixtures").mkdir()
    (tmp_path / "fixtures/duts.yaml").write_text("mine")
    code, _, err = said(capsys, "init", str(tmp_path))
    assert (code, "duts.yaml exists already" in err) == (4, True)
    assert content(tmp_path) == {"fixtures/duts.yaml": b"mine"}
    (tmp_path / "fixtures/duts.yaml").unlink()
    (tmp_path / "README.md").write_text("mine")
    (tmp_path / ".gitignore").symlink_to(tmp_path / "nowhere")
    code, out, _ = said(capsys, "init", str(tmp_path))
    assert (code, (tmp_path / "README.md").read_text(), (tmp_path / "nowhere").exists()) == (0, "mine", False)
    assert {"kept  README.md", "kept  .gitignore"} <= {*out.splitlines()}
    before = content(tmp_path)
    assert said(capsys, "init", str(tmp_path))[0] == 4
    assert content(tmp_path) == before


@pytest.mark.parametrize(
    ("ignored", "told"),
    [("build/\n", True), ("# reports/\nmy-reports/\n", True), ("build/\nreports/\n", False), ("/reports/*\n", False)],
)
def test_a_gitignore_that_keeps_packages_in_git_is_told(capsys, tmp_path, monkeypatch, ignored, told):
    """A run whose reports are tracked differs from its commit, and closes nothing."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / ".gitignore").write_text(ignored)
    code, out, _ = said(capsys, "init")
    assert (code, "  echo reports/ >> .gitignore" in out.splitlines()) == (0, told)


def test_a_workspace_in_a_project_file_is_one_already(capsys, tmp_path):
    """A hil.toml beside it would hide its settings."""
    (tmp_path / "pyproject.toml").write_text("[tool.hil]\n")
    assert "is a workspace already" in said(capsys, "init", str(tmp_path))[2]


@pytest.mark.system
def test_the_plan_of_a_new_workspace_passes(capsys, tmp_path):
    """As CI runs it: the run, and its package, are good; with the load that its comment names it fails."""
    said(capsys, "init", str(tmp_path))

    def hil(*arguments):
        return subprocess.run([sys.executable, "-m", "hil.cli", *arguments], cwd=tmp_path, check=False).returncode

    assert [hil(*RUN), hil("verify", "latest"), hil("bench", "check", "load", "--source", "simulated")] == [0, 0, 0]
    bench = tmp_path / "fixtures/benches/load/bench.yaml"
    bench.write_text(bench.read_text().replace('load: "100.4"', 'load: "120"'))
    assert hil(*RUN) == 1
