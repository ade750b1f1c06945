"""The guardian of a run, as the executive starts it and lets it go."""

from __future__ import annotations

import signal
import time
from types import SimpleNamespace

import pytest
from guarded import Instrument, output_of, plan_of

from hil.executive.ending.stop import StopFlags
from hil.executive.watching import machine as guarding
from hil.executive.watching.machine import Guarding
from hil.model.bench import BenchHead
from hil.model.errors import Refused


class Watchful:
    """A guardian that finds every output safe, and notes what it is told."""

    def __init__(self):
        self.told = []
        self.stays_for = ()

    def drill(self):
        """Find nothing wrong."""
        return ()

    disarm = drill

    def watch(self):
        """Watch from now on."""
        self.told.append("watch")

    def beat(self, _fresh_until):
        """Hear that the run lives."""
        self.told.append("beat")

    def close(self):
        """Go."""
        self.told.append("close")


def test_a_guardian_that_watches_hears_of_the_run_also_where_no_latch_can_be_written(tmp_path, monkeypatch):
    """The bench is not armed then; but silence would let the guardian end the run on its way to the safe state."""
    guardian, clock = Watchful(), SimpleNamespace(pulse=lambda: None, boot_s_of=float)
    spec = SimpleNamespace(head=BenchHead(name="battery", title="Cells"), safe_off=(), rest=(), hold=(), wiring=())
    plan = SimpleNamespace(bench="battery", names=(), hang_s=1.0)
    monkeypatch.setattr(guarding, "plan_of", lambda *_: plan)
    monkeypatch.setattr(guarding.Guardian, "start", lambda *_: guardian)

    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(guarding, "latch_bench", full)
    bench = SimpleNamespace(spec=spec, descriptors={})
    guard = Guarding(bench, clock, StopFlags(), folder=tmp_path, leases=["psu1"], locks=[])
    (gate,) = guard.begin(SimpleNamespace(fresh_until_ns=None))
    assert not gate.ok
    assert "No space left" in gate.detail
    clock.pulse()
    assert guardian.told == ["watch", "beat"]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(guarding, "clear_latches_of", lambda _: ())
        assert guard.end(proven=True) == []
    assert guardian.told[-1] == "close"


def test_the_latches_of_an_armed_bench_are_renewed_now_and_then(tmp_path, monkeypatch):
    """Every ten minutes, with the heartbeat; not any more once the run lets go of the bench."""
    guardian, clock = Watchful(), SimpleNamespace(pulse=lambda: None, boot_s_of=float)
    spec = SimpleNamespace(head=BenchHead(name="battery", title="Cells"), safe_off=(), rest=(), hold=(), wiring=())
    plan = SimpleNamespace(bench="battery", names=(), hang_s=1.0)
    monkeypatch.setattr(guarding, "plan_of", lambda *_: plan)
    monkeypatch.setattr(guarding.Guardian, "start", lambda *_: guardian)
    monkeypatch.setattr("hil.guardian.latch.PLACES", (tmp_path / "latches",))
    now = [0.0]
    monkeypatch.setattr(guarding.wall, "monotonic", lambda: now[0])
    guard = Guarding(
        SimpleNamespace(spec=spec, descriptors={}), clock, StopFlags(), folder=tmp_path, leases=["psu1"], locks=[]
    )
    assert all(gate.ok for gate in guard.begin(SimpleNamespace(fresh_until_ns=None)))
    (latch,) = (tmp_path / "latches").iterdir()
    latch.unlink()
    for now[0], there in ((599.0, False), (601.0, True)):
        clock.pulse()
        assert latch.exists() is there
    latch.unlink()
    guardian.disarm = lambda: ()
    guard.end(proven=True)
    now[0] = 2000.0
    clock.pulse()
    assert not latch.exists()


def test_an_arming_may_take_long_as_long_as_its_gates_pass(tmp_path, monkeypatch):
    """Each gate has its time, and all of them together; who waits for one for ever is ended."""
    guardian, clock = Watchful(), SimpleNamespace(pulse=lambda: None, boot_s_of=lambda ns: ns / 1e9)
    steps = (SimpleNamespace(output="psu1.1", within_s=40.0),)
    spec = SimpleNamespace(head=BenchHead(name="battery", title="Cells"), safe_off=steps, rest=(), hold=(), wiring=())
    plan = SimpleNamespace(bench="battery", names=(), hang_s=1.0)
    monkeypatch.setattr(guarding, "plan_of", lambda *_: plan)
    monkeypatch.setattr(guarding.Guardian, "start", lambda *_: guardian)
    monkeypatch.setattr(guarding, "latch_bench", lambda *_, **__: None)
    now, good = [1000.0], []
    monkeypatch.setattr(guarding.wall, "monotonic", lambda: now[0])
    monkeypatch.setattr(guarding.wall, "stamp", lambda: SimpleNamespace(boot=now[0]))
    guardian.beat = good.append
    freshness = SimpleNamespace(fresh_until_ns=None)
    bench = SimpleNamespace(spec=spec, descriptors={})
    guard = Guarding(bench, clock, StopFlags(), folder=tmp_path, leases=["psu1"], locks=[])
    assert all(gate.ok for gate in guard.begin(freshness))

    def good_for() -> float:
        now[0] += 1.0
        clock.pulse()
        return good[-1] - now[0]

    assert good_for() == 99.0
    assert good_for() == 98.0
    for _ in range(15):
        now[0] += 90.0
        guard.passed()
        assert good_for() == 99.0
    now[0] = 2790.0
    guard.passed()
    assert good_for() == 9.0
    freshness.fresh_until_ns = 2800 * 10**9
    guard.passed()
    assert good_for() == 9.0


def test_all_is_switched_off_with_what_the_guardian_would_send(tmp_path, monkeypatch):
    """The guardian hears of the run meanwhile; where the bytes are not known the drivers are left to it."""
    psu, beats = Instrument(2), []
    spec = SimpleNamespace(safe_off=(), rest=(), hold=(), wiring=())
    plan = plan_of(tmp_path, output_of("one", "psu"), output_of("two", "psu", 2))
    bench = SimpleNamespace(spec=SimpleNamespace(**vars(spec), head=BenchHead(name="b", title="B")))
    bench.descriptors = {"psu": psu.near}
    guard = Guarding(bench, SimpleNamespace(), StopFlags(), folder=tmp_path, leases=["psu"], locks=[])
    monkeypatch.setattr(guard, "pulse", lambda: beats.append("beat"))
    monkeypatch.setattr(guarding, "plan_of", lambda *_: plan)
    guard.switch_off()
    assert (psu.on, bool(beats)) == (set(), True)
    psu.close()

    def refused(*_):
        raise Refused("no bytes for two")

    monkeypatch.setattr(guarding, "plan_of", refused)
    guard.switch_off()


def test_a_disk_that_is_slow_to_take_the_latch_does_not_silence_the_run(tmp_path, monkeypatch):
    """The guardian watches by then, and would end an arming that is silent for a second."""
    guardian, clock = Watchful(), SimpleNamespace(pulse=lambda: None, boot_s_of=float)
    spec = SimpleNamespace(head=BenchHead(name="battery", title="Cells"), safe_off=(), rest=(), hold=(), wiring=())
    plan = SimpleNamespace(bench="battery", names=(), hang_s=1.0)
    monkeypatch.setattr(guarding, "plan_of", lambda *_: plan)
    monkeypatch.setattr(guarding.Guardian, "start", lambda *_: guardian)
    began: list[float] = []
    beats: list[float] = []
    guardian.beat = lambda _: beats.append(time.monotonic())

    def slow(*_, **__):
        blocked = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})  # as the kernel does for a disk
        began.append(time.monotonic())
        time.sleep(0.3)
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)

    monkeypatch.setattr(guarding, "latch_bench", slow)
    bench = SimpleNamespace(spec=spec, descriptors={})
    guard = Guarding(bench, clock, StopFlags(), folder=tmp_path, leases=["psu1"], locks=[])
    guard.pulse()
    before = signal.signal(signal.SIGALRM, lambda *_: guard.between())
    signal.setitimer(signal.ITIMER_REAL, 0.02, 0.02)
    try:
        assert all(gate.ok for gate in guard.begin(SimpleNamespace(fresh_until_ns=None)))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert [at for at in beats if began[0] < at < began[0] + 0.25]
