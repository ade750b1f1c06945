"""Threads and forked copies of a case: they compute, and neither drive the bench nor write evidence."""

from __future__ import annotations

import os
import signal

import pytest
from told_as_json import bodies
from workspaces import agreed, make

from hil.bench.lease import holds_a_lease
from hil.evidence.folder import is_held

pytestmark = pytest.mark.system  # each test is a whole run

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


def test_a_check_in_a_forked_copy_is_an_error_and_the_copy_ends_with_the_case(tmp_path):
    """Whatever it tries, swallows, and wherever it goes on, there is one run, its journal is whole, and it is told."""
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
    agreed(found, {"test_one": "ERROR"}, "ERROR", 1)
    assert "from a forked process" in found.reasons("test_one")
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
            agreed(found, {"test_one": "ERROR"}, "ERROR", 1)
            assert "a process that the case forked outlives it" in found.reasons("test_one")
            assert not is_held(found.package.folder)
            assert not holds_a_lease(found.package.name)
        assert len(copies.read_text().split()) == 2
    finally:
        for copy in map(int, copies.read_text().split()):
            os.kill(copy, signal.SIGKILL)
            os.waitpid(copy, 0)


ESCAPES = {
    "a pool whose results nobody asks for": (
        """
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context
    with ProcessPoolExecutor(1, get_context("fork"), initializer=lend, initargs=(check,)) as pool:
        pool.submit(bad)
""",
        "from a forked process",
    ),
    "a fixture that is pickled": (
        """
    import pickle
    try:
        pickle.dumps({"mine": [check]})
    except Exception:
        pass
""",
        "the case copies `check`, or hands it to another process",
    ),
    "a role that is copied": (
        """
    import copy
    try:
        copy.deepcopy(supply.coil)
    except Exception:
        pass
""",
        "the case copies a role, or hands it to another process",
    ),
    "a thread that goes on": (
        """
    threading.Thread(target=go_on.wait, args=(60.0,), name="poller", daemon=True).start()
""",
        "thread 'poller' outlives the case",
    ),
    "a thread without an object": (
        """
    import _thread, time
    _thread.start_new_thread(go_on.wait, (60.0,))
    time.sleep(0.05)
""",
        "outlives the case",
    ),
    "an exception under a filter": (
        """
    in_a_thread(fail)
""",
        "ValueError: out of range (testplans/small/test_small.py:",
    ),
    "an exception of a thread without an object": (
        """
    import _thread, time
    _thread.start_new_thread(fail, ())
    time.sleep(0.05)
""",
        "ValueError: out of range",
    ),
    "a hook of its own": (
        """
    threading.excepthook = lambda args: None
    in_a_thread(fail)
""",
        "the case replaced threading.excepthook",
    ),
}

ESCAPING = """
import os
import threading

go_on = threading.Event()
lent = []


def lend(given):
    lent.append(given)


def bad():
    lent[0]("T-010", "ratio", 9.0)


def fail():
    raise ValueError("out of range")


def in_a_thread(work):
    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
"""


def test_nothing_escapes_a_case(tmp_path):
    """Worker processes, threads that outlive their case, exceptions in them, own hooks: an ERROR that names each."""
    cases = [
        f"""
@pytest.mark.filterwarnings("ignore")
@pytest.mark.requirement("T-010")
def test_{number}(check, supply):
    check("T-010", "ratio", 1.0)
    {body.strip()}
"""
        for number, (body, _) in enumerate(ESCAPES.values())
    ]
    found = make(tmp_path / "workspace", "\n".join([ESCAPING, *cases])).run()
    assert found.verdicts() == {f"test_{number}": "ERROR" for number in range(len(ESCAPES))}, found.out
    for number, (_, why) in enumerate(ESCAPES.values()):
        assert why in found.reasons(f"test_{number}"), why


SHORT = """
@pytest.fixture
def after(record, field):
    yield
    record("field", field, duration=0.5, rate=40.0)


@pytest.mark.requirement("T-030")
def test_one(field, record, after):
    record("field", field, duration=2.0, rate=40.0)
"""


def test_a_recording_is_judged_with_those_of_the_teardown(tmp_path):
    """A good recording in the body, and a short one of that name in the teardown: the poorer one counts."""
    good = make(tmp_path / "good", SHORT.replace("0.5, rate", "2.0, rate")).run()
    agreed(good, {"test_one": "RECORDED"}, "RECORDED", 0)
    short = make(tmp_path / "short", SHORT).run()
    agreed(short, {"test_one": "FAIL"}, "FAIL", 1)
    assert "duration" in short.reasons("test_one")
