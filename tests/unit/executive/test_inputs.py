"""What the code of a workspace opens, writes and executes during a run: noticed, frozen or refused."""

from __future__ import annotations

import os
import threading
from pathlib import Path

import pytest

from hil.executive.setup.auditing import watched
from hil.executive.setup.ground import Ground
from hil.executive.setup.inputs import CodeFromOutside, Inputs, SourceChanged, SourceWritten
from hil.executive.setup.workspace import Workspace


@pytest.fixture
def place(tmp_path):
    """A folder with a workspace in it."""
    root = tmp_path.resolve() / "workspace"
    for folder in ("testplans/load/lib", "testplans/load/__pycache__", "fixtures/benches/load", "reports", ".git"):
        (root / folder).mkdir(parents=True)
    (root / "testplans/load/test_load.py").write_text("one")
    (root / "ref.csv").write_text("1.0\n2.0\n")
    return root


@pytest.fixture
def inputs(place):
    """What a run of the plan reads."""
    folders = {name: place / name for name in ("testplans", "fixtures", "reports")}
    return Inputs(Workspace(root=place, name="w", **folders), [place / "testplans/load"], "load")


@pytest.fixture
def run(place, inputs):
    """Run code as a module of the plan would, watched or not."""

    def run(text, *, is_watched=True, **names):
        code = compile(text, str(place / "testplans/load/test_load.py"), "exec")
        names = {"root": place, "Path": Path, **names}
        if not is_watched:
            exec(code, names)  # noqa: S102 - what the test is about
            return
        with watched(inputs, Ground(place, [place / "reports"])):
            exec(code, names)  # noqa: S102 - as above

    return run


@pytest.mark.parametrize(
    "text",
    [
        "open(root / 'ref.csv').close()",
        "open(str(root / 'ref.csv'), 'rb').close()",
        "open(bytes(root / 'ref.csv')).close()",
        "(root / 'ref.csv').read_text()",
        "import os; os.close(os.open(root / 'ref.csv', os.O_RDONLY))",
        "import io; io.open(root / 'ref.csv').close(); io.FileIO(root / 'ref.csv').close()",
        "import io; io.open_code(str(root / 'ref.csv')).close()",
        "import numpy; numpy.loadtxt(root / 'ref.csv')",
        "open(root / 'testplans/../ref.csv').close()",
        "import os; os.chdir(root); open('ref.csv').close()",
        "(root / 'reports/link').symlink_to(root); open(root / 'reports/link/ref.csv').close()",
        "import shutil; shutil.copyfile(root / 'ref.csv', root / 'reports/ref.csv')",
    ],
)
def test_every_way_to_open_a_file_is_noticed(run, inputs, place, text, monkeypatch):
    """By name, by path, as bytes, relative, through a link, by a library: the file is held as it was."""
    monkeypatch.chdir(place)
    run(text)
    assert list(inputs.used) == [place / "ref.csv"]
    assert inputs.snapshot.take(place / "ref.csv") == b"1.0\n2.0\n"


@pytest.mark.parametrize(
    "text",
    [
        "open('/proc/self/stat').close()",
        "open(root / 'reports/x', 'w').close(); open(root / 'reports/x').close()",
        "open(root / '.git/x', 'w').close(); open(root / '.git/x').close()",
        "open(root / 'made', 'w').close(); open(root / 'made').close()",
        "import os; os.close(os.open(root, os.O_RDONLY))",
    ],
)
def test_what_is_no_input_is_not_frozen(run, inputs, text):
    """Files elsewhere, packages, version control, folders, and what the code itself wrote."""
    run(text)
    assert not inputs.used


def test_nothing_is_noticed_outside_of_a_run(run, inputs):
    """The interpreter keeps the hook for good; it does nothing then."""
    run("pass")
    run("open(root / 'ref.csv').close()", is_watched=False)
    assert not inputs.used


def test_another_thread_is_noticed(run, inputs):
    """Also where nothing on its stack is of the workspace."""
    run("t = Thread(target=(root / 'ref.csv').read_text); t.start(); t.join()", Thread=threading.Thread)
    assert len(inputs.used) == 1


def test_what_changed_is_not_opened(run, inputs, place):
    """Nobody computes with bytes that no package holds; the same bytes, saved again, are the same."""
    run("open(root / 'ref.csv').close()")
    os.utime(place / "ref.csv", (1, 1))
    run("open(root / 'ref.csv').close()")
    (place / "ref.csv").write_text("7.0")
    with pytest.raises(SourceChanged, match=r"^ref\.csv changed on the disk after it was frozen"):
        run("open(root / 'ref.csv').close()")
    assert list(inputs.changed()) == [place / "ref.csv"]


@pytest.mark.parametrize(
    "text",
    [
        "open(root / 'testplans/load/test_load.py', 'w')",
        "open(root / 'testplans/load/new.csv', 'x')",
        "open(root / 'fixtures/duts.yaml', 'a')",
        "(root / 'testplans/load/test_load.py').unlink()",
        "(root / 'testplans/load/test_load.py').rename(root / 'away')",
        "(root / 'ref.csv').replace(root / 'testplans/load/test_load.py')",
        "(root / 'testplans/load/link').symlink_to(root / 'ref.csv')",
        "import os; os.truncate(root / 'testplans/load/test_load.py', 0)",
    ],
)
def test_plans_and_fixtures_are_not_written(run, inputs, place, text):
    """Not by a case, in no way; the executive hears of it, whatever the case makes of it."""
    with pytest.raises(SourceWritten, match="code of the run writes to "):
        run(text)
    run(f"try:\n    {text.replace('; ', chr(10) + '    ')}\nexcept OSError:\n    pass")
    assert len(inputs.take_refused()) == 2
    assert inputs.take_refused() == []
    assert (place / "testplans/load/test_load.py").read_text() == "one"


def test_compiled_copies_are_not_read(run, place):
    """Their source may be any; Python takes the source then."""
    (place / "testplans/load/__pycache__/x.pyc").write_bytes(b"")
    with pytest.raises(FileNotFoundError):
        run("open(root / 'testplans/load/__pycache__/x.pyc', 'rb')")


LOADS = """
from importlib.util import module_from_spec, spec_from_file_location
spec = spec_from_file_location("hil_test_loaded", path)
spec.loader.exec_module(module_from_spec(spec))
"""


def test_code_of_a_file_is_in_the_workspace_or_installed(run, inputs, place):
    """A module that is loaded by its path is frozen if it is in the workspace, and refused if it is elsewhere."""
    for folder in (place / "testplans/load/lib", place.parent):
        (folder / "x.py").write_text("VALUE = 1")
    run(LOADS, path=place / "testplans/load/lib/x.py")
    assert place / "testplans/load/lib/x.py" in inputs.used
    with pytest.raises(CodeFromOutside, match=r"x\.py is neither in the workspace nor installed"):
        run(LOADS, path=place.parent / "x.py")
    run("import colorsys; colorsys.__spec__.loader.exec_module(colorsys)")
