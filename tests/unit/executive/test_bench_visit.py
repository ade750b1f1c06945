"""Visits to a bench outside runs: what is not as the bench file says is a gate that does not hold."""

from __future__ import annotations

import os
import signal
import time

import pytest
from workspaces import make

from hil.bench.lease import Lease
from hil.bench.live import Reach
from hil.bench.safe_off import SafeResult, make_safe
from hil.cli.commands.bench import command
from hil.clock.live import LiveClock
from hil.executive import bench_visit
from hil.executive.bench_visit import Checked, check_bench, safe_bench
from hil.executive.ending.stop import Stopped
from hil.executive.watching.ports import NoMachine
from hil.model.identity import Source


@pytest.mark.parametrize("energise", [False, True])
def test_a_served_port_that_is_gone_is_a_gate_that_does_not_hold(tmp_path, monkeypatch, energise):
    """Nothing after it is looked at, and nothing is driven."""
    workspace = make(tmp_path / "workspace")
    gone = Reach(source=Source.SIMULATED, ports={"psu1": str(tmp_path / "gone")}, served=tmp_path)
    monkeypatch.setattr("hil.executive.bench_visit.reach_of", lambda *_: gone)
    gates = []
    checked = check_bench(
        workspace.root, "adcs", Source.SIMULATED, energise=energise, served=tmp_path, tell=gates.append
    )
    assert (checked.ready, checked.safe) == (False, True)
    assert [(gate.name, gate.ok) for gate in gates] == [("port of psu1", False)]
    assert "cannot be opened" in gates[0].detail


@pytest.fixture
def bench(tmp_path, monkeypatch):
    """Return what keeps the benches that visits open, in a workspace that is the present folder."""
    workspace, opened = make(tmp_path / "workspace"), []
    monkeypatch.chdir(workspace.root)

    def bind(*given):
        opened.append(bound(*given))
        return opened[-1]

    bound = bench_visit.bind_simulated
    monkeypatch.setattr("hil.executive.bench_visit.bind_simulated", bind)
    return opened


def energised(tmp_path, tell):
    """Check with energy, and return the outcome with the gates."""
    gates = []

    def told(gate):
        gates.append(gate)
        tell(gate)

    root = tmp_path / "workspace"
    return check_bench(root, "adcs", Source.SIMULATED, energise=True, tell=told), gates


def voltages(bench):
    """Return what is at the coil and at the sensor in truth."""
    coil = bench.world.plants["coil"]
    return coil.observe("voltage"), coil.observe("sensor_power.voltage")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP], ids=lambda number: number.name)
def test_a_check_that_is_asked_to_end_switches_nothing_more_on(tmp_path, bench, number):
    """What was tried is off, the next output is not tried, and everything is proven safe."""
    before = signal.getsignal(number)

    def tell(gate):
        if gate.name.startswith("reduced level"):
            os.kill(os.getpid(), number)

    checked, gates = energised(tmp_path, tell)
    assert checked == Checked(ready=False, safe=True, stopped=number.name)
    assert len([gate for gate in gates if gate.name.startswith("reduced level")]) <= 2
    assert f"stopped by {number.name}" in gates[-2].detail
    assert (gates[-1].name, gates[-1].ok) == ("safe at the end", True)
    assert voltages(bench[0]) == (0.0, 0.0)
    assert signal.getsignal(number) is before


@pytest.mark.usefixtures("bench")
def test_time_that_passed_before_a_stop_is_not_that_of_the_safe_off(tmp_path, monkeypatch):
    """Bench time stands during the drill: it catches up first, or the safe-off would seem to be too late."""
    course, make_safe_of = [], bench_visit.ArmedBench.make_safe

    class Drilled(NoMachine):
        def gates(self, freshness):
            del freshness
            raise Stopped("SIGINT")

        def switch_off(self):
            course.append("switched off")

    def safe(armed, tell):
        course.append("made safe")
        return make_safe_of(armed, tell)

    monkeypatch.setattr("hil.executive.bench_visit.NoMachine", Drilled)
    monkeypatch.setattr("hil.executive.watching.timeline.OnBench.come", lambda *_, **__: course.append("caught up"))
    monkeypatch.setattr("hil.executive.bench_visit.ArmedBench.make_safe", safe)
    checked, _ = energised(tmp_path, lambda _: None)
    assert (checked.ready, checked.safe) == (False, True)
    assert course == ["switched off", "caught up", "made safe"]


def test_a_check_that_fails_amid_a_trial_leaves_the_bench_safe(tmp_path, bench):
    """Whatever the error is, and although nobody reads what is told."""

    def tell(gate):
        if gate.name == "safe state reached":
            bench[0].roles["supply.sensor"].configure(3.3, 0.02)
            bench[0].roles["supply.sensor"].enable()
            raise RuntimeError("an error of ours")

    with pytest.raises(RuntimeError, match="of ours"):
        energised(tmp_path, tell)
    assert voltages(bench[0]) == (0.0, 0.0)


def test_an_output_that_cannot_be_reached_any_more_is_told_at_the_end(tmp_path, bench):
    """A check does not say that the bench is ready, or safe, when its last look does not prove it."""

    def tell(gate):
        if gate.name == "envelope sensor-voltage":
            bench[0].ports[0].close()

    checked, gates = energised(tmp_path, tell)
    assert checked == Checked(ready=False, safe=False)
    assert (gates[-1].name, gates[-1].ok) == ("safe at the end", False)
    assert "is not off" in gates[-1].detail


@pytest.mark.parametrize(("most", "safe"), [("0.5", True), ("-0.5", False)])
@pytest.mark.usefixtures("bench")
def test_what_was_made_safe_is_watched_as_after_a_run(tmp_path, most, safe):
    """What does not behave as the bench file says is not safe, whatever the lines of the safe-off have proven."""
    file = tmp_path / "workspace/fixtures/benches/adcs/bench.yaml"
    line = f'{{output: supply.coil, quantity: current, unit: A, min: "-1", max: "{most}", for: 60 s}}'
    file.write_text(f"{file.read_text()}\nwatch_after:\n- {line}\n")
    checked, gates = energised(tmp_path, lambda _: None)
    assert checked == Checked(ready=safe, safe=safe)
    assert [(gate.name, gate.ok) for gate in gates[-2:]] == [
        ("supply.coil afterwards", safe),
        ("safe at the end", safe),
    ]


def test_a_slow_exchange_of_a_check_does_not_silence_its_heartbeat(tmp_path, monkeypatch, bench):
    """The guardian hears of a check that waits for an instrument, as it does of a run."""
    heard = []

    class Slow(NoMachine):
        """A machine whose first gate takes as long as an exchange may."""

        def between(self):
            """Count."""
            heard.append(time.monotonic())

        def gates(self, freshness):
            """Wait."""
            time.sleep(0.5)
            return ()

    def live(*given):
        found = bound(*given)
        found.live = LiveClock("2026-01-01T00:00:00Z")
        return found

    bound = bench_visit.bind_simulated
    monkeypatch.setattr("hil.executive.bench_visit.bind_simulated", live)
    monkeypatch.setattr("hil.executive.bench_visit.live_machine", lambda *_: Slow())
    checked, _ = energised(tmp_path, lambda _: None)
    assert checked.ready
    assert len(heard) >= 2
    assert bench[0].live is not None


@pytest.mark.parametrize("serial", ["MY59002391", "MY00000000"])
@pytest.mark.usefixtures("bench")
def test_safe_drives_no_other_instrument_that_answers_on_the_network(tmp_path, monkeypatch, serial):
    """An address may be another supply's by now: it is asked, and left alone; the rest is made safe."""
    file = tmp_path / "workspace/fixtures/benches/adcs/bench.yaml"
    file.write_text(file.read_text().replace("model: E36312A, serial: MY59002391", f"model: E36312A, serial: {serial}"))
    driven = []

    def made_safe(steps, *given, **more):
        driven.extend(step.output for step in steps)
        return make_safe(steps, *given, **more)

    monkeypatch.setattr(bench_visit, "make_safe", made_safe)
    results = safe_bench(tmp_path / "workspace", "adcs", Source.SIMULATED, tell=lambda _: None)
    ours = serial == "MY59002391"
    assert [(each.output, each.ok) for each in results] == [
        ("supply.coil", ours),
        ("relays", True),
        ("supply.sensor", ours),
    ]
    if not ours:
        other = "another instrument answers at the port of psu1: expected serial 'MY00000000', found 'MY59002391'"
        assert results[0].detail == f"not driven: {other}"
    assert driven == [each.output for each in results if each.ok]


@pytest.mark.parametrize(("held", "ok"), [(True, True), (False, False)])
@pytest.mark.usefixtures("bench")
def test_a_line_whose_replies_the_holder_of_the_bench_took_is_taken_again(tmp_path, monkeypatch, held, ok):
    """A guardian that keeps trying asks on the same lines; nothing is repeated where nobody else can be."""
    takes = []

    def made_safe(steps, *given, **more):
        takes.append(steps[0].output)
        if takes.count("supply.coil") < 3 and steps[0].output == "supply.coil":
            given[2](SafeResult("supply.coil", "off", ok=False, detail="psu1: no reply", seconds=0.5))
            return False
        return make_safe(steps, *given, **more)

    def leased(_, by_force):
        if held:
            by_force("psu1 is held by a run")
        return Lease((), "hil bench")

    monkeypatch.setattr(bench_visit, "make_safe", made_safe)
    monkeypatch.setattr(bench_visit, "_leased", leased)
    told = []
    results = safe_bench(tmp_path / "workspace", "adcs", Source.SIMULATED, tell=told.append)
    assert [(each.output, each.ok) for each in results] == [
        ("supply.coil", ok),
        ("relays", True),
        ("supply.sensor", True),
    ]
    assert takes == ["supply.coil", "relays", "supply.sensor", *(["supply.coil"] * 2 if held else [])]
    assert told == (["psu1 is held by a run"] if held else [])


@pytest.mark.parametrize(
    ("checked", "code", "last"),
    [
        (Checked(ready=True), 0, "ready"),
        (Checked(ready=False), 1, "not ready"),
        (Checked(ready=False, stopped="SIGINT"), 2, "stopped by SIGINT"),
        (Checked(ready=False, safe=False), 7, "not ready"),
        (Checked(ready=False, safe=False, stopped="SIGINT"), 7, "stopped by SIGINT"),
    ],
)
def test_what_happened_to_the_bench_outweighs_what_was_asked(monkeypatch, capsys, checked, code, last):
    """7 where an output was not proven safe, then 2 where it was stopped, then 1 where a gate does not hold."""
    monkeypatch.setattr(bench_visit, "check_bench", lambda *_, **__: checked)
    arguments = ("check", "adcs", "--source", "simulated", "--energise")
    assert command.main(arguments, standalone_mode=False) == code
    assert capsys.readouterr().out == f"{last}\n"
