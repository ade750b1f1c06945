"""Workspaces: the nearest folder upwards that says it is one."""

from __future__ import annotations

import subprocess
import sys

import pytest

from hil.executive.setup.workspace import find_workspace
from hil.model.errors import ConfigurationError, Refused


def test_an_empty_hil_toml_makes_a_workspace(tmp_path):
    """Its folders have their usual names, seen from any folder below."""
    (tmp_path / "hil.toml").touch()
    deep = tmp_path / "a/b"
    deep.mkdir(parents=True)
    found = find_workspace(deep)
    assert (found.root, found.name) == (tmp_path, tmp_path.name)
    assert (found.testplans, found.reports) == (tmp_path / "testplans", tmp_path / "reports")
    assert found.benches == tmp_path / "fixtures/benches"
    assert (found.shown(tmp_path / "x/y"), found.shown(tmp_path.parent / "z")) == ("x/y", str(tmp_path.parent / "z"))


def test_a_project_file_makes_a_workspace_if_it_speaks_of_hil(tmp_path):
    """Another project's pyproject.toml is passed by."""
    (tmp_path / "pyproject.toml").write_text('[tool.hil]\nname = "Ours"\nreports = "evidence"\n')
    inner = tmp_path / "inner"
    inner.mkdir()
    (inner / "pyproject.toml").write_text("[tool.other]\n")
    found = find_workspace(inner)
    assert (found.root, found.name, found.reports) == (tmp_path, "Ours", tmp_path / "evidence")


def test_a_workspace_names_what_keeps_its_machine_awake(tmp_path):
    """Program and arguments, for machines without logind; none by default."""
    (tmp_path / "hil.toml").touch()
    assert find_workspace(tmp_path).inhibitor == ()
    (tmp_path / "hil.toml").write_text('[hardware]\ninhibitor = ["/usr/bin/awake", "--all"]\n')
    assert find_workspace(tmp_path).inhibitor == ("/usr/bin/awake", "--all")


def test_without_a_workspace_there_is_a_way_out(tmp_path):
    """The message says what makes one."""
    with pytest.raises(Refused, match=r"no workspace at .*; put a hil.toml"):
        find_workspace(tmp_path)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('report = "x"\n', "hil.toml:1:1: unknown key 'report', did you mean 'reports'?"),
        ("reports = 5\n", "hil.toml:1:1: workspace: 'reports' must be text"),
        ("hardware = 5\n", "hil.toml:1:1: workspace: 'hardware' must be a mapping, found `5`"),
        ("[hardware]\ninhibiter = []\n", "hil.toml:2:1: unknown key 'inhibiter', did you mean 'inhibitor'?"),
        ('[hardware]\ninhibitor = "awake"\n', "hil.toml:2:1: hardware: 'inhibitor' must be a list of texts: a program"),
        ("name = 1.5\n", "hil.toml:1:1: workspace: 'name' must be text that can be a file name, found `1.5`"),
        ('name = "a"\nnotify = [1979-05-27]\n', "hil.toml:2:1: workspace: 'notify' must be a list of texts"),
        ("reports = \n", "hil.toml:1:11: not readable as TOML: Invalid value"),
        ('name = "a"\n\nname = "b"\n', "hil.toml:3:11: not readable as TOML: Cannot overwrite a value"),
        ('name = "a"\nreports = "b', "hil.toml:2:13: not readable as TOML: Unterminated string"),
        ("reports = " + "[" * 5000, "hil.toml: not readable as TOML: nested too deeply"),
        ("reports = 1" + "0" * 5000, "hil.toml: not readable as TOML: a number has too many digits"),
        ('name = "a\x1bb"\n', "hil.toml:1:10: character U+001B is not allowed, remove it"),
        ('name = "a\\u001bb"\n', "hil.toml:1:1: workspace: 'name' must be a name that people can read; U+001B is not"),
        (b'name = "caf\xe9"\n', "hil.toml:1:12: not UTF-8 at byte 11, save the file as UTF-8"),
    ],
)
def test_wrong_settings_are_told(tmp_path, text, message):
    """Unknown keys, wrong kinds and broken files are findings of the file."""
    (tmp_path / "hil.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ConfigurationError) as caught:
        find_workspace(tmp_path)
    assert message in str(caught.value)


def test_a_byte_order_mark_and_other_line_ends_are_no_mistake(tmp_path):
    """Some editors write them."""
    (tmp_path / "hil.toml").write_bytes(b'\xef\xbb\xbfname = "Ours"\r\nreports = "evidence"\r\n')
    assert (find_workspace(tmp_path).name, find_workspace(tmp_path).reports) == ("Ours", tmp_path / "evidence")


def test_a_folder_in_the_place_of_the_settings_is_told(tmp_path):
    """And so is a file that nobody may read."""
    (tmp_path / "hil.toml").mkdir()
    with pytest.raises(ConfigurationError) as caught:
        find_workspace(tmp_path)
    assert str(caught.value) == "hil.toml: this is not a file"


def test_a_misspelt_key_is_one_finding(tmp_path):
    """Nothing is asked of the value of a key that nobody knows."""
    (tmp_path / "hil.toml").write_text('notifi = ["/usr/bin/say"]\n')
    with pytest.raises(ConfigurationError) as caught:
        find_workspace(tmp_path)
    assert str(caught.value) == "hil.toml:1:1: unknown key 'notifi', did you mean 'notify'?"


def test_plans_and_fixtures_lie_in_the_workspace(tmp_path):
    """A package names files by their path in the workspace; reports may go anywhere."""
    root = tmp_path / "root"
    root.mkdir()
    (root / "hil.toml").write_text('testplans = "../plans"\nfixtures = "/elsewhere"\nreports = "../out"\n')
    with pytest.raises(ConfigurationError) as caught:
        find_workspace(root)
    text = str(caught.value)
    assert f"'testplans' is {tmp_path / 'plans'}, and must lie in the workspace, {root}" in text
    assert "hil.toml:2:1: 'fixtures' is /elsewhere" in text
    assert "'reports'" not in text


def test_a_plan_is_found_by_path_and_by_name(tmp_path):
    """From anywhere in the workspace; what is no plan is refused with the nearest."""
    (tmp_path / "hil.toml").touch()
    plan = tmp_path / "testplans/gyro"
    plan.mkdir(parents=True)
    (plan / "requirements.yaml").touch()
    found = find_workspace(tmp_path)
    assert found.plan("gyro", tmp_path) == plan
    assert found.plan("testplans/gyro/", tmp_path) == plan
    assert found.plan(".", plan) == plan
    assert found.plans() == ("gyro",)
    with pytest.raises(Refused, match=r"no plan 'gryo', did you mean 'gyro'\?; plans of this workspace are: gyro"):
        found.plan("gryo", tmp_path)
    with pytest.raises(Refused):
        found.plan("testplans", tmp_path)


def test_wrong_settings_of_a_project_file_are_told_at_their_line(tmp_path):
    """The table of hil among those of other tools."""
    (tmp_path / "pyproject.toml").write_text('[project]\nname = 5\n\n[tool.hil]\nname = "a"\n  reports = 5\n')
    with pytest.raises(ConfigurationError) as caught:
        find_workspace(tmp_path)
    assert str(caught.value).startswith("pyproject.toml:6:3: workspace: 'reports' must be text")


@pytest.mark.parametrize("text", ["tool = 3", "[tool]\nhil = 3", "[[tool]]\nhil = {}", "[tool.hil]\ntestplans = 3"])
def test_a_project_file_of_odd_types_is_no_internal_error(tmp_path, text):
    """It is told, or it is somebody else's."""
    (tmp_path / "pyproject.toml").write_text(text)
    with pytest.raises((ConfigurationError, Refused)):
        find_workspace(tmp_path)


@pytest.mark.parametrize("text", ['testplans = "a\\u0000b"', 'reports = ""', 'fixtures = " "'])
def test_settings_that_can_name_no_folder_are_told(tmp_path, text):
    """NUL and nothing are no names."""
    (tmp_path / "hil.toml").write_text(text)
    with pytest.raises(ConfigurationError, match="must be (text|a name)"):
        find_workspace(tmp_path)


def test_names_of_folders_are_read_without_the_reader_of_documents(tmp_path):
    """Every command that names a run reads them, and none of them waits for a library that it does not need."""
    (tmp_path / "hil.toml").write_text('name = "Ours"\nreports = "evidence"\n')
    code = (
        "import sys\nfrom pathlib import Path\nfrom hil.executive.setup.workspace import find_workspace\n"
        "found = find_workspace(Path.cwd())\nsys.exit('pydantic' in sys.modules or found.reports.name != 'evidence')\n"
    )
    assert subprocess.run([sys.executable, "-c", code], cwd=tmp_path, check=False).returncode == 0


def test_a_workspace_is_also_found_by_a_plan_that_is_named(tmp_path):
    """From elsewhere, by its path; the workspace that a command was started in comes first."""
    here, there = tmp_path / "here", tmp_path / "there"
    for folder in (here, there):
        folder.mkdir()
        (folder / "hil.toml").write_text("")
    plan = there / "testplans/small"
    assert find_workspace(tmp_path, named=[plan]).root == there
    assert find_workspace(here, named=[plan]).root == here
