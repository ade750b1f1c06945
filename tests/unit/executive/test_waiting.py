"""`clock` in a case: the time, and how long something took until it was seen, with what is not known of that."""

from __future__ import annotations

import math
from contextlib import nullcontext

import pytest
from case_parts import Case
from typed_events import event_of

from hil.executive.cases.effects import Recall
from hil.executive.cases.waiting import CaseClock, span
from hil.model.errors import Diverged, Misused, NotMet
from hil.model.verdict import Verdict


@pytest.fixture
def case(tmp_path):
    """Return a case."""
    return Case(tmp_path, "T-010")


def rising(case, at):
    """Return a condition: the supply's voltage at an instant jumps above 4.5 V; a reading takes 10 ms."""

    def met():
        case.supply.volts = 5.0 if case.clock.now() >= at else 0.0
        case.clock.sleep(0.01)
        return case.coil.voltage().value > 4.5

    return met


def test_the_time_moves_with_the_bench_alone(case):
    """Two looks at it without a wait between are equal, and each is an effect."""
    clock = CaseClock(case.run)
    assert clock.now() == clock.now() == 0.0
    clock.sleep(0.25)
    assert clock.now() == 0.25
    assert [event["name"] for event in case.written.of("effect")] == ["clock.now"] * 2 + ["clock.sleep", "clock.now"]


def test_the_figure_holds_the_instant_and_says_how_well(case):
    """Between the last look in vain and the end of the one that shows it, whatever the instant was."""
    clock = CaseClock(case.run)
    for at in (0.105, 0.111, 0.1199):
        since = clock.now()
        took = clock.until(rising(case, since + at), within=1.0, every=0.02)
        assert abs(took.value - at) <= math.sqrt(3) * took.uncertainty
        assert took.uncertainty == pytest.approx(0.015 / math.sqrt(3), rel=0.01)
        assert took.provenance.instruments == ("psu1",)
        assert took.provenance.told == ("supply.coil.voltage", "clock.until")
        clock.sleep(1.0)


def test_what_began_the_time_is_uncertain_too(case):
    """A relay that takes 50 ms may have closed at any moment of them; what was met at once may always have been."""
    clock = CaseClock(case.run)
    since = clock.now()
    clock.sleep(0.05)
    took = clock.until(rising(case, 0.0), since=since, within=1.0)
    assert took.value == pytest.approx((0.0 + 0.06) / 2 - 0.025)
    assert took.uncertainty == pytest.approx(math.hypot(0.025, 0.03) / math.sqrt(3), rel=1e-3)


def test_the_clock_itself_is_not_exact():
    """Over ten hours its 100 ppm are most of the doubt."""
    took = span((0, 0), (36_000 * 10**9, 36_000 * 10**9 + 10**9))
    assert (took.value, took.unit) == (36_000.5, "s")
    assert took.uncertainty == pytest.approx(math.hypot(0.5, 3.60005) / math.sqrt(3))


def test_no_turn_beside_the_case_is_disturbed_in_a_wait(case):
    """An alarm that rings while a recording asks its instrument must not begin another question there."""
    disturbed = []

    class Turn:
        """Is asked for a sample every 20 ms; in the middle of it the alarm rings."""

        what, due_ns, turns = "a recording", 0, 0

        def take(self):
            case.flags.interlude(lambda *_: disturbed.append(self.turns))
            self.turns += 1
            self.due_ns = case.clock.now_ns() + 20_000_000

    turn = Turn()
    case.scheduler.begin_beside(turn)
    with case.flags.case_code():
        CaseClock(case.run).until(lambda: case.clock.now() >= 0.5, within=1.0, every=0.1)
    assert (disturbed, turn.turns > 10) == ([], True)


def test_in_vain_nothing_is_decided(case):
    """It took as long as it was to take; a case that lets it through is INCONCLUSIVE where it checked nothing."""
    clock = CaseClock(case.run)
    with pytest.raises(NotMet, match=r"not met within 0.3 s; it read supply.coil.voltage") as caught:
        clock.until(rising(case, 10.0), within=0.3)
    assert case.clock.now() == pytest.approx(0.3, abs=0.02)
    assert case.written.of("effect")[-1]["raised"] == "NotMet"
    case.run.raised(caught.value)
    assert case.run.outcome().verdict is Verdict.INCONCLUSIVE


def test_a_condition_that_reads_nothing_proves_nothing(case):
    """The figure is there, and no instrument behind it."""
    clock = CaseClock(case.run)
    took = clock.until(lambda: case.clock.now() > 0.1, within=1.0)
    assert (took.value, took.provenance.measured) == (pytest.approx(0.105, abs=0.01), False)


@pytest.mark.parametrize("wrong", [{"within": 0.0}, {"within": math.inf}, {"within": 1.0, "every": 0.0},
                                   {"within": 1.0, "since": 1.0}, {"within": 1.0, "since": True}])  # fmt: skip
def test_what_cannot_be_waited_for_is_refused(case, wrong):
    """And stays an error where a case lets it through."""
    with pytest.raises(Misused, match=r"clock\.until"):
        CaseClock(case.run).until(lambda: True, **wrong)
    assert case.run.outcome().verdict is Verdict.ERROR


def test_run_again_it_has_to_come_to_the_same(tmp_path):
    """Its looks are readings of the record, in order; another duration is DIVERGED."""
    (first := tmp_path / "first").mkdir()
    case = Case(first, "T-010")
    took = CaseClock(case.run).until(rising(case, 0.1), within=1.0)
    record = [event_of(**event) for event in case.written.of("effect")]
    for at, name in ((0.1, "same"), (0.15, "other")):
        (folder := tmp_path / name).mkdir()
        again = Case(folder, "T-010", recall=Recall(record, frozenset({"asks"})))
        with nullcontext() if at == 0.1 else pytest.raises(Diverged):
            assert CaseClock(again.run).until(rising(again, at), within=1.0) == took
