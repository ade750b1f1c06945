"""What a source reaches for beyond what cases are given is told by line."""

from __future__ import annotations

import math

import pytest

from hil.executive.setup.reach import beyond, numbers_in, sleeps


@pytest.mark.parametrize(
    ("line", "what"),
    [
        ("import hil.executive.cases.checks as c", "imports hil.executive.cases.checks"),
        ("from hil.executive.cases import checks", "imports hil.executive.cases.checks"),
        ("import hil", "imports hil"),
        ("from hil import executive", "imports hil.executive"),
        ("from hil.model.provenance import Provenance", "imports hil.model.provenance.Provenance"),
        ("import ctypes.util", "imports ctypes.util"),
        ("from unittest import mock", "imports unittest.mock"),
        ("import gc", "imports gc"),
        ("import atexit", "imports atexit"),
        ("from importlib import import_module", "imports importlib.import_module"),
        ("exec('x = 1')", "uses exec"),
        ("f = __import__", "uses __import__"),
        ("sys.modules['hil.clock']", "uses .modules"),
        ("object.__setattr__(reading, 'value', 100.0)", "uses .__setattr__"),
        ("supply.load.__dict__['_role'] = fake", "uses .__dict__"),
        ("check._journal.write(event)", "uses ._journal"),
        ("getattr(supply.load, '_role')", "uses ._role"),
        ("figure.with_provenance(reading.provenance)", "uses .provenance"),
        ("setattr(judge, 'x', 1)", "uses setattr"),
        ("from hil.analysis.tracing import samples", "imports hil.analysis.tracing.samples"),
        ("from hil.analysis.coil import traced as mark", "imports hil.analysis.coil.traced"),
        ("mark = hil.analysis.coil.traced", "uses .traced"),
        ("def test_a(monkeypatch): pass", "uses monkeypatch"),
        ("import serial as wire; wire.Serial.read = quick", "replaces wire.Serial.read"),
        ("from serial import Serial; Again = Serial; Again.read = quick", "replaces Again.read"),
        ("import math; del math.hypot", "replaces math.hypot"),
        ("getattr(socket, 'socket').recv = quick", "replaces getattr(socket, 'socket').recv"),
    ],
)
def test_what_a_case_was_not_given_is_told(line, what):
    """Parts of the product that judge and record, names that begin with an underscore, code that no source shows."""
    assert f"testplans/x/test_x.py:2 {what}" in beyond(f"import sys\n{line}\n".encode(), "testplans/x/test_x.py")


@pytest.mark.parametrize(
    "line",
    [
        "from hil.plan import Figure",
        "from hil.analysis import characterise",
        "from hil import analysis",
        "import numpy as np, math, re",
        "def test_a(supply): getattr(supply, 'load').enable()",
        "class A:\n    def __init__(self): self._x = 1",
        "re.compile('x')",
        "name = __name__",
    ],
)
def test_what_cases_are_written_with_is_not(line):
    """The names of `hil.plan` and `hil.analysis`, and what an honest fixture is made of."""
    assert beyond(line.encode(), "x.py") == ()


def test_what_is_not_python_is_left_to_whoever_imports_it():
    """A file that Python cannot read cannot reach for anything."""
    assert beyond(b"def :", "x.py") == ()
    assert beyond(b"\0", "x.py") == ()


SOURCE = b"""
import math
import numpy as np
GAIN = 1 / 3.6
TWICE = 2 * GAIN

def test_a(reading):
    offset = -0.25
    use(reading * np.pi / 180 * TWICE ** 2, 100 / reading.value, 10 ** 400, 1 / 0)
"""


def test_numbers_that_stand_in_a_source_are_found():
    """Also as a sum or quotient of such numbers, by a name, and of either sign; what a reading is part of is not."""
    found = numbers_in(SOURCE)
    assert {1 / 3.6, 2 / 3.6, 0.25, math.pi, 180.0, 100.0} <= found
    assert 100 / 120.0 not in found
    assert numbers_in(b"def :") == frozenset()


@pytest.mark.parametrize(
    "source",
    [
        b"import time\ntime.sleep(1)",
        b"from time import sleep\nsleep(1)",
        b"import time as wall\nwall.sleep(1)",
        b"from time import sleep as nap\nnap(1)",
    ],
)
def test_a_call_of_time_sleep_is_told_with_its_line(source):
    """By whatever name: no bench time passes in it on a simulated bench, and on no bench is a limit watched."""
    (told,) = sleeps(source, "testplans/x/test_x.py")
    assert told.startswith("testplans/x/test_x.py:2 calls time.sleep, ")
    assert told.endswith("use clock.sleep")


def test_other_waits_are_not():
    """What the case is given waits in bench time; a name alone is no call."""
    assert sleeps(b"import time\nclock.sleep(1)\nsleep(2)\nuse(time.sleep)", "x.py") == ()
    assert sleeps(b"def :", "x.py") == ()
