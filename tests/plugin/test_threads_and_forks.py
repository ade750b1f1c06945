"""Threads and forked copies of a case: they compute, and neither drive the bench nor write evidence."""

from __future__ import annotations

import os
import signal

from told_as_json import bodies
from workspaces import agreed, make

from hil.bench.lease import holds_a_lease
from hil.evidence.folder import is_held

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


def test_a_copy_that_outlives_the_run_does_not_hold_its_bench(tmp_path):
    """The next run on the same bench begins, and the folder of the first is nobody's."""
    copies = tmp_path / "copies"
    copies.touch()
    how = f"""
    copy = os.fork()
    if copy == 0:
        os.setsid()
        import signal
        signal.alarm(60)
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        signal.pause()
    with open({str(copies)!r}, "a") as file:
        file.write(f"{{{{copy}}}} ")
"""
    workspace = make(tmp_path / "workspace", CASE.format(body="pass", how=how.strip().format()))
    try:
        for _ in range(2):
            found = workspace.run()
            agreed(found, {"test_one": "PASS"}, "PASS", 0)
            assert not is_held(found.package.folder)
            assert not holds_a_lease(found.package.name)
        assert len(copies.read_text().split()) == 2
    finally:
        for copy in map(int, copies.read_text().split()):
            os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)
