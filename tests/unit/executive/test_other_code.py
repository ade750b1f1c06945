"""Code of others in a run: which package it is of, whether anybody changed it, and what ran before the product."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import re
import site
import subprocess
import sys
from importlib import metadata
from pathlib import Path
from types import ModuleType, SimpleNamespace

import pytest
from evidence_runs import SOFTWARE

from hil.documents import offers
from hil.documents.canonical import canonical, parse_strict
from hil.evidence.events.codec import convert
from hil.evidence.results.eligibility import of_run
from hil.evidence.results.facts import Facts
from hil.evidence.results.outcome import NO_OTHERS
from hil.evidence.results.software import FrozenSoftware
from hil.evidence.state import fold
from hil.executive.setup import other_code
from hil.executive.setup.other_code import at_start, of_no_package, other_packages
from hil.instruments.registry import DRIVERS

DRIVER = """
class Constant:
    roles = frozenset({"multimeter"})
    def identify(self): ...
    def outlets(self): return ()
    def role(self, wire): ...
"""


def git(folder, *arguments):
    """Run git without the settings of this machine."""
    who = ["-c", "user.name=Ada", "-c", "user.email=ada@example.org", "-c", "commit.gpgsign=false"]
    subprocess.run(["git", "-C", str(folder), *who, *arguments], check=True, capture_output=True)


def recorded(root, names):
    """Return the lines of a RECORD, as installers write them."""
    for name in names:
        digest = hashlib.sha256((root / name).read_bytes()).digest()
        yield f"{name},sha256={base64.urlsafe_b64encode(digest).rstrip(b'=').decode()},1"


@pytest.fixture
def site_packages(tmp_path, monkeypatch):
    """Return a folder of packages of its own, which Python looks into."""
    folder = tmp_path / "site-packages"
    folder.mkdir()
    monkeypatch.syspath_prepend(folder)
    monkeypatch.setattr(site, "getsitepackages", lambda: [str(folder)])
    monkeypatch.setattr(site, "ENABLE_USER_SITE", False)
    fresh()
    yield folder
    fresh()
    sys.modules.pop("constant_dmm", None)
    for point in [each for each in DRIVERS._loaded if each.name == "constant"]:
        del DRIVERS._loaded[point]


def fresh():
    """Forget which packages there are."""
    for each in (offers._installed, other_code._owners, other_code._in_place):
        each.cache_clear()


def installed(folder, told=None, extra=()):
    """Install a package with a driver; return its module."""
    module = folder / "constant_dmm/__init__.py"
    module.parent.mkdir()
    module.write_text(DRIVER, encoding="utf-8")
    info = folder / "constant_dmm-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: constant-dmm\nVersion: 1.2\n", encoding="utf-8")
    (info / "entry_points.txt").write_text("[hil.drivers]\nconstant = constant_dmm:Constant\n", encoding="utf-8")
    names = ["constant_dmm/__init__.py", *extra]
    lines = [*recorded(folder, names), "constant_dmm/__pycache__/x.pyc,,", f"{info.name}/RECORD,,", ""]
    (info / "RECORD").write_text("\n".join(lines), encoding="utf-8")
    if told is not None:
        (info / "direct_url.json").write_text(json.dumps(told), encoding="utf-8")
    fresh()
    return module


def judged():
    """Return the conditions about code of others, from what would be frozen now: text and whether it is proven."""
    frozen = {**SOFTWARE, "format": 2, "others": [each.facts for each in other_packages()], "start": at_start()}
    software = convert(parse_strict(canonical({**frozen, "strays": []})), FrozenSoftware, "software")
    found = of_run(fold([]), Facts(catalogue={}, software=software))
    return {each.text: each.proven for each in found if each.name in {"others", "start"}}


def of_drivers():
    """Return the one sentence about drivers of others, and whether it is proven."""
    return next(each for each in judged().items() if each[0].startswith("driver "))


def test_a_driver_of_an_installed_package_is_named(site_packages):
    """By package and version, with the files as they are, and with its source."""
    module = installed(site_packages)
    assert DRIVERS["constant"].__module__ == "constant_dmm"
    (package,) = [each for each in other_packages() if each.name == "constant-dmm 1.2"]
    assert package.facts["offers"] == ["driver constant"]
    assert package.facts["files"] == {"constant_dmm/__init__.py": hashlib.sha256(module.read_bytes()).hexdigest()}
    assert dict(package.sources()) == {"data/packages/constant-dmm/constant_dmm/__init__.py": DRIVER.encode()}
    assert of_drivers() == ("driver constant of package constant-dmm 1.2 is as it was installed from an index", True)


def test_what_nobody_imported_is_not_named(site_packages):
    """A package that only lies there takes no part."""
    installed(site_packages)
    assert not [each for each in other_packages() if each.name == "constant-dmm 1.2"]


@pytest.mark.parametrize("added", [False, True], ids=["changed", "added"])
def test_a_driver_that_was_changed_after_its_installation_counts_for_nothing(site_packages, added):
    """Nor does a module that somebody put beside it."""
    module = installed(site_packages)
    assert DRIVERS["constant"]
    changed = module.with_name("patch.py") if added else module
    changed.write_text("class Constant: ...\n", encoding="utf-8")
    told, proven = of_drivers()
    assert not proven
    assert told.endswith(f"was changed after it was installed: constant_dmm/{changed.name}")


def test_a_driver_without_a_record_counts_for_nothing(site_packages):
    """There is nothing to compare it with."""
    installed(site_packages)
    assert DRIVERS["constant"]
    (site_packages / "constant_dmm-1.2.dist-info/RECORD").unlink()
    told, proven = of_drivers()
    assert not proven
    assert "has no RECORD of its files" in told


@pytest.mark.parametrize("editable", [False, True], ids=["installed", "in place"])
def test_a_driver_from_a_folder_counts_as_its_commit_does(site_packages, tmp_path, editable):
    """In no version control, committed, and changed since, or another one than the commit has."""
    source = tmp_path / "own"
    (source / "src").mkdir(parents=True)
    told = {"url": source.as_uri(), "dir_info": {"editable": True} if editable else {}}
    module = installed(source / "src" if editable else site_packages, told)
    if editable:
        sys.path.insert(0, str(source / "src"))
    try:
        assert DRIVERS["constant"]
        assert of_drivers()[0].endswith("was installed from a folder that is not in version control")
        if not editable:
            (source / "src/other_name.py").write_bytes(module.read_bytes())
        git(tmp_path, "init", str(source))
        (source / ".gitignore").write_text("*.dist-info\n", encoding="utf-8")
        git(source, "add", ".")
        git(source, "commit", "-m", "Begin")
        told, proven = of_drivers()
        assert proven
        assert "a folder in version control, commit " in told
        (module if editable else source / "src/other_name.py").write_text(f"{DRIVER}\n# more\n", encoding="utf-8")
        told, proven = of_drivers()
        assert not proven
        assert "of the folder that it was installed from" in told
    finally:
        if editable:
            sys.path.remove(str(source / "src"))


def test_ignored_code_of_a_folder_is_not_of_its_commit(site_packages, tmp_path):
    """A file that version control was told to ignore does not make the folder differ, and is in no commit."""
    source = tmp_path / "own"
    source.mkdir()
    installed(site_packages, {"url": source.as_uri(), "dir_info": {}})
    assert DRIVERS["constant"]
    (source / ".gitignore").write_text("*.py\n", encoding="utf-8")
    git(tmp_path, "init", str(source))
    git(source, "add", ".")
    git(source, "commit", "-m", "Begin")
    assert not of_drivers()[1]


def test_a_pth_file_that_imports_is_told_by_its_package(site_packages):
    """As setuptools and coverage install them; one with folders only executes nothing."""
    (site_packages / "a1_coverage.pth").write_text("import sys; exec('pass')\n", encoding="utf-8")
    (site_packages / "folders.pth").write_text("/somewhere\n", encoding="utf-8")
    installed(site_packages, extra=["a1_coverage.pth"])
    assert [(each["file"], each["of"], each["whole"]) for each in at_start({})] == [
        ("site-packages/a1_coverage.pth", "constant-dmm 1.2", True)
    ]
    (site_packages / "a1_coverage.pth").write_text("import sys; exec('1')\n", encoding="utf-8")
    assert [each["whole"] for each in at_start({})] == [False]


def test_a_package_that_runs_at_the_start_and_that_nobody_needs_is_named(site_packages):
    """A RECORD is a file beside it, which anybody can write: so what Python executed of it stands in the evidence."""
    (site_packages / "calm.pth").write_text("# calm\nimport constant_dmm\n", encoding="utf-8")
    installed(site_packages, extra=["calm.pth"])
    (started,) = at_start({})
    assert (started["whole"], started["needed"], started["lines"]) == (True, False, ["import constant_dmm"])
    told = "site-packages/calm.pth of package constant-dmm 1.2 was executed when Python started, and hil needs no such "
    assert {text: proven for text, proven in judged().items() if "calm.pth" in text and "hil needs" in text} == {
        f"{told}package": True
    }
    assert NO_OTHERS not in judged()


def test_a_customising_module_that_hides_is_found(site_packages):
    """It can take itself out of the loaded modules, and lies on the path all the same."""
    (site_packages / "sitecustomize.py").touch()
    assert [each["file"] for each in at_start({})] == ["site-packages/sitecustomize.py"]


def test_a_pth_file_of_nobody_closes_nothing(site_packages):
    """It can replace any driver before the product starts."""
    (site_packages / "patch.pth").write_text("# nothing\nimport os; os.environ['X'] = '1'\n", encoding="utf-8")
    told = "Python executed site-packages/patch.pth when it started, which is of no installed package"
    assert judged()[told] is False


def test_a_customising_module_in_the_environment_closes_nothing(site_packages):
    """Of no package there either; one of Python's own folder is part of Python."""
    module = SimpleNamespace(__file__=str(site_packages / "sitecustomize.py"))
    (site_packages / "sitecustomize.py").touch()
    assert [each["of"] for each in at_start({"sitecustomize": module})] == [""]
    (site_packages / "sitecustomize.py").unlink()
    of_python = SimpleNamespace(__file__=str(Path(os.__file__).with_name("sitecustomize.py")))
    assert at_start({"sitecustomize": of_python}) == []


@pytest.mark.parametrize("whole", [True, False])
def test_the_file_of_virtualenv_is_known_by_its_content(site_packages, monkeypatch, whole):
    """It has no RECORD; a file by that name with other content is somebody else's."""
    (site_packages / "_virtualenv.pth").write_text("import _virtualenv", encoding="utf-8")
    (site_packages / "_virtualenv.py").write_text("", encoding="utf-8")
    written = [site_packages / name for name in ("_virtualenv.pth", "_virtualenv.py")]
    monkeypatch.setattr(other_code, "_VIRTUALENV", {hashlib.sha256(path.read_bytes()).hexdigest() for path in written})
    if not whole:
        written[1].write_text("import patch\n", encoding="utf-8")
    assert [each["of"] for each in at_start({})] == ["virtualenv" if whole else ""]


def test_modules_of_no_package_are_named(site_packages, tmp_path):
    """A script that starts the product, and a module from a folder of PYTHONPATH; not those of the workspace."""
    modules = {
        "__main__": ModuleType("__main__"),
        "constant_dmm": ModuleType("constant_dmm"),
        "cases": ModuleType("cases"),
        "os": os,
        "pytest": pytest,
        "sys": sys,
    }
    modules["__main__"].__file__ = str(tmp_path / "play.py")
    modules["constant_dmm"].__file__ = str(installed(site_packages))
    modules["cases"].__file__ = str(tmp_path / "workspace/cases.py")
    assert of_no_package(tmp_path / "workspace", modules) == ["__main__ (play.py)"]


def test_an_environment_as_everybody_makes_it_is_proven():
    """The one that runs this test: hil in place, with what pytest, coverage and setuptools bring."""
    assert of_no_package(Path.cwd()) == []
    assert [each for each in at_start() if not each["of"] or not each["whole"]] == []


def test_packages_of_before_are_judged_as_before():
    """Format 1 of `software.json` told nothing of others, and gets no condition."""
    old = of_run(fold([]), Facts(catalogue={}, software=FrozenSoftware()))
    new = of_run(fold([]), Facts(catalogue={}, software=FrozenSoftware(format=2)))
    assert {each.name for each in new} - {each.name for each in old} == {"others", "start"}
    assert NO_OTHERS in {each.text for each in new}


def test_what_a_package_needs_is_read_as_python_reads_it():
    """The lines above its description are enough; to parse them all took a twentieth of a run's start."""
    for package in ("hil", "pytest", "numpy", "jinja2"):
        needs = {
            re.match(r"[\w.-]+", each)[0].lower().replace("_", "-")
            for each in metadata.requires(package) or ()
            if "extra ==" not in each
        }
        assert needs <= other_code.needed()
    assert "hypothesis" not in other_code.needed()
