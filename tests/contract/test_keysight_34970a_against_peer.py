"""The data acquisition's driver against its peer: voltages of a rail, a thermocouple at a plate, and a digital byte."""

from __future__ import annotations

import math
from contextlib import contextmanager
from types import SimpleNamespace

import numpy as np
import pytest
from facing import facing

from hil.executive.watching.monitoring import monitor_of
from hil.instruments.keysight_34970a import Keysight34970a
from hil.model.bench import Wire
from hil.model.envelope import EnvelopeLimit
from hil.model.errors import NoReply, Refused, Rejected
from hil.model.figure import FigureStatus
from hil.simulation.peers.keysight_34970a import MODEL
from hil.simulation.plants.signal_node import SignalNode, driven

QUIET = {"noise": "0", "thermocouple_noise": "0"}
WIRE = {"101": "plate degC K", "102": "bus V 10", "120": "cell V", "301": "flags 1"}
SECOND = 1_000_000_000


def node(shape="DC", frequency=1.0, amplitude=0.0, offset=0.0):
    """Return a node with a signal."""
    found = SignalNode("node", 10_000_000)
    found.command(drive=driven(shape, frequency, amplitude, offset, 0))
    return found


@contextmanager
def daq(*, plants=None, faults=(), settings=None, truth=None):
    """Yield the inputs of a wire, the driver, and the clock."""
    plants = plants or {"ramp": node("RAMP", 0.01, 100.0, 50.0), "bus": node(offset=5.0), "cell": node(offset=4.125)}
    connects = {"101": "ramp.voltage", "102": "bus.voltage", "120": "cell.voltage", "301.0": "bus.voltage",
                "301.7": "cell.voltage"}  # fmt: skip
    with facing(
        MODEL, driver=Keysight34970a, plants=plants, connects=connects, faults=faults, truth={**QUIET, **(truth or {})}
    ) as (driver, clock):
        asked = Wire(role="data_acquisition", instrument="device", settings=settings or WIRE)
        yield driver.role(asked), driver, clock


def test_each_input_is_read_in_its_unit():
    """By its name; bytes at once, the others by a sweep of their own."""
    with daq() as (role, driver, clock):
        assert [(each.name, each.unit) for each in role.channels()][:4] == [
            ("plate", "degC"), ("bus", "V"), ("cell", "V"), ("flags", "1"),
        ]  # fmt: skip
        assert driver.identify().model == "34970A"
        assert role.read("bus").value == pytest.approx(5.0, abs=1e-6)
        figure = role.read("plate")
        assert (figure.unit, figure.value) == ("degC", pytest.approx(clock.now(), abs=0.2))
        assert role.read("flags").value == 0b1000_0001
        assert role.sample()[2:4] == (pytest.approx(4.125, abs=1e-6), 129.0)
        with pytest.raises(Refused, match="has no channel 'buss'"):
            role.read("buss")


def test_an_input_is_a_limit_of_the_envelope():
    """Read by its name, a wire off is not observable; while it is recorded, only rows tell, and no rows are a fault."""
    limit = EnvelopeLimit(
        id="plate-hot",
        output="data_acquisition",
        quantity="plate",
        unit="degC",
        maximum=60.0,
        period_s=2.0,
        max_age_s=9.0,
    )
    with daq() as (role, _, clock):
        wire = Wire(role="data_acquisition", instrument="daq1", settings=WIRE)
        daq1 = SimpleNamespace(driver="keysight-34970a")
        spec = SimpleNamespace(wire=lambda _: wire, instrument=lambda _: daq1)
        monitor = monitor_of(SimpleNamespace(roles={"data_acquisition": role}, spec=spec, clock=clock), limit)
        figure, trip = monitor.take(clock.now_ns)
        assert (trip, figure.value) == (None, pytest.approx(clock.now(), abs=0.2))
        role.begin(1.0)
        with pytest.raises(NoReply, match="daq1: .* is being recorded, and no rows come"):
            monitor.take(clock.now_ns)
        role.end()
        clock.sleep(60.0)
        assert monitor.take(clock.now_ns)[1].limit == "plate-hot"


def test_a_recording_has_the_times_of_the_instrument():
    """Rows on its timer's grid, each input at its own time: the ramp, one degree a second, shows it."""
    with daq() as (role, _, clock):
        role.begin(4.0)
        began, blocks = clock.now(), []
        for _ in range(12):
            clock.sleep(role.longest_pause)
            blocks.append(role.drain())
        report = role.end()
        rows = np.concatenate(blocks)
        assert (report.lost, report.frames, report.losses_known) == (0, len(rows), True)
        assert len(rows) == pytest.approx(12 * 4 * 2.0, abs=3)
        assert np.diff(rows[:, 0]) == pytest.approx(0.25, abs=1e-3)
        assert rows[:, 1] - rows[0, 1] == pytest.approx(rows[:, 0] - rows[0, 0], abs=2e-3)
        assert rows[0, 1] == pytest.approx(began + rows[0, 0], abs=0.05)
        reading_s = 0.016 + 0.005 + 0.04
        after = rows[:, 5:]
        assert after == pytest.approx(
            np.broadcast_to([reading_s, 2 * reading_s, 2 * reading_s + 0.001], after.shape), abs=2e-3
        )
        assert report.time_uncertainty < 0.01


def test_a_rate_that_it_cannot_keep_is_refused_with_the_arithmetic():
    """Channels by settling and integration; a step that the timer does not have; a wire that asks for too much."""
    with daq() as (role, *_), pytest.raises(Refused, match="4 channels take 0.2.* too long for 5 Hz; record at 4"):
        role.begin(5.0)
    with daq() as (role, *_), pytest.raises(Refused, match="record at 3.003 Hz"):
        role.begin(3.0)
    with daq(settings={**WIRE, "nplc": "10"}) as (role, *_), pytest.raises(Refused, match=r"take 1\.\d+ s"):
        role.begin(1.0)


@pytest.mark.parametrize(
    ("channel", "faults", "settings"),
    [
        ("plate", [{"kind": "open-input", "channel": "101"}], WIRE),
        ("bus", (), {**WIRE, "102": "bus V 1"}),
        ("nothing", (), {**WIRE, "103": "nothing degC K"}),
    ],
    ids=["open", "overload", "unconnected"],
)
def test_what_has_no_number_is_not_observable(channel, faults, settings):
    """9.9E37 is NaN, with a status that no check takes for a number, and a gap in no other channel."""
    with daq(faults=faults, settings=settings) as (role, _, clock):
        figure = role.read(channel)
        assert (math.isnan(figure.value), figure.status) == (True, FigureStatus.NOT_OBSERVABLE)
        role.begin(1.0)
        clock.sleep(2.5)
        rows = role.drain()
        place = 1 + [each.name for each in role.channels()].index(channel)
        assert np.isnan(rows[:, place]).all()
        assert np.isfinite(np.delete(rows, place, axis=1)).all()


def test_lost_readings_leave_their_time_empty():
    """Another program takes some out of the memory: counted, and no row holds numbers of two sweeps."""
    with daq() as (role, driver, clock):
        role.begin(2.0)
        clock.sleep(4.0)
        driver._session.query("DATA:REM? 6", str)
        rows = role.drain()
        assert rows[0, 0] == pytest.approx(1.0 + 0.061, abs=2e-3)
        assert role.end().lost == 2


def test_a_scan_that_somebody_ends_is_a_fault():
    """Instead of a recording that waits for ever."""
    with daq() as (role, driver, clock):
        role.begin(2.0)
        clock.sleep(2.0)
        driver._session.setting("ABOR")
        assert len(role.drain()) == 4
        clock.sleep(1.5)
        assert len(role.drain()) == 0
        clock.sleep(0.5)
        with pytest.raises(NoReply, match="no sweep has ended for 2"):
            role.drain()


def test_what_it_cannot_do_is_refused():
    """A channel without a module, wires that do not read, and a scan list that another program has."""
    for settings, message in (
        ({"101": "plate"}, "must be `NAME V`"),
        ({"101": "a V", "102": "a V"}, "channels of one name"),
        ({"nplc": "1"}, "no channel is named"),
        ({"101": "a V", "speed": "2"}, "unknown key 'speed'"),
    ):
        with pytest.raises(Refused, match=message), daq(settings=settings):
            pass
    with daq(settings={"302": "a V"}) as (role, *_), pytest.raises(Rejected, match="Illegal parameter"):
        role.sample()
    with daq() as (role, *_):
        role.begin(1.0)
        with pytest.raises(Refused, match="is being recorded"):
            role.read("bus")
    with daq(faults=[{"kind": "dead"}]) as (role, *_), pytest.raises(NoReply):
        role.read("bus")
