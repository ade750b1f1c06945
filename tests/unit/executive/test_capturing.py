"""`record.capture`: what an instrument took by itself around its trigger, kept, judged or left undecided."""

from __future__ import annotations

import numpy as np
import pytest
from case_parts import CALIBRATION, Case

from hil.executive.cases.facade import Facade
from hil.instruments.sampled import Channel, Frame, Screen
from hil.model.bench import InstrumentSpec, Wire
from hil.model.errors import Misused, NoReply, NotTriggered
from hil.model.figure import Figure
from hil.model.verdict import Verdict

FRAME = Frame(
    interval=1e-3, first=-0.2, rows=1000, channel="rail", level=1.0, slope="rising", screens=(Screen(10, 0.04, -2, 8),)
)


class Scope:
    """An oscilloscope's role in memory; it is triggered some time after it was asked first."""

    def __init__(self, clock, *, after=0.5, peak=5.0, silent_from=10**6):
        self.clock, self.after, self.peak, self.silent_from = clock, after, peak, silent_from

    def channels(self):
        """Return one channel."""
        return (Channel("rail", "V"),)

    def complete(self):
        """Look at the clock."""
        return self.clock.now() >= self.after

    def frame(self):
        """Return one frame."""
        return FRAME

    def blocks(self, frame):
        """Give rows in blocks of 400."""
        for first in range(0, frame.rows, 400):
            if first >= self.silent_from:
                raise NoReply("scope1", "nothing came")
            places = np.arange(first, min(first + 400, frame.rows))
            yield np.column_stack([frame.first + places * frame.interval, np.where(places < 200, 0.0, self.peak)])


def captured(tmp_path, *requirements, within=1.0, **scope):
    """Return a case, and what captures in it."""
    case = Case(tmp_path, *requirements)
    spec = InstrumentSpec(name="scope1", driver="none", calibration=CALIBRATION)
    effects = case.run.effects
    facade = Facade(Wire(role="oscilloscope", instrument="scope1"), spec, Scope(case.clock, **scope), effects, case.run)
    return case, lambda: case.run.record.capture("power-on", facade, within=within)


def shown(rail):
    """Return 5 V, made of the samples before the trigger."""
    return Figure(value=rail[:200].mean() + 5.0, unit="V", uncertainty=0.001)


def test_a_capture_has_its_own_time_axis(tmp_path):
    """Its rows count from the trigger; the journal says what took them, and the effect repeats their hash."""
    case, capture = captured(tmp_path)
    found = capture()
    assert len(found) == 1000
    assert (found.time[0], found.time[200]) == (-0.2, 0.0)
    assert found["rail"].max() == 5.0
    assert (found.capture.interval, found.capture.channel, found.capture.level) == (1e-3, "rail", 1.0)
    assert found.resolution("rail") == 0.04
    assert found.uncertainty("rail") == pytest.approx((0.002 + 0.01 * 5) / 2)
    (begun,), (ended,), (effect,) = (case.written.of(kind) for kind in ("recording", "recording-end", "effect"))
    assert begun["capture"] == {"interval": 1e-3, "first": -0.2, "channel": "rail", "level": 1.0, "slope": "rising"}
    channel = begun["channels"][0]
    assert [channel[key] for key in ("probe", "resolution", "low", "high")] == [10, 0.04, -2, 8]
    assert (ended["rows"], ended["complete"], ended["sha256"]) == (1000, True, effect["result"]["sha256"])
    assert case.clock.now() == pytest.approx(0.5, abs=0.021)


@pytest.mark.parametrize("peak", [8.0, 7.99, -2.0])
def test_a_clipped_channel_judges_nothing(tmp_path, peak):
    """Whatever is made of it, also a value within its limits."""
    case, capture = captured(tmp_path, "T-050", peak=peak)
    rail = capture()["rail"]
    assert case.run.check("T-050", "voltage", shown(rail)) is Verdict.INCONCLUSIVE
    (check,) = case.written.of("check")
    assert "rail of scope1 is clipped: 800 of 1000 samples are at the ends of -2 to 8 V" in check["reason"]
    assert list(check["doubts"]) == [check["reason"]]


def test_one_that_is_not_clipped_does(tmp_path):
    """Just below the end."""
    case, capture = captured(tmp_path, "T-050", peak=7.97)
    assert case.run.check("T-050", "voltage", shown(capture()["rail"])).good


def test_without_a_trigger_nothing_is_decided(tmp_path):
    """No recording, no verdict: neither bench nor DUT is to blame; what was checked stands."""
    case, capture = captured(tmp_path, "T-010", "T-020", after=5.0)
    case.run.check("T-010", "ratio", Figure(value=1.0, unit="1", uncertainty=0.0))
    with pytest.raises(
        NotTriggered, match=r"oscilloscope was not triggered within 1 s; check level and slope"
    ) as error:
        capture()
    assert case.clock.now() == pytest.approx(1.0)
    case.run.raised(error.value)
    case.run.close()
    outcome = case.run.outcome()
    assert outcome.verdict is Verdict.INCONCLUSIVE
    assert outcome.requirements["T-020"] is Verdict.INCONCLUSIVE
    assert case.written.of("recording") == []
    (fault,) = case.written.of("fault")
    assert (fault["device"], fault["dut"], fault["undecided"]) == ("scope1", False, True)


def test_a_case_that_catches_it_decides_itself(tmp_path):
    """Then nothing is noted but the effect."""
    case, capture = captured(tmp_path, "T-010", after=5.0)
    with pytest.raises(NotTriggered):
        capture()
    assert case.written.of("fault") == []
    assert case.run.outcome().requirements["T-010"] is Verdict.NOT_EVALUATED


def test_silence_while_it_is_read_keeps_what_came_as_incomplete(tmp_path):
    """An instrument of the bench that falls silent is an ERROR."""
    case, capture = captured(tmp_path, "T-010", silent_from=800)
    with pytest.raises(NoReply):
        capture()
    (ended,) = case.written.of("recording-end")
    assert (ended["rows"], ended["complete"]) == (800, False)
    assert case.run.outcome().verdict is Verdict.ERROR


def test_what_captures_nothing_is_refused(tmp_path):
    """A role that is sampled, and a limit of no time."""
    case, capture = captured(tmp_path, within=0.0)
    with pytest.raises(Misused, match="magnetometer captures nothing by itself"):
        case.run.record.capture("field", case.field, within=1.0)
    with pytest.raises(ValueError, match="above zero"):
        capture()
