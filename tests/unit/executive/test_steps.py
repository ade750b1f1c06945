"""Steps: numbered, nested, and ended with their case."""

from __future__ import annotations

import pytest
from case_parts import Written

from hil.executive.cases.steps import Steps


def made():
    """Return steps, what they write, and a clock that counts."""
    written = Written()
    seconds = iter(range(100))
    return Steps("case", written, lambda: float(next(seconds))), written


def test_steps_are_numbered_as_they_nest():
    """Siblings count on, inner steps begin at one in each."""
    steps, written = made()
    numbers = [steps.number]
    with steps("A"):
        with steps("B"):
            numbers.append(steps.number)
        with steps("C"):
            numbers.append(steps.number)
    with steps("D"), steps("E"):
        numbers.append(steps.number)
    assert numbers == ["", "1.1", "1.2", "2.1"]
    assert steps.number == ""
    begun = [(step["number"], step["path"]) for step in written.of("step")]
    assert begun == [("1", ("A",)), ("1.1", ("A", "B")), ("1.2", ("A", "C")), ("2", ("D",)), ("2.1", ("D", "E"))]


def test_a_step_tells_its_outcome_and_duration():
    """A step that something was raised in is told apart from one that was done."""
    steps, written = made()
    with steps("A"):
        pass
    with pytest.raises(ValueError, match="x"), steps("B"):
        raise ValueError("x")
    assert [(end["outcome"], end["duration"]) for end in written.of("step-end")] == [("done", 1.0), ("raised", 1.0)]


def test_close_ends_what_is_open_and_nothing_twice():
    """Steps that somebody still holds end with their case, the inner one first, and never again."""
    steps, written = made()
    outer, inner = steps("A"), steps("B")
    outer.__enter__()
    inner.__enter__()
    steps.close()
    assert [(end["number"], end["outcome"]) for end in written.of("step-end")] == [("1.1", "raised"), ("1", "raised")]
    inner.__exit__(None, None, None)
    outer.__exit__(None, None, None)
    steps.close()
    assert len(written.of("step-end")) == 2


def test_a_step_whose_end_cannot_be_written_is_over():
    """The reason is told once; ending the case does not fail in its turn because of it."""
    steps, written = made()
    step = steps("A")
    step.__enter__()
    written.write = lambda _: (_ for _ in ()).throw(OSError("the disk is full"))
    with pytest.raises(OSError, match="the disk is full"):
        step.__exit__(None, None, None)
    steps.close()
    assert steps.number == ""


def test_a_step_that_is_left_late_does_not_end_another():
    """A loop that is dropped while another step is open leaves that one alone."""
    steps, written = made()
    stale = steps("A")
    stale.__enter__()
    steps.close()
    with steps("B"):
        stale.__exit__(None, None, None)
        assert steps.number == "2"
    assert [end["path"] for end in written.of("step-end")] == [("A",), ("B",)]
