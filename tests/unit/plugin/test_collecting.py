"""The process of a run looks for garbage from the moment its bench is there."""

from __future__ import annotations

import gc
from collections.abc import Iterator

import pytest

from hil.plugin.running import _collect_from_now_on


@pytest.fixture
def off() -> Iterator[None]:
    """Do not collect, as the process of a run does when it starts."""
    gc.disable()
    yield
    gc.enable()


def test_what_is_loaded_is_left_out_and_what_comes_is_collected(off):
    """A circle that was there before is never looked at again."""
    circle: list[object] = []
    circle.append(circle)
    before = gc.get_freeze_count()
    _collect_from_now_on()
    assert gc.isenabled()
    assert gc.get_freeze_count() > before
    assert not any(each is circle for each in gc.get_objects())


def test_a_process_that_collects_already_is_left_alone():
    """A run inside of another process, such as a test, freezes nothing of it."""
    before = gc.get_freeze_count()
    _collect_from_now_on()
    assert gc.get_freeze_count() == before
