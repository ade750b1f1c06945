"""Threads and forked copies of a case: they compute, and neither drive the bench nor write evidence."""

from __future__ import annotations

from told_as_json import bodies
from workspaces import agreed, make

CASE = """
import os
import threading


def in_a_thread(work):
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.requirement("T-010")
def test_one(check, step, clock, record, field, supply):
    check("T-010", "ratio", 1.0)
    def stray():
        {body}
    {how}
"""


def ran(tmp_path, body, how):
    """Run one case."""
    return make(tmp_path / "workspace", CASE.format(body=body, how=how)).run()


def test_what_a_thread_tries_is_refused_and_an_error(tmp_path):
    """The case is an ERROR that says why, and the chain of the journal is whole."""
    for number, body in enumerate(
        (
            "check('T-010', 'ratio', 1.0)",
            "clock.sleep(1.0)",
            "record('field', field, duration=1.0, rate=40.0)",
            "step('Stray').__enter__()",
        )
    ):
        found = ran(tmp_path / str(number), body, "in_a_thread(stray)")
        agreed(found, {"test_one": "ERROR"}, "ERROR", 1)
        assert "from another thread" in found.reasons("test_one")


def test_a_thread_that_computes_is_nobodys_business(tmp_path):
    """What drives nothing and writes nothing is free."""
    agreed(ran(tmp_path, "sum(range(1000))", "in_a_thread(stray)"), {"test_one": "PASS"}, "PASS", 0)


def test_a_forked_copy_writes_nothing_and_ends_with_the_case(tmp_path):
    """Whatever it tries and wherever it goes on, there is one run, and its journal is whole."""
    how = """
    copy = os.fork()
    if copy == 0:
        try:
            stray()
        except Exception:
            pass
        return
    assert os.waitstatus_to_exitcode(os.waitpid(copy, 0)[1]) == 1
"""
    found = ran(tmp_path, "check('T-010', 'ratio', 9.0)", how.strip())
    agreed(found, {"test_one": "PASS"}, "PASS", 0)
    assert len(bodies(found.package, "check")) == 1
