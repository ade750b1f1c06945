"""The safe-off: every line in its order, tried and proven, whatever became of the one before."""

from __future__ import annotations

from dataclasses import replace

import pytest

from hil.bench.safe_off import SafeResult, make_safe
from hil.clock.virtual import VirtualClock
from hil.model.bench import Proof, SafeStep
from hil.model.errors import NoReply
from hil.model.figure import Figure

PROOF = Proof(output="supply.coil", quantity="current", unit="A", minimum=-0.001, maximum=0.001)
COIL = SafeStep(output="supply.coil", state="off", within_s=2.0, proof=PROOF)
RELAYS = SafeStep(output="relays", state="released", within_s=1.0)


class Output:
    """A supply output or relay board that needs some tries, takes some time, and has a falling current."""

    def __init__(self, clock, name="supply.coil", *, told=None, error=None, tries=1, takes=0.0, falls=0.0) -> None:
        self.clock, self.name, self.told = clock, name, [] if told is None else told
        self.error, self.tries, self.takes, self.falls = error, tries, takes, falls
        self.off_at = None

    def disable(self) -> None:
        """Switch off, in the end."""
        self.told.append((self.name, round(self.clock.now(), 6)))
        self.clock.sleep(self.takes)
        self.tries -= 1
        if self.tries >= 0 and self.error:
            raise self.error
        if self.tries <= 0 and self.off_at is None:
            self.off_at = self.clock.now()

    release_all = disable

    def current(self) -> Figure:
        """Return a current that is gone `falls` seconds after the output is off."""
        gone = self.off_at is not None and self.clock.now() >= self.off_at + self.falls
        return Figure(value=0.0 if gone else 0.5, unit="A")


def take(*steps, **outputs):
    """Take the steps and return the results, and whether all are safe."""
    clock = next(iter(outputs.values())).clock
    results: list[SafeResult] = []
    roles = {name.replace("_", "."): output for name, output in outputs.items()}
    return make_safe(steps, roles, clock, results.append), results


def test_every_line_in_its_order_whatever_fails():
    """A dead output first, one that is a defect second: the third is made safe all the same, in order."""
    clock, told = VirtualClock(), []
    dead = Output(clock, "supply.a", told=told, error=NoReply("psu1", "no reply"), tries=99)
    broken = Output(clock, "supply.b", told=told, error=ZeroDivisionError("a defect"), tries=99)
    fine = Output(clock, "relays", told=told)
    steps = (replace(COIL, output="supply.a"), replace(COIL, output="supply.b"), RELAYS)
    safe, results = take(*steps, supply_a=dead, supply_b=broken, relays=fine)
    assert not safe
    assert [(result.output, result.state, result.ok) for result in results] == [
        ("supply.a", "off", False),
        ("supply.b", "off", False),
        ("relays", "released", True),
    ]
    assert [result.detail for result in results] == [
        "psu1: no reply",
        "ZeroDivisionError: a defect",
        "read back",
    ]
    assert [name for name, _ in told] == ["supply.a"] * 3 + ["supply.b"] * 3 + ["relays"]


def test_output_that_nothing_fills_is_a_result():
    """A line for a role that is not there fails, and the next is taken."""
    safe, results = take(COIL, RELAYS, relays=Output(VirtualClock(), "relays"))
    assert not safe
    assert [result.ok for result in results] == [False, True]


@pytest.mark.parametrize(("failures", "safe"), [(0, True), (2, True), (3, False)])
def test_three_tries(failures, safe):
    """Two silences are forgiven, the third is not; tries are 50 ms apart."""
    output = Output(VirtualClock(), error=NoReply("psu1", "no reply"), tries=failures)
    assert take(COIL, supply_coil=output)[0] is safe
    assert [at for _, at in output.told] == [0.0, 0.05, 0.1][: failures + 1]


def test_proof_waits_for_a_falling_current():
    """A current that takes 0.5 s to fall is a proof after 0.5 s, with its number in the detail."""
    safe, (result,) = take(COIL, supply_coil=Output(VirtualClock(), falls=0.5))
    assert safe
    assert result.seconds == pytest.approx(0.5, abs=0.05)
    assert result.detail == "supply.coil current 0 A"


def test_current_that_falls_slowly_has_the_whole_time_limit():
    """Switched off again in between, 1.9 s of 2 s are enough; 2.1 s are not."""
    slow = Output(VirtualClock(), falls=1.9)
    assert take(COIL, supply_coil=slow)[0]
    assert len(slow.told) == 3
    safe, (result,) = take(COIL, supply_coil=Output(VirtualClock(), falls=2.1))
    assert not safe
    assert result.detail == "supply.coil current 0.5 A, -0.001 to 0.001 A is safe"
    assert 1.9 <= result.seconds <= 2.1


def test_output_that_says_off_and_is_not_is_switched_off_again():
    """A command that was acknowledged and not obeyed is repeated while there is time."""
    output = Output(VirtualClock(), tries=2)
    safe, (result,) = take(COIL, supply_coil=output)
    assert safe
    assert len(output.told) == 2
    assert result.seconds < 1.0


def test_reading_that_is_no_number_proves_nothing():
    """NaN is waited for until the time is over, and then it is not safe."""
    output = Output(VirtualClock())
    output.current = lambda: Figure(value=float("nan"), unit="A")
    safe, (result,) = take(COIL, supply_coil=output)
    assert not safe
    assert "supply.coil current nan A" in result.detail


def test_reached_too_late_is_not_safe():
    """An output that was off after 3 s of 2 s allowed is told so; there is no second try without time."""
    output = Output(VirtualClock(), takes=3.0)
    safe, (result,) = take(COIL, supply_coil=output)
    assert not safe
    assert result.detail == "reached after 3 s, 2 s allowed"


def test_a_bench_that_is_served_faster_than_time_has_the_limits_of_the_wall():
    """What this computer takes counts many times there, and is no delay of an output; 3 s are 0.75 s of the wall."""
    told = []
    output = Output(VirtualClock(), takes=3.0)
    assert make_safe([COIL], {"supply.coil": output}, output.clock, told.append, speed=4.0)
    assert told[0].ok
    assert not make_safe([COIL], {"supply.coil": Output(output.clock, takes=9.0)}, output.clock, told.append, speed=4.0)
    assert told[1].detail == "reached after 9 s, 8 s allowed"
    assert len(output.told) == 1


def test_teller_that_fails_does_not_stop_the_rest():
    """A full disk at the first result: the other lines are taken, then it is raised."""
    clock, told = VirtualClock(), []
    outputs = {name: Output(clock, name, told=told) for name in ("supply.coil", "relays")}

    def tell(result):
        raise OSError(28, f"no space for {result.output}")

    with pytest.raises(OSError, match="no space for supply.coil"):
        make_safe((COIL, RELAYS), outputs, clock, tell)
    assert [name for name, _ in told] == ["supply.coil", "relays"]


def test_nothing_to_do_is_safe():
    """A bench without outputs has none to make safe."""
    assert make_safe((), {}, VirtualClock(), lambda _: None)
