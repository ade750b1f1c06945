"""The software of a run: only what can change how it comes out counts, and differences are told in words."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from types import SimpleNamespace

import pytest

import hil
from hil.executive.resuming.earlier import Earlier
from hil.executive.resuming.preconditions import deviation_of
from hil.executive.setup.software import customised, software_identity
from hil.model.errors import Refused

GIT = shutil.which("git")
SOURCE = "src/hil/__init__.py"


def git(folder, *arguments):
    """Run git without the settings of this machine."""
    who = ["-c", "user.name=Ada", "-c", "user.email=ada@example.org", "-c", "commit.gpgsign=false"]
    subprocess.run([GIT, "-C", str(folder), *who, *arguments], check=True, capture_output=True)


@pytest.fixture
def checkout(tmp_path, monkeypatch):
    """Return a checkout in which the package seems to be, with one commit."""
    if GIT is None:
        pytest.skip("there is no git here")
    root = tmp_path / "checkout"
    (root / "src/hil").mkdir(parents=True)
    (root / SOURCE).touch()
    (root / "README.md").touch()
    git(tmp_path, "init", str(root))
    git(root, "add", ".")
    git(root, "commit", "-m", "Begin")
    monkeypatch.setattr(hil, "__file__", str(root / SOURCE))
    return root


def begun(checkout, tmp_path):
    """Return a run that began with the software as it is now, and what it is made of."""
    (tmp_path / "run/data").mkdir(parents=True)
    (tmp_path / "run/data/software.json").write_text(json.dumps(software_identity(checkout)), encoding="utf-8")
    earlier = Earlier(folder=tmp_path / "run", head=(), lines=(), size=0)
    return earlier, SimpleNamespace(workspace=SimpleNamespace(root=checkout))


def test_a_file_beside_the_source_changes_no_run(checkout, tmp_path):
    """Notes, settings of the workspace, and pages that differ are no other software."""
    run = begun(checkout, tmp_path)
    (checkout / "notes.txt").touch()
    (checkout / "hil.toml").write_text('notify = ["tell"]\n', encoding="utf-8")
    (checkout / "README.md").write_text("other words\n", encoding="utf-8")
    assert deviation_of(*run, "") == ""


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (("__init__.py",), "src/hil/__init__.py"),
        (("new.py",), "src/hil/new.py"),
        (("a.py", "b.py", "c.py", "d.py", "e.py"), "src/hil/a.py, src/hil/b.py, src/hil/c.py and 2 more"),
    ],
    ids=["tracked", "untracked", "many"],
)
def test_source_that_differs_is_named(checkout, tmp_path, names, told):
    """Files, at most three, and no expression of Python."""
    run = begun(checkout, tmp_path)
    for name in names:
        (checkout / "src/hil" / name).write_text("pass\n", encoding="utf-8")
    with pytest.raises(Refused) as refused:
        deviation_of(*run, "")
    assert (
        refused.value.message == f"run: the software differs from the one that started it: its source differs in {told}"
    )
    assert deviation_of(*run, "mended") == f"resumed with other software (its source differs in {told}): mended"


def test_source_that_was_changed_and_is_changed_again_is_other_software(checkout, tmp_path):
    """Two changes beside one commit are not the same change; to take a file away is one, too."""
    (checkout / "src/hil/new.py").write_text("1\n", encoding="utf-8")
    run = begun(checkout, tmp_path)
    assert deviation_of(*run, "") == ""
    (checkout / "src/hil/new.py").write_text("2\n", encoding="utf-8")
    (checkout / SOURCE).unlink()
    with pytest.raises(Refused, match=r"differs in src/hil/__init__\.py, src/hil/new\.py"):
        deviation_of(*run, "")


def test_another_commit_is_named(checkout, tmp_path):
    """By digits, which git takes."""
    run = begun(checkout, tmp_path)
    git(checkout, "commit", "--allow-empty", "-m", "Go on")
    with pytest.raises(Refused, match=r"started it: hil commit [0-9a-f]{12} is [0-9a-f]{12}; "):
        deviation_of(*run, "")


def test_a_package_that_is_only_installed_in_a_checkout_has_no_commit(checkout, tmp_path, monkeypatch):
    """The commits of a team's own workspace are none of the product's."""
    installed = checkout / ".venv/hil"
    installed.mkdir(parents=True)
    (installed / "__init__.py").touch()
    monkeypatch.setattr(hil, "__file__", str(installed / "__init__.py"))
    run = begun(checkout, tmp_path)
    git(checkout, "commit", "--allow-empty", "-m", "Go on")
    assert deviation_of(*run, "") == ""


def test_a_run_of_before_files_were_named_can_be_gone_on_with(checkout, tmp_path):
    """Its record says of its source only whether anything differed."""
    run = begun(checkout, tmp_path)
    path = tmp_path / "run/data/software.json"
    told = json.loads(path.read_bytes())
    del told["hil"]["commit"]["files"]
    path.write_text(json.dumps(told), encoding="utf-8")
    assert deviation_of(*run, "") == ""
    told["hil"]["commit"]["changed"] = True
    path.write_text(json.dumps(told), encoding="utf-8")
    with pytest.raises(Refused, match="its source was changed then"):
        deviation_of(*run, "")


def test_code_that_runs_before_the_product_is_told():
    """A `sitecustomize` on PYTHONPATH could replace anything; one of this Python is part of it."""
    own = SimpleNamespace(__file__=f"{sys.prefix}/lib/sitecustomize.py")
    assert customised({"sitecustomize": own}) == ()
    told = "Python ran a usercustomize.py from outside of its installation, which no package holds"
    assert customised({"usercustomize": SimpleNamespace(__file__="/elsewhere/usercustomize.py")}) == (told,)
