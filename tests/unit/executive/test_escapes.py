"""What a case lets escape is told when it ends."""

from __future__ import annotations

import time

import pytest

from hil.executive.cases.escapes import Escapes
from hil.executive.ending.stop import StopFlags


@pytest.mark.parametrize("when", ["before", "in its body"])
def test_a_clock_that_was_replaced_is_told_once(when, monkeypatch, tmp_path):
    """Also where it was put back before the case ended."""
    escapes, told = Escapes(StopFlags(), tmp_path), []
    with monkeypatch.context() as patched:
        if when == "before":
            patched.setattr(time, "time", lambda: 0.0)
            escapes.begin()
        else:
            escapes.begin()
            patched.setattr(time, "time", lambda: 0.0)
            escapes.hear(lambda error, _: told.append(str(error)))
    escapes.end(lambda error, _: told.append(str(error)))
    (only,) = told
    assert "the case ran with replaced clocks: time.time" in only
