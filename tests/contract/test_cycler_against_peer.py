"""The driver of the battery cycler against the simulated device, in both levels."""

from __future__ import annotations

import numpy as np
import pytest
from cycler_bench import Bench, cycler, wire

from hil.clock.virtual import VirtualClock
from hil.instruments.cycler.tester import BatteryCycler
from hil.instruments.driver import Clamps, Connection, Outlet
from hil.model.errors import DeviceFault, NoReply, Refused, Rejected, WrongIdentity
from hil.model.identity import Identity
from hil.wire.exchange import publish_stream, withdraw
from hil.wire.opening import open_port
from hil.wire.replay import Playback, ReplayedStream
from hil.wire.transcript import Transcript

LEVEL_1 = {"truth": {"level": "1", "cycles": "1"}, "settings": {"level": "1", "cycles": "1"}}


def begun(bench, cycles=1, rest=0.0, **limits):
    """Prepare a test, begin a stream, and start the test."""
    bench.role.prepare(cycles, rest, **limits)
    bench.role.begin(0.2)
    bench.role.start()
    return bench


def test_a_whole_test_of_level_2():
    """Prepared, started, followed to its end: phases, cycles and states are the device's, every line comes."""
    with cycler(lines=3) as bench:
        assert bench.driver.identify() == Identity(model="hil-cycler", serial="C0001", firmware="SIM.0")
        assert bench.driver.outlets() == (Outlet(0, on=False),)
        assert (bench.role.level(), bench.role.state()) == ("2.0", "idle")
        begun(bench, cycles=2, rest=5.0)
        assert bench.role.state() == "charge"
        rows = np.array(bench.drained(100))
        assert rows[:, 5].tolist() == [*(1, 1, 1, 0, -1, -1, -1, 0), *(1, 1, 1, 0, -1, -1, -1)]
        assert rows[:, 6].tolist() == 8 * [1] + 7 * [2]
        assert np.diff(rows[:, 0]) == pytest.approx(5.0)
        assert rows[0, 1:5].tolist() == [4.2, 0.7, 0.0041, 25.0]
        report = bench.role.end()
        assert (bench.role.state(), report.lost, report.losses_known) == ("ended", 0, True)
        assert bench.driver.outlets() == (Outlet(0, on=False),)


def test_a_whole_test_of_level_1():
    """Nothing is written but one byte; rows are dated by their arrival, and how well is told."""
    with cycler(lines=3, **LEVEL_1) as bench:
        assert bench.driver.identify() == Identity(model="START ARDUINO")
        assert (bench.role.level(), bench.role.state()) == ("1", "idle")
        bench.role.prepare(1)
        started = bench.clock.now()
        begun_s = bench.clock.now()
        bench.role.begin(0.2)
        bench.role.start()
        assert bench.driver.outlets() == (Outlet(0, on=True),)
        rows = np.array(bench.drained(40))
        assert rows[:, 5].tolist() == [1, 1, 1, -1, -1, -1]
        assert rows[:, 0] == pytest.approx(started - begun_s + 5.0 * np.arange(1, 7), abs=0.2)
        assert bench.role.time_uncertainty().value < 0.1
        report = bench.role.end()
        assert (report.frames, report.lost, report.losses_known, report.drift) == (6, 0, False, None)
        assert report.time_uncertainty < 0.1
        assert bench.role.state() == "ended"


@pytest.mark.parametrize("drift", ["0", "0.004", "-0.004"])
def test_times_of_level_1_are_within_their_bounds(drift):
    """Whatever the device's clock does, no row is further from its true instant than its bounds, and none is lost."""
    truth = {"level": "1", "cycles": "1", "clock_drift": drift}
    with cycler(truth=truth, settings=LEVEL_1["settings"]) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        bench.role.prepare(1)
        bench.role.begin(0.2)
        bench.role.start()
        rows = np.array(bench.drained(2000))
        true = 5.0 * np.arange(1, len(rows) + 1) / (1 + float(drift))
        assert len(rows) == pytest.approx(400, abs=3)
        assert np.abs(rows[:, 0] - true).max() <= bench.role.time_uncertainty().value * 12**0.5 / 2 + 0.05
        assert bench.role.end().lost == 0


@pytest.mark.parametrize("level", ["1", "2"])
def test_lost_lines_are_counted_and_leave_their_time_empty(level):
    """Level 2 counts by numbers; level 1 by the time that is missing, and says that it cannot know."""
    settings = {"level": "1"} if level == "1" else {"beat": "600 s"}
    with cycler(
        truth={"level": level}, settings=settings, faults=[{"kind": "lost-lines", "from": "60 s", "lines": "3"}]
    ) as (bench):
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench, cycles=10)
        rows = np.array(bench.drained(200))
        report = bench.role.end()
        assert report.lost == 3
        assert report.losses_known is (level == "2")
        assert np.diff(rows[:, 0]).max() == pytest.approx(20.0, abs=0.5)


@pytest.mark.parametrize("level", ["1", "2"])
def test_torn_lines_are_lost_lines(level):
    """No row is made of what is left of one; what could be is in the right order of size."""
    faults = [{"kind": "torn-lines", "from": "60 s", "until": "120 s", "share": "0.5"}]
    with cycler(truth={"level": level}, settings={"level": level}, faults=faults) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench, cycles=10)
        rows = np.array(bench.drained(300))
        report = bench.role.end()
        assert 2 <= report.lost <= 10
        assert len(rows) + report.lost == pytest.approx(60, abs=1)
        if level == "2":
            assert set(rows[:, 1]) == {3.8}
            assert report.frames == len(rows) + 1


def test_garbled_lines_are_lost_lines():
    """A wrong CRC makes no row; the device is asked again where a reply is hit."""
    with cycler(faults=[{"kind": "garbled", "from": "60 s", "until": "64 s", "share": "0.2"}]) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        bench.drained(200)
        assert 1 <= bench.role.end().lost <= 2  # the end of a line may be hit


@pytest.mark.parametrize("level", ["1", "2"])
def test_a_reset_ends_test_and_stream(level):
    """What came before is returned; then it is told, again and again, until the next test is prepared."""
    with cycler(truth={"level": level}, settings={"level": level}, faults=[{"kind": "reset", "from": "30 s"}]) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench, cycles=10)
        with pytest.raises(DeviceFault, match="has restarted.*its test is over"):
            bench.drained(60)
        for call in (bench.role.drain, bench.role.state, bench.role.voltage):
            with pytest.raises(DeviceFault, match="restarted"):
                call()
        assert bench.role.end().drift is None
        with pytest.raises(Refused, match="no test is prepared"):
            bench.role.start()
        bench.role.prepare(10)
        bench.role.start()
        assert bench.role.state() == "charge"


def test_the_reason_of_a_reset_is_told():
    """Boot counter and reason are the banner's."""
    with cycler(faults=[{"kind": "reset", "from": "30 s"}]) as bench:
        begun(bench)
        with pytest.raises(DeviceFault, match=r"boot 43, BROWNOUT"):
            bench.drained(60)


def test_a_replay_gives_the_same_rows_and_states(tmp_path):
    """Every byte, the pulse of DTR and every instant come from the record; the driver asks the same again."""

    def converse(driver, clock):
        role = driver.role(wire(beat="15 s"))
        bench = Bench(role, driver, clock, None)
        got = [str(driver.identify())]
        begun(bench, cycles=2)
        got += bench.drained(60)
        role.stop()
        got += [role.state(), role.current().value, role.end(), clock.now_ns()]
        driver._session.reset()
        return [*got, clock.now_ns()]

    path = tmp_path / "transcript.tsv"
    with path.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        with cycler(lines=3, transcript=transcript) as bench:
            got = converse(bench.driver, bench.clock)
        transcript.flush()
    clock = VirtualClock()
    playback = Playback(path, clock, where=lambda: "step 1")
    publish_stream("replay://cycler-test/device", ReplayedStream("device", playback))
    try:
        port = open_port("device", "replay://cycler-test/device", clock, Transcript(None))
        driver = BatteryCycler(Connection(device="device", clock=clock, clamps=Clamps(), port=port))
        assert converse(driver, clock) == got
    finally:
        withdraw("replay://cycler-test/")
    assert playback.exhausted


def test_the_devices_clock_is_compared():
    """Rows have the device's time; its drift is told with its uncertainty."""
    with cycler(truth={"clock_drift": "0.003"}) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        rows = np.array(bench.drained(1000))
        report = bench.role.end()
        assert np.diff(rows[:, 0]) == pytest.approx(5.0)
        assert len(rows) == 200
        assert abs(report.drift - 0.003) < 3 * report.drift_uncertainty < 1e-4


def test_heartbeats_keep_a_test_alive_and_silence_ends_it():
    """Who drains keeps it alive; who does not finds it tripped by the device itself."""
    with cycler(settings={"beat": "15 s"}) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        assert len(bench.drained(300)) == 60
        bench.clock.sleep(20)
        bench.role.drain()
        assert bench.role.state() == "tripped HEARTBEAT"
        assert bench.drained(20) == []
        with pytest.raises(Refused, match="no test is prepared"):
            bench.role.start()
        bench.role.prepare(1)
        bench.role.start()
        assert bench.role.state() == "charge"


@pytest.mark.parametrize(
    ("shown", "reason"),
    [
        ((4.3, 0.7, 25.0), "VMAX"),
        ((3.8, 1.2, 25.0), "IMAX"),
        ((3.8, 0.7, 50.0), "TMAX"),
        ((3.8, 0.7, -273.0), "SENSOR"),
    ],
)
def test_what_trips_is_told(shown, reason):
    """The state has the device's reason, and START is refused while it lasts."""
    with cycler() as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        bench.drained(10)
        bench.cell.show(*shown)
        bench.drained(10)
        assert bench.role.state() == f"tripped {reason}"
        bench.cell.show(*shown)
        bench.role.prepare(1)
        with pytest.raises(Rejected, match=f"beyond {reason} already"):
            bench.role.start()


def test_settings_are_read_back_and_refused():
    """What the device takes is set; what it refuses, or cannot be written, is told."""
    with cycler() as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench, cycles=3, vmax=4.22, tmax=40.0)
        bench.cell.show(4.221, 0.7, 25.0)
        bench.drained(10)
        assert bench.role.state() == "tripped VMAX"
        for wrong, message in (({"vmax": 4.5}, "than vmax may be"), ({"vend": 4.0}, "than vend may be")):
            with pytest.raises(Rejected, match=message):
                bench.role.prepare(1, **wrong)
        with pytest.raises(Refused, match="3 decimals"):
            bench.role.prepare(1, vmax=4.2004)
        with pytest.raises(Refused, match="cannot be nan"):
            bench.role.prepare(1, vmax=float("nan"))
        bench.role.prepare(1, vfull=4.25, vmax=4.25)
        with pytest.raises(Rejected, match=r"contradict each other, the first is vfull"):
            bench.role.start()


def test_level_1_refuses_what_it_cannot_do():
    """It says what it does instead; a limit is never taken for granted."""
    with cycler(**LEVEL_1) as bench:
        for wrong, message in (
            ({"cycles": 2}, "has cycles 1, not 2"),
            ({"cycles": 1, "rest": 60.0}, "has rest 0, not 60"),
            ({"cycles": 1, "vend": 3.0}, "has vend 2.7, not 3"),
            ({"cycles": 1, "vmax": 4.2}, "has no vmax.*envelope"),
        ):
            with pytest.raises(Rejected, match=message):
                bench.role.prepare(**wrong)
        bench.role.prepare(1, vend=2.7, iend=0.05)
        with pytest.raises(NoReply, match="while its test runs only"):
            bench.role.voltage()


def test_a_running_test_is_never_prepared_over():
    """Neither level."""
    for options in ({}, LEVEL_1):
        with cycler(**options) as bench:
            bench.cell.show(3.8, 0.7, 25.0)
            bench.role.prepare(1)
            bench.role.start()
            with pytest.raises(Rejected, match="runs"):
                bench.role.prepare(1)


@pytest.mark.parametrize("level", ["1", "2"])
def test_stop_opens_both_relays(level):
    """By command or by reset; another test can follow, with another run."""
    with cycler(truth={"level": level}, settings={"level": level}) as bench:
        bench.cell.load = 0.7
        begun(bench, cycles=10)
        bench.drained(20)
        assert bench.cell.inputs["charge"]
        bench.role.stop()
        assert not any(bench.cell.inputs.values())
        assert bench.role.state() == "stopped"
        bench.role.drain()
        assert bench.drained(20) == []
        assert bench.role.over
        bench.role.prepare(10)
        assert (bench.role.state(), bench.role.over) == ("idle", False)
        bench.role.start()
        assert len(bench.drained(20)) == 3
        assert bench.role.end().lost == 0


def test_stop_without_knowing_the_device():
    """A device whose level nobody knows is reset, and nothing is written to it."""
    with cycler(**LEVEL_1) as bench:
        bench.role.stop()
        assert bench.role.state() == "idle"
        assert bench.clock.now() == pytest.approx(1.7, abs=0.1)


def test_stop_of_a_device_that_does_not_answer_resets_it():
    """Where STOP is lost, DTR opens the relays."""
    with cycler(faults=[{"kind": "dead", "from": "20 s", "until": "22.9 s"}]) as bench:
        bench.cell.load = 0.7
        bench.role.prepare(1)
        bench.role.start()
        bench.clock.sleep(20 - bench.clock.now())
        bench.role.stop()
        assert not any(bench.cell.inputs.values())
        assert bench.role.state() == "idle"


def test_a_port_that_does_not_reset():
    """The level is learnt from the line of every 5 s; a level 1 device that waits is never guessed at."""
    with cycler(truth={"reset_on_open": False}) as bench:
        assert bench.driver.identify().serial == "C0001"
        assert bench.clock.now() == pytest.approx(5.1, abs=0.2)
        bench.cell.load = 0.7
        bench.role.prepare(1)
        bench.role.start()
        bench.role.stop()
    with cycler(truth={"reset_on_open": False, "level": "1"}, settings={"level": "1"}) as bench:
        with pytest.raises(NoReply, match="any byte may start it"):
            bench.driver.identify()
        with pytest.raises(NoReply, match="was not reset"):
            bench.role.stop()
        assert not any(bench.cell.inputs.values())


def test_the_wrong_level_is_refused():
    """A test begins on the level that the wiring names, and on no other."""
    for truth, settings in (("1", "2"), ("2", "1")):
        with (
            cycler(truth={"level": truth}, settings={"level": settings}) as bench,
            pytest.raises(WrongIdentity, match="speaks level"),
        ):
            bench.role.prepare(10)


def test_runs_are_new_for_each_test_and_follow_the_device():
    """Boot counter and count: another session of the same boot goes on counting."""
    with cycler() as bench:
        for run in ("002A0001", "002A0002"):
            bench.role.prepare(1)
            bench.role.start()
            bench.role.stop()
            assert bench.role._session.fields("STATE")["run"] == run


@pytest.mark.parametrize("kind", ["dead", "late"])
def test_a_device_that_falls_silent_is_told(kind):
    """Rows stop, the device is asked, and does not answer."""
    fault = {"kind": kind, "from": "30 s", "until": "200 s"} | ({"by": "100 s"} if kind == "late" else {})
    with cycler(faults=[fault]) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        with pytest.raises(NoReply, match="no reply came"):
            bench.drained(100)
    with cycler(faults=[fault], **LEVEL_1) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        with pytest.raises(NoReply, match="no line for"):
            bench.drained(100)


def test_lines_that_waited_are_as_old_as_the_device_says():
    """A device that fell silent between two looks at the line is asked at the second: what it told last is not new."""
    with cycler(faults=[{"kind": "dead", "from": "45 s", "until": "200 s"}]) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        bench.clock.sleep(20.0 - bench.clock.now())
        assert len(bench.role.drain()) > 1
        bench.clock.sleep(60.0 - bench.clock.now())
        assert len(bench.role.drain()) == 5
        with pytest.raises(NoReply, match="no reply came"):
            bench.role.drain()


@pytest.mark.parametrize(("beat", "patience"), [("300 s", 50.0), ("60 s", 10.0), ("15 s", 5.0), ("600 s", 100.0)])
def test_how_long_lines_can_wait(beat, patience):
    """As long as heartbeats leave in time and the buffer is half full; a test goes on that is emptied so seldom."""
    with cycler(settings={"beat": beat}) as bench:
        bench.cell.show(3.8, 0.7, 25.0)
        begun(bench)
        assert bench.role.patience == patience
        rows = 0
        for _ in range(round(1500 / patience)):
            bench.clock.sleep(patience)
            rows += len(bench.role.drain())
        assert bench.role.state() == "charge"
        assert rows == pytest.approx(300, abs=2)
        assert bench.role.end().lost == 0


def test_lines_of_level_1_do_not_wait():
    """They are dated by their arrival."""
    with cycler(**LEVEL_1) as bench:
        bench.role.level()
        assert bench.role.patience == 5.0


def test_a_lost_mark_is_found_out():
    """Where TEST ITERATION or TEST END is lost, the device is asked, and cycle and state are right."""
    for lines, cycles, at in ((3, 2, "34 s"), (3, 1, "34 s")):
        faults = [{"kind": "lost-lines", "from": at, "lines": "3"}]
        with cycler(lines=lines, faults=faults) as bench:
            bench.role.prepare(cycles)
            bench.clock.sleep(5.5 - bench.clock.now() % 5)
            bench.role.begin(0.2)
            bench.role.start()
            rows = bench.drained(80)
            assert bench.role.state() == "ended"
            assert rows[-1][6] == cycles


def test_other_rates_and_second_streams_are_refused():
    """The device measures every 5 s."""
    with cycler() as bench:
        with pytest.raises(Refused, match=r"0\.2 Hz"):
            bench.role.begin(1.0)
        with pytest.raises(Refused, match="does not stream"):
            bench.role.drain()
        bench.role.begin(0.2)
        with pytest.raises(Refused, match="is already streaming"):
            bench.role.begin(0.2)
        assert bench.role.longest_pause == 5.0
        assert bench.role.drain().shape == (0, 7)


def test_what_is_measured_without_a_test():
    """A level 2 device is asked; what was measured before a stop is not told after it."""
    with cycler() as bench:
        bench.cell.show(3.9, 0.0, 24.0)
        assert bench.role.voltage().value == 3.9
        assert bench.role.sample() == (3.9, 0.0, 0.0, 24.0, 0.0, 0.0)
        bench.role.prepare(1)
        bench.role.start()
        bench.cell.show(3.8, 0.7, 25.0)
        bench.clock.sleep(6)
        assert bench.role.current().value == 0.7
        bench.cell.show(3.7, 0.0, 25.0)
        bench.role.stop()
        assert (bench.role.current().value, bench.role.voltage().value) == (0.0, 3.7)
        assert bench.role.temperature().unit == "degC"
