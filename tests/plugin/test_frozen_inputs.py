"""What a run is made of is read once: what is in the package is what was used, whatever happens on the disk."""

from __future__ import annotations

import pytest
from told_as_json import bodies
from workspaces import make

from hil.evidence.package.verification import verify
from hil.model.errors import ConfigurationError
from hil.plugin.rehearsing import replay

EDITED = {
    "testplans/small/test_small.py": "def test_edited():\n    pass\n",
    "testplans/small/requirements.lock.json": "{}",
    "testplans/small/requirements.yaml": "nothing",
    "testplans/small/lib/late.py": "RATIO = 9.0\n",
    "fixtures/benches/adcs/bench.yaml": "nothing",
    "fixtures/duts.yaml": "nothing",
}

EDITOR = f"""
import os, pathlib, sys
for name, text in {EDITED!r}.items():
    path = pathlib.Path(sys.argv[1], name)
    beside = path.with_name(path.name + "~")
    beside.write_text(text)
    os.replace(beside, path)
"""

CASES = f"""
import inspect
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
subprocess.run([sys.executable, "-c", {EDITOR!r}, str(HERE.parents[1])], check=True)


@pytest.mark.requirement("T-010")
def test_uses_what_was_there(check, parameters):
    from .lib import late
    table = (HERE.parents[1] / "ref.csv").read_text()
    assert "test_uses_what_was_there" in inspect.getsource(test_uses_what_was_there)
    check("T-010", "ratio", late.RATIO * float(table))


@pytest.mark.requirement("T-040")
def test_opens_what_changed(check):
    Path("/proc/self/stat").read_text()
    subprocess.run(["sh", "-c", "echo 7 > ref.csv"], check=True, cwd=HERE.parents[1])
    (HERE.parents[1] / "scratch.txt").write_text("one")
    (HERE.parents[1] / "scratch.txt").write_text("two")
    check("T-040", "answers", "yes")
    open(HERE.parents[1] / "ref.csv").close()


@pytest.mark.requirement("T-040")
def test_writes_into_its_plan(check):
    check("T-040", "answers", "yes")
    try:
        (HERE / "table.csv").write_text("1.0")
    except OSError:
        pass


@pytest.mark.requirement("T-040")
def test_writes_openly(check):
    check("T-040", "answers", "yes")
    (HERE / "open.csv").write_text("1.0")


@pytest.mark.requirement("T-040")
def test_compares(check):
    check("T-040", "answers", "yes")
    assert sorted([2, 1]) == [1, 3]


@pytest.mark.requirement("T-040")
def test_uses_code_from_outside(check):
    check("T-040", "answers", "yes")
    sys.path.insert(0, str(HERE.parents[2] / "elsewhere"))
    try:
        import hil_test_outside
    finally:
        del sys.path[0]
"""


@pytest.fixture(scope="module")
def edited(tmp_path_factory):
    """A run whose files an editor saves while it is being collected, and the sources as they were before."""
    place = tmp_path_factory.mktemp("edited")
    workspace = make(place / "workspace", CASES)
    (place / "elsewhere").mkdir()
    (place / "elsewhere/hil_test_outside.py").write_text("")
    (workspace.plan / "lib").mkdir()
    (workspace.plan / "lib/late.py").write_text("RATIO = 0.5\n")
    (workspace.root / "ref.csv").write_text("2.0\n")
    before = {name: (workspace.root / name).read_bytes() for name in EDITED}
    return workspace.run(), before


def held(ran, name):
    """Return what a package holds of a file, by the end of its path."""
    (found,) = [path for path in (ran.package.folder / "data").rglob("*") if path.as_posix().endswith(f"/{name}")]
    return found.read_bytes()


@pytest.mark.system
def test_what_an_editor_saves_while_a_run_is_collected_is_not_used(edited):
    """A module that rewrites its source, lock, bench, register or requirements changes nothing, and that is told."""
    ran, before = edited
    assert {name: held(ran, name.rpartition("/")[2]) for name in before} == before
    assert ran.verdicts()["test_uses_what_was_there"] == "PASS"
    changed = "changed on the disk while the run lasted; the run used the frozen bytes"
    told = [event["text"] for event in bodies(ran.package, "anomaly") if changed in event["text"]]
    assert told == [f"{name} {changed}" for name in sorted((*EDITED, "ref.csv"))]
    assert all(text in ran.page() for text in told)


def test_what_a_case_imports_or_opens_is_in_the_package(edited):
    """A module beside the cases, and a table that one of them opens: both decide about a verdict."""
    ran, _ = edited
    assert held(ran, "sources/testplans/small/lib/late.py") == b"RATIO = 0.5\n"
    assert held(ran, "sources/ref.csv") == b"2.0\n"
    (later,) = bodies(ran.package, "frozen-later")
    assert later["file"] == "data/sources/ref.csv"
    assert later["case"].endswith("::test_uses_what_was_there")
    assert verify(ran.package.folder).findings == ()
    found = replay(ran.package)
    assert not [each for each in found.differences if "test_uses_what_was_there" in each]


def test_a_table_that_changed_is_not_opened_a_second_time(edited):
    """No value comes from bytes that the package does not hold."""
    ran, _ = edited
    assert ran.verdicts()["test_opens_what_changed"] == "ERROR"
    assert "ref.csv changed on the disk after it was frozen, and code opens it again" in ran.page()


def test_a_case_that_writes_into_its_plan_is_an_error(edited):
    """Also where it catches what it is told; it is told once."""
    ran, _ = edited
    for name, file in (("test_writes_into_its_plan", "table.csv"), ("test_writes_openly", "open.csv")):
        assert ran.verdicts()[name] == "ERROR"
        assert ran.reasons(name).count(f"code of the run writes to testplans/small/{file}") == 1


def test_people_see_what_pytest_shows_of_an_assertion(edited):
    """Frozen code has pytest's assertions, and the lines of the workspace's files."""
    ran, _ = edited
    lines = held(ran, "testplans/small/test_small.py").decode().splitlines()
    line = lines.index("    assert sorted([2, 1]) == [1, 3]") + 1
    assert "assert [1, 2] == [1, 3]" in ran.reasons("test_compares")
    assert f"(testplans/small/test_small.py:{line})" in ran.reasons("test_compares")


def test_code_from_outside_of_the_workspace_is_refused(edited):
    """No package would hold it, and no version names it."""
    ran, _ = edited
    assert ran.verdicts()["test_uses_code_from_outside"] == "ERROR"
    assert "is neither in the workspace nor installed" in ran.reasons("test_uses_code_from_outside")


HIDDEN = """
import pytest

mark = pytest.mark.requirement("T-010")


@mark
def test_hidden(check):
    check("T-010", "ratio", 9.0)
"""


def test_no_folder_of_a_plan_hides_a_case(tmp_path):
    """Folders that pytest does not look into by itself."""
    workspace = make(tmp_path / "workspace", "def test_one():\n    pass")
    folders = ("build", ".sub", "venv/bin", "__pycache__", "lib")
    for folder in folders:
        (workspace.plan / folder).mkdir(parents=True)
        (workspace.plan / folder / "test_x.py").write_text(HIDDEN)
    with pytest.raises(ConfigurationError) as refused:
        workspace.run()
    assert workspace.folders() == []
    told = {finding.path: finding for finding in refused.value.findings}
    assert set(told) == {f"testplans/small/{folder}/test_x.py" for folder in folders}
    for finding in told.values():
        assert (finding.line, finding.column) in {(7, 1), (8, 1)}  # of its marker, or its own
        assert "cases belong in the folder of their plan" in finding.message or "like a case" in finding.message


NESTED = """
mark = pytest.mark.requirement("T-010")


@mark
def test_one(check):
    check("T-010", "ratio", 1.0)


def make():
    def test_nested(check):
        check("T-010", "ratio", 9.0)

    class TestInner:
        def test_method(self, check):
            check("T-010", "ratio", 9.0)

    test_local = mark(lambda check: check("T-010", "ratio", 9.0))
    test, rest = divmod(max(7, 9, key=lambda each: -each), 2)

    @mark
    def test_made(check):
        check("T-010", "ratio", 1.0)

    return test_made


test_l = mark(lambda check: check("T-010", "ratio", 9.0))
other = pytest.mark.requirement("T-010")(lambda check: check("T-010", "ratio", 9.0))
test_made = make()
test_values = math.hypot(3.0, 4.0)
test_table = {"a": 1}
"""


def test_no_way_to_write_a_case_hides_it(tmp_path):
    """Nested functions, lambdas, classes in functions; what is made by a function and collected is fine."""
    workspace = make(tmp_path / "workspace", NESTED)
    with pytest.raises(ConfigurationError) as refused:
        workspace.run()
    lines = (workspace.plan / "test_small.py").read_text().splitlines()
    told = {(each.message.split("'")[1], lines[each.line - 1][each.column - 1 :]) for each in refused.value.findings}
    assert {(name, text.partition("(")[0]) for name, text in told} == {
        ("test_nested", "def test_nested"),
        ("test_method", "def test_method"),
        ("test_local", "test_local = mark"),
        ("test_l", "test_l = mark"),
        ("other", "other = pytest.mark.requirement"),
    }
