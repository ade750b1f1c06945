"""What a run executed is compared with what was installed: also what came late, and what a compiled copy says."""

from __future__ import annotations

import base64
import dis
import hashlib
import importlib
import json
import math
import os
import py_compile
import socket
import sys
from importlib import metadata
from importlib.util import cache_from_source
from types import CodeType, ModuleType

import msgspec
import pytest
from evidence_runs import SOFTWARE, run_fields
from serial import serialutil
from typed_events import event_of

from hil.documents.canonical import canonical, parse_strict
from hil.documents.snapshot import Snapshot
from hil.evidence import events
from hil.evidence.events.codec import convert
from hil.evidence.results.eligibility import of_run
from hil.evidence.results.facts import Facts
from hil.evidence.results.software import FrozenSoftware
from hil.evidence.state import fold
from hil.executive.setup import auditing, executed, other_code
from hil.executive.setup.executed import Executed
from hil.guardian.ports import hosted
from hil.model.identity import Source

LATE = "LEVEL = 1.0\n\n\ndef level():\n    return LEVEL\n"
FALSE = LATE.replace("1.0", "2.0")
TWIN = "late_dmm/late.py of late-dmm 1.2"


class Inputs:
    """A workspace in which nothing is frozen."""

    def __init__(self, root):
        self.root = root
        self.snapshot = Snapshot()

    def shown(self, path):
        """Return a path in the workspace."""
        return path.relative_to(self.root).as_posix()


@pytest.fixture
def nothing_yet(monkeypatch):
    """Forget what other tests executed in this process, or in those of wrapped drivers: to compare it takes seconds."""
    auditing.begin()
    monkeypatch.setattr(auditing, "_executed", [])
    monkeypatch.setattr(executed, "files_executed", tuple)


@pytest.fixture
def package(tmp_path, monkeypatch, nothing_yet):
    """Install a package that nobody needs, and return the module that it would import late."""
    folder = tmp_path / "site-packages"
    late = folder / "late_dmm/late.py"
    late.parent.mkdir(parents=True)
    late.write_text(LATE, encoding="utf-8")
    (late.parent / "__init__.py").touch()
    info = folder / "late_dmm-1.2.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: late-dmm\nVersion: 1.2\n", encoding="utf-8")
    record(folder)
    monkeypatch.syspath_prepend(folder)
    only = list(metadata.Distribution.discover(path=[str(folder)]))
    monkeypatch.setattr(other_code.metadata, "distributions", lambda: only)
    monkeypatch.setattr(executed, "of_no_package", lambda *_: [])
    monkeypatch.setattr(executed, "other_packages", tuple)
    other_code._owners.cache_clear()
    yield late
    for name in [name for name in sys.modules if name.startswith("late_dmm")]:
        del sys.modules[name]
    other_code._owners.cache_clear()


def record(folder):
    """Write the RECORD of the package, as installers do."""
    names = ("late_dmm/__init__.py", "late_dmm/late.py")
    digests = {name: hashlib.sha256((folder / name).read_bytes()).digest() for name in names}
    lines = [f"{name},sha256={base64.urlsafe_b64encode(its).rstrip(b'=').decode()},1" for name, its in digests.items()]
    (folder / "late_dmm-1.2.dist-info/RECORD").write_text("\n".join([*lines, ""]), encoding="utf-8")


def compared(tmp_path, monkeypatch, act):
    """Return the packages and problems that are told of what is executed while `act` runs."""
    root = tmp_path / "own"
    root.mkdir()
    monkeypatch.setattr(executed, "product_source", dict)
    modules = {name: module for name, module in sys.modules.items() if name.startswith("late_dmm")}
    found = Executed(Inputs(root), modules, root / "no maps")
    assert found.new_problems() == ()
    act()
    return found.packages(), found.new_problems()


def test_a_late_import_is_named_and_compared(package, tmp_path, monkeypatch):
    """It is as its package has it: the package is named, and nothing is wrong."""
    told = compared(tmp_path, monkeypatch, lambda: importlib.import_module("late_dmm.late"))
    assert told == (("late-dmm 1.2",), ())


def test_a_late_import_that_was_changed_is_told(package, tmp_path, monkeypatch):
    """Nobody looked at it when the run began: only what offered something was compared."""
    package.write_text(FALSE, encoding="utf-8")
    _, problems = compared(tmp_path, monkeypatch, lambda: importlib.import_module("late_dmm.late"))
    assert problems == (f"{TWIN} is not as it was installed",)


def test_a_late_module_that_hides_afterwards_is_told(package, tmp_path, monkeypatch):
    """The interpreter tells what it executes, whatever the modules of the process are by then."""
    package.write_text(f"{FALSE}\nimport sys\ndel sys.modules['late_dmm.late']\n", encoding="utf-8")

    def hidden():
        with pytest.raises((KeyError, ImportError)):
            importlib.import_module("late_dmm.late")

    _, problems = compared(tmp_path, monkeypatch, hidden)
    assert problems == (f"{TWIN} is not as it was installed",)


@pytest.mark.parametrize("before", [False, True], ids=["heard", "loaded before"])
def test_a_compiled_copy_of_another_source_is_told(package, tmp_path, monkeypatch, before):
    """Its time and size are those of the source, so that Python believes it."""
    times = package.stat().st_atime_ns, package.stat().st_mtime_ns
    package.write_text(FALSE, encoding="utf-8")
    os.utime(package, ns=times)
    py_compile.compile(str(package), cache_from_source(str(package)), doraise=True)
    package.write_text(LATE, encoding="utf-8")
    os.utime(package, ns=times)

    def late():
        assert importlib.import_module("late_dmm.late").level() == 2.0

    if before:
        late()
        root = tmp_path / "own"
        root.mkdir()
        monkeypatch.setattr(executed, "product_source", dict)
        monkeypatch.setattr(auditing, "_executed", [])
        found = Executed(Inputs(root), {"late_dmm.late": sys.modules["late_dmm.late"]}, root / "no maps")
        problems = found.new_problems()
    else:
        _, problems = compared(tmp_path, monkeypatch, late)
    told = (
        "late_dmm/late.py was executed otherwise than its source says, such as from a compiled copy of another source"
    )
    assert problems == (told,)


@pytest.mark.parametrize("source", [LATE, FALSE], ids=["as installed", "changed"])
def test_the_code_of_a_vendors_process_is_named_and_compared(package, tmp_path, monkeypatch, source):
    """Also what it imports within a call: this process never loads it."""
    maker = "class Made:\n    def __init__(self, place): pass\n    def level(self):\n        import late_dmm.late\n"
    (package.parent / "__init__.py").write_text(maker, encoding="utf-8")
    record(package.parents[1])
    package.write_text(source, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(package.parents[1]))
    monkeypatch.setattr(hosted, "_written", [])
    inside = f"{package.parent}{os.sep}"  # the other packages of this environment are not installed here
    monkeypatch.setattr(
        executed, "files_executed", lambda: [f for f in hosted.files_executed() if f.startswith(inside)]
    )
    vendor = socket.socket(fileno=hosted.connected_to("hosted://late_dmm:Made/x"))

    def call():
        vendor.sendall(b'{"number": 1, "call": "level"}\n')
        assert b'"number":1' in vendor.recv(1000)

    with vendor:
        before = hosted.files_executed()
        packages, problems = compared(tmp_path, monkeypatch, call)
    assert str(package.parent / "__init__.py") in before
    assert str(package) not in before
    assert "late_dmm" not in sys.modules
    assert packages == ("late-dmm 1.2",)
    assert problems == ((f"{TWIN} is not as it was installed",) if source != LATE else ())


def test_code_that_ran_often_is_still_its_source(package, tmp_path, monkeypatch):
    """The interpreter changes code while it runs; that is no difference."""

    def often():
        late = importlib.import_module("late_dmm.late")
        for _ in range(100):
            late.level()

    assert compared(tmp_path, monkeypatch, often)[1] == ()


def test_code_of_no_package_and_of_the_workspace_is_told(package, tmp_path, monkeypatch):
    """A module beside everything, and one of the workspace that nobody froze."""
    stray, own = tmp_path / "stray.py", tmp_path / "own/helper.py"

    def both():
        for path in (stray, own):
            path.write_text("A = 1\n", encoding="utf-8")
            exec(compile(path.read_text(), str(path), "exec"), {})  # noqa: S102 - as a loader does

    _, problems = compared(tmp_path, monkeypatch, both)
    assert sorted(problems) == [
        "helper.py was executed, and was not frozen",
        f"{tmp_path.name}/stray.py was executed, and is of no installed package",
    ]


def test_what_the_product_needs_is_not_named():
    """But by its version, in the list of all packages."""
    needed = other_code.needed()
    assert {"hil", "numpy", "msgspec", "pytest", "pluggy"} <= needed
    assert "hypothesis" not in needed


LIAR = """
from dataclasses import dataclass
@dataclass
class Terminals:
    level: float = 1.0
    def number(self): return self.level
    @property
    def double(self): return 2 * self.level
"""


@pytest.mark.usefixtures("nothing_yet")
@pytest.mark.parametrize("name", ["number", "double", "Terminals.number", "Terminals.double"])
def test_a_part_of_hil_that_others_replaced_before_is_told(tmp_path, monkeypatch, name):
    """By a driver when it was imported, or a line of a `.pth` file: before the case's own code is looked at."""
    module = ModuleType("hil.terminals")
    monkeypatch.setitem(sys.modules, "hil.terminals", module)
    monkeypatch.setattr(executed, "product_source", dict)
    exec(compile(LIAR, executed.__file__, "exec"), vars(module))  # noqa: S102
    exec(compile("def number(self): return 100.0", executed.__file__, "exec"), vars(module))  # noqa: S102
    ran = Executed(Inputs(tmp_path), {"hil.terminals": module, "late": module}, tmp_path / "no maps")
    assert [each for each in ran.last_problems() if "replaced" in each] == []
    false = {}
    exec(compile("def number(self): return 100.0", str(tmp_path / "lying_psu/driver.py"), "exec"), false)  # noqa: S102
    owner, _, called = name.rpartition(".")
    value = property(false["number"]) if called == "double" else false["number"]
    setattr(module.Terminals if owner else module, called, value)
    (told,) = (each for each in ran.last_problems() if "replaced" in each)
    assert told == f"lying_psu/driver.py replaced hil.terminals.{name}, which is a part of hil"


@pytest.mark.usefixtures("nothing_yet")
@pytest.mark.parametrize(
    ("module", "owner", "name", "told"),
    [
        (serialutil, serialutil.SerialBase, "read_until", "serial.serialutil.SerialBase.read_until"),
        (socket, socket.socket, "recv", "socket.socket.recv"),
        (json, json, "dumps", "json.dumps"),
        (math, math, "hypot", "math.hypot"),
        (json, json, "of_an_extension", ""),
    ],
)
def test_a_function_of_a_library_that_others_replaced_is_told(tmp_path, monkeypatch, module, owner, name, told):
    """What drives ports and counts figures can lie as well as hil; what a library took from others is its own."""
    monkeypatch.setattr(executed, "product_source", dict)
    ran = Executed(Inputs(tmp_path), {module.__name__: module, "its alias": module}, tmp_path / "no maps")
    assert [each for each in ran.last_problems() if "replaced" in each] == []
    false = {}
    source = "def lie(*given): return b'4.98E-02'"
    exec(compile(source, str(tmp_path / "quiet/lies.py"), "exec"), false)  # noqa: S102
    monkeypatch.setattr(owner, name, false["lie"], raising=False)
    found = [each for each in ran.last_problems() if "replaced" in each]
    assert found == ([f"quiet/lies.py replaced {told}, which hil is built on"] if told else [])


@pytest.mark.usefixtures("nothing_yet")
def test_a_library_of_machine_code_of_nobody_is_told(tmp_path, monkeypatch):
    """Whoever loaded it, and also when its file is gone; what is of the system, of Python or of a package is not."""
    maps, start = tmp_path / "maps", "7f00-7f10 r-xp 0000 08:01 1 "
    known = ("/usr/lib/libm.so.6", os.path.realpath(sys.executable), msgspec._core.__file__, "[vdso]")
    data = f"7f20-7f30 r--p 0000 08:01 1 {tmp_path}/table.bin\n7f40-7f50 rw-p 0000 00:00 0\n"
    maps.write_text(data + "".join(f"{start}{each}\n" for each in known), encoding="utf-8")
    monkeypatch.setattr(executed, "product_source", dict)
    ran = Executed(Inputs(tmp_path), {}, maps)
    assert not [each for each in (*ran.new_problems(), *ran.new_problems()) if "library" in each]
    with maps.open("a", encoding="utf-8") as file:
        file.write(f"{start}{tmp_path}/own clock.so (deleted)\n")
    told = "the library own clock.so was loaded, which is neither of the system nor of an installed package"
    assert told in ran.new_problems()
    assert told not in ran.last_problems()


def judged(*told, format_=3, source=Source.HARDWARE):
    """Return the condition about what ran: texts and whether they are proven."""
    run = {"source": source, "purpose": "acceptance", "operator": "Ada"}
    software = convert(parse_strict(canonical({**SOFTWARE, "format": format_})), FrozenSoftware, "software")
    state = fold((event_of("run", **(run_fields() | run)), *told))
    found = of_run(state, Facts(catalogue={}, software=software))
    return {each.text: each.proven for each in found if each.name == "executed"}


def test_hardware_proves_what_ran():
    """A problem that was told after any case is one, and so is a run that did not compare."""
    last = events.Executed(packages=("late-dmm 1.2",), last=True)
    assert judged(last) == {"the code that ran is as it was installed, that of late-dmm 1.2 included": True}
    assert judged(events.Executed(problems=("a was changed",)), last) == {"a was changed": False}
    missing = "the code that ran was not compared with what was installed when the run ended"
    assert judged() == {missing: False}
    assert judged(format_=2) == judged(source=Source.SIMULATED) == {}


LOOP = """
def heard(events):
    for event in events:
        match event:
            case int():
                found = True
            case str():
                found = False
            case _:
                try:
                    found = event.found
                except AttributeError:
                    found = None
    return found
"""


def test_a_jump_to_a_jump_is_the_jump_to_where_that_leads():
    """The compiler takes either; another constant, name or order of steps is another code."""
    code = compile(LOOP, "x", "exec")
    (one,) = [each for each in code.co_consts if isinstance(each, CodeType)]
    first, second, *_ = (each for each in dis.get_instructions(one) if each.opname == "JUMP_BACKWARD")
    assert first.argval == second.argval
    raw = bytearray(one.co_code)
    raw[first.offset] = dis.opmap["JUMP_FORWARD"]
    raw[first.offset + 1] = (second.offset - first.offset - 2) // 2
    other = one.replace(co_code=bytes(raw))
    assert other != one
    assert executed._is_alike(other, one)
    for old, new in (
        ("True", "1"),
        ("event.found", "event.lost"),
        ("int()", "float()"),
        ("AttributeError", "KeyError"),
        ("events):", "events, more=1):"),
        ("found = None", "found = event"),
    ):
        changed = compile(LOOP.replace(old, new), "x", "exec")
        assert not executed._is_alike(changed, code)


CHOICE = """
def heard(event):
    if event:
        found = 1.0
    else:
        found = 2.0
    return event.found(found, found) + event.lost(found)
"""


def test_a_jump_or_a_step_without_effect_more_is_the_same_code():
    """Python leaves them in place, or not; where they lead to another step, the code is another one."""
    (one,) = [each for each in compile(CHOICE, "x", "exec").co_consts if isinstance(each, CodeType)]
    jump = next(each for each in dis.get_instructions(one) if each.opname == "JUMP_FORWARD")
    raw, place = bytearray(one.co_code), len(one.co_code)
    raw += bytes((dis.opmap["NOP"], 0, dis.opmap["JUMP_BACKWARD"], (place + 4 - jump.argval) // 2))
    raw[jump.offset + 1] = (place - jump.offset - 2) // 2
    assert executed._is_alike(one.replace(co_code=bytes(raw)), one)
    raw[place + 3] += 1
    assert not executed._is_alike(one.replace(co_code=bytes(raw)), one)
