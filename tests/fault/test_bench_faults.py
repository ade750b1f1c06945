"""A bench whose instruments fail while it is armed or made safe: nothing raises, nothing passes, nothing stays on."""

from __future__ import annotations

import pytest
from adcs_bench import adcs, bound, with_peer

from hil.bench.readiness import energised_gates, unpowered_gates
from hil.bench.safe_off import make_safe

NANO = 1_000_000_000


def faulty(device="psu1", **fault):
    """Return the bench with one fault of one peer."""
    return with_peer(adcs(), device, faults=({key.rstrip("_"): value for key, value in fault.items()},))


def switched_on(bench):
    """Put a board on the jig and switch everything on, as in the middle of a case."""
    bench.world.plants["coil"].command(board="z_plus")
    bench.roles["supply.sensor"].configure(3.3, 0.02)
    bench.roles["supply.sensor"].enable()
    bench.roles["relays"].close("a")
    bench.roles["relays"].close("b")
    bench.roles["supply.coil"].configure(5.0, 0.016)
    bench.roles["supply.coil"].enable()
    bench.clock.wait_until(10 * NANO)


def made_safe(bench):
    """Make the bench safe; return whether it is, and the results by output."""
    results = []
    safe = make_safe(bench.spec.safe_off, bench.roles, bench.clock, results.append)
    assert [result.output for result in results] == ["supply.coil", "relays", "supply.sensor"]
    return safe, {result.output: result for result in results}


def test_healthy_bench_is_made_safe():
    """Every line holds and the plant is without voltage, with the contacts released."""
    with bound(adcs()) as bench:
        switched_on(bench)
        safe, results = made_safe(bench)
        coil = bench.world.plants["coil"]
        assert safe
        assert all(result.ok for result in results.values())
        assert (coil.observe("voltage"), coil.observe("sensor_power.voltage")) == (0.0, 0.0)
        assert not coil.inputs["contact_a"]
        assert not coil.inputs["contact_b"]


@pytest.mark.parametrize(
    ("says", "words"),
    [("on", "supply.coil was switched off and is on"), ("off", "A, -0.001 to 0.001 A is safe")],
)
def test_output_that_stays_on_is_not_safe_whatever_it_says(says, words):
    """A supply that refuses, and one that says off and gives on: not safe, and the other lines are."""
    with bound(faulty(kind="refuse-off", channel="2", says=says, from_="10 s")) as bench:
        switched_on(bench)
        safe, results = made_safe(bench)
        assert not safe
        assert {output: result.ok for output, result in results.items()} == {
            "supply.coil": False,
            "relays": True,
            "supply.sensor": True,
        }
        assert words in results["supply.coil"].detail
        assert results["supply.coil"].seconds <= 2.2
        assert bench.world.plants["coil"].observe("current") == pytest.approx(0.016, rel=0.01)


@pytest.mark.parametrize("says", ["on", "off"])
def test_output_that_refuses_at_first_is_off_in_the_end(says):
    """A refusal that passes within the time limit is overcome by another try."""
    fault = {"kind": "refuse-off", "channel": "2", "says": says, "from": "10 s", "until": "10.06 s"}
    with bound(with_peer(adcs(), "psu1", faults=(fault,))) as bench:
        switched_on(bench)
        assert made_safe(bench)[0]
        assert bench.world.plants["coil"].observe("voltage") == 0.0


def test_dead_supply_is_not_safe_and_the_relays_are():
    """Silence is a result, and what can be made safe is."""
    with bound(faulty(kind="dead", from_="10 s")) as bench:
        switched_on(bench)
        safe, results = made_safe(bench)
        assert not safe
        assert [result.ok for result in results.values()] == [False, True, False]
        assert "psu1" in results["supply.coil"].detail
        assert bench.world.plants["coil"].inputs["contact_a"] is False


FAULTS = [
    {"kind": "garbled"},
    {"kind": "partial", "bytes": "1"},
    {"kind": "late", "by": "700 ms"},
    {"kind": "chatty", "every": "30 ms", "text": "?\r\n"},
]


@pytest.mark.parametrize(
    ("device", "fault"),
    [(device, fault) for device in ("psu1", "relay1") for fault in FAULTS] + [("psu1", {"kind": "not-a-number"})],
    ids=lambda part: part if isinstance(part, str) else part["kind"],
)
def test_no_fault_of_a_line_raises_or_looks_safe(device, fault):
    """Whatever comes back, every line gets its result; safe is said only of what is off."""
    with bound(with_peer(adcs(), device, faults=({**fault, "from": "10 s"},))) as bench:
        switched_on(bench)
        safe, results = made_safe(bench)
        coil = bench.world.plants["coil"]
        if results["supply.coil"].ok:
            assert coil.observe("voltage") == 0.0
        if results["relays"].ok:
            assert coil.inputs["contact_a"] is coil.inputs["contact_b"] is False
        if results["supply.sensor"].ok:
            assert coil.observe("sensor_power.voltage") == 0.0
        assert safe is all(result.ok for result in results.values())
        assert bench.clock.now() < 10 + 3 * 6


def ready(bench):
    """Go through all gates; return those that do not hold by name."""
    gates = (*unpowered_gates(bench), *energised_gates(bench, None))
    return {gate.name: gate.detail for gate in gates if not gate.ok}


def test_dead_supply_is_not_ready_and_nothing_is_tried():
    """Identity, outputs and safe state fail with the supply's name; no output is tried after that."""
    with bound(faulty(kind="dead")) as bench:
        wrong = ready(bench)
        assert list(wrong) == ["identity of psu1", "outputs of psu1", "safe state reached"]
        assert "psu1: " in wrong["identity of psu1"]
        assert wrong["safe state reached"].startswith("supply.coil is not off: psu1: ")
        assert "supply.sensor is not off: psu1: " in wrong["safe state reached"]


def test_supply_that_dies_during_its_trial_is_not_ready():
    """The trial fails with the silence, and that its output may be on is said besides."""
    with bound(adcs()) as bench:
        gates = energised_gates(bench, None)
        assert next(gates).ok
        after = f"{bench.clock.now() + 0.1:.3f} s"
    with bound(faulty(kind="dead", from_=after)) as bench:
        found = [gate for gate in energised_gates(bench, None) if not gate.ok]
        assert [gate.name for gate in found] == [
            "reduced level of supply.coil, relays released",
            "supply.coil off again",
        ]
        assert all("psu1: " in gate.detail for gate in found)


@pytest.mark.parametrize("says", ["on", "off"])
def test_output_that_stays_on_after_its_trial_ends_the_trials(says):
    """Whether the supply admits it or not: the next output is not tried, and a person reads why."""
    with bound(faulty(kind="refuse-off", channel="2", says=says)) as bench:
        bench.world.plants["coil"].command(board="z_plus")
        gates = list(energised_gates(bench, None))
        assert [gate.name for gate in gates if not gate.ok] == ["supply.coil off again"]
        assert gates[-1].detail.startswith("supply.coil is not off: ")
        assert bench.world.plants["coil"].observe("sensor_power.voltage") == 0.0


def test_dead_sensor_is_not_ready_and_its_supply_is_off():
    """What the bench feeds is identified under power; its silence is a gate, and the power is off again."""
    with bound(faulty("mag1", kind="dead")) as bench:
        wrong = ready(bench)
        assert list(wrong) == ["identity of mag1"]
        assert "mag1: " in wrong["identity of mag1"]
        assert bench.world.plants["coil"].observe("sensor_power.voltage") == 0.0


def test_other_instrument_at_the_port_is_not_ready():
    """Another supply answers: told by what was expected."""
    fault = {"kind": "identity", "value": "Keysight Technologies,E36313A,MY1,1.0"}
    with bound(with_peer(adcs(), "psu1", faults=(fault,))) as bench:
        wrong = ready(bench)
        assert wrong == {"identity of psu1": "expected model 'E36312A', found 'E36313A'"}
