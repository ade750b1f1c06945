"""The software of a run: only what can change how it comes out counts, and differences are told in words."""

from __future__ import annotations

import base64
import hashlib
import json
import shutil
import subprocess
import sys
from importlib import metadata
from types import SimpleNamespace

import msgspec
import pytest
from workspaces import ROOT

import hil
from hil.documents.canonical import canonical, parse_strict
from hil.evidence.events.codec import convert
from hil.evidence.results.eligibility import of_run
from hil.evidence.results.facts import Facts
from hil.evidence.results.software import FrozenSoftware
from hil.evidence.state import fold
from hil.executive.resuming.earlier import Earlier
from hil.executive.resuming.preconditions import deviation_of
from hil.executive.setup.software import changing, customised, software_identity
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


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return a package that was installed from a wheel, with the RECORD of its files and the commit of its source."""
    package = tmp_path / "site-packages/hil"
    (package / "model").mkdir(parents=True)
    (package / "__init__.py").write_text('"""Product."""\n')
    (package / "model/figure.py").write_text("x = 1\n")
    (package / "built.json").write_text('{"changed": false, "commit": "abc"}\n')
    info = tmp_path / "site-packages/hil-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: hil\nVersion: 1.0\n")
    lines = [f"{path.relative_to(package.parent)},sha256={hash_of(path)},9" for path in package.rglob("*.*")]
    (info / "RECORD").write_text("\n".join([*lines, "hil/__pycache__/a.pyc,,", "hil-1.0.dist-info/RECORD,,", ""]))
    monkeypatch.setattr(hil, "__file__", str(package / "__init__.py"))
    monkeypatch.setattr("hil.executive.setup.software.metadata.distribution", lambda _: metadata.Distribution.at(info))
    return package


def hash_of(path):
    """Return a file's SHA-256 as a RECORD has it."""
    return base64.urlsafe_b64encode(hashlib.sha256(path.read_bytes()).digest()).rstrip(b"=").decode()


def commit_of(tmp_path):
    """Return what is frozen of the product's commit."""
    return software_identity(tmp_path)["hil"]["commit"]


def test_an_installed_wheel_has_the_commit_that_it_was_built_from(installed, tmp_path):
    """Every file is the one of its RECORD; byte code is none of them."""
    (installed / "__pycache__").mkdir()
    (installed / "__pycache__/figure.pyc").touch()
    assert commit_of(tmp_path) == {"id": "abc", "changed": False, "files": {}}


@pytest.mark.parametrize("name", ["model/figure.py", "new.py", "__init__.py", "built.json"])
def test_an_installed_file_that_is_not_as_recorded_is_named(installed, tmp_path, name):
    """Changed, or put in; and one that is gone."""
    (installed / name).write_text('{"changed": false, "commit": "abd"}\n')
    assert (commit_of(tmp_path)["changed"], list(commit_of(tmp_path)["files"])) == (True, [f"hil/{name}"])
    (installed / name).unlink()
    if name in {"model/figure.py", "__init__.py"}:
        assert commit_of(tmp_path)["files"] == {f"hil/{name}": ""}


@pytest.mark.parametrize("built", ['{"changed": true, "commit": "abc"}', '{"commit": "abc"}'])
def test_a_wheel_of_changed_source_is_changed(installed, tmp_path, built):
    """Or one that does not say."""
    (installed / "built.json").write_text(built)
    record = next(installed.parent.glob("*.dist-info")) / "RECORD"
    lines = [each for each in record.read_text().splitlines() if "built.json" not in each]
    record.write_text("\n".join([*lines, f"hil/built.json,sha256={hash_of(installed / 'built.json')},9"]))
    assert commit_of(tmp_path) == {"id": "abc", "changed": True, "files": {}}


@pytest.mark.parametrize("built", ["", "[]", '{"changed": false, "commit": ""}'])
def test_a_wheel_that_names_no_commit_has_none(installed, tmp_path, built):
    """It was built by other means, or outside of version control."""
    (installed / "built.json").write_text(built)
    assert commit_of(tmp_path)["id"] == ""


@pytest.mark.system
def test_a_build_notes_its_commit_and_whether_the_source_is_that_of_it(checkout, tmp_path):
    """Clean, changed, with a file of an earlier build, and without version control."""
    pytest.importorskip("setuptools")
    shutil.copy(ROOT / "setup.py", checkout)
    (checkout / "pyproject.toml").write_text(
        '[project]\nname = "hil"\nversion = "1"\n[tool.setuptools.packages.find]\nwhere = ["src"]\n'
    )
    git(checkout, "add", ".")
    git(checkout, "commit", "-m", "Build")

    def built():
        command = [sys.executable, "setup.py", "-q", "build_py", "-d", str(tmp_path / "out")]
        subprocess.run(command, cwd=checkout, check=True, capture_output=True)
        return json.loads((tmp_path / "out/hil/built.json").read_bytes())

    commit = subprocess.run([GIT, "-C", checkout, "rev-parse", "HEAD"], capture_output=True, text=True, check=True)
    assert built() == {"commit": commit.stdout.strip(), "changed": False}
    (checkout / SOURCE).write_text("x = 1\n")
    assert built()["changed"] is True
    git(checkout, "checkout", SOURCE)
    assert built()["changed"] is False
    (tmp_path / "out/hil/old.py").touch()
    assert built()["changed"] is True
    shutil.rmtree(checkout / ".git")
    assert built() == {"commit": "", "changed": False}


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


def test_what_changes_the_code_that_is_executed_is_named(tmp_path):
    """Also what the process began with, and code that ran before took away; what only tunes Python is not."""
    began, loads = tmp_path / "environ", tmp_path / "ld.so.preload"
    assert changing({"PYTHONUNBUFFERED": "1", "PYTHONHASHSEED": "0", "OLD_PATH": "x"}, began, loads) == []
    began.write_bytes(b"LD_PRELOAD=/own/clock.so\0PATH=/bin\0")
    loads.write_text("\n", encoding="utf-8")
    given = {"PYTHONPATH": "/own", "LD_AUDIT": "a.so", "LD_LIBRARY_PATH": "/own"}
    assert changing(given, began, loads) == ["LD_AUDIT", "LD_LIBRARY_PATH", "LD_PRELOAD", "PYTHONPATH"]
    loads.write_text("/own/clock.so\n", encoding="utf-8")
    assert changing({}, began, loads) == ["LD_PRELOAD", str(loads)]


def test_what_changes_the_code_that_is_executed_closes_nothing(tmp_path, monkeypatch):
    """From format 4 of the file on; packages of before get no condition."""

    def judged(software):
        found = of_run(fold([]), Facts(catalogue={}, software=software))
        return {each.text: each.proven for each in found if each.name == "environment"}

    monkeypatch.setenv("LD_PRELOAD", "/own/clock.so")
    frozen = convert(parse_strict(canonical(software_identity(tmp_path))), FrozenSoftware, "software")
    assert judged(frozen)["LD_PRELOAD changes which code is executed: unset it"] is False
    clean = msgspec.structs.replace(frozen, changing=())
    assert judged(clean) == {"no variable of the environment changes which code is executed": True}
    assert judged(msgspec.structs.replace(clean, format=3)) == {}
