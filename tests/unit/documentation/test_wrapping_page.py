"""The package of the page on vendors' drivers: simulated, as hardware in a process of its own, and guarded."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import time
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from wrapped_package import PAGE, paths_of, written

from hil.bench.binding import bind_replayed, bind_simulated
from hil.bench.file.reading import load_bench
from hil.bench.live import bind_live, reach_of_hardware
from hil.bench.port_identity import source_gates
from hil.cli.main import main
from hil.documents import offers
from hil.executive.watching.coverage import plan_of
from hil.guardian.client import Guardian
from hil.guardian.ports.dialogue import Patience
from hil.guardian.ports.worker import PortWorker
from hil.instruments.wrapped import Wrapped
from hil.model.bench import Wire
from hil.model.errors import ClampExceeded, ConfigurationError, NoReply, Refused, Rejected
from hil.model.identity import Source
from hil.wire.transcript import Transcript, read_transcript

EPOCH = "2026-01-01T00:00:00Z"


@pytest.fixture(scope="module", autouse=True)
def project(tmp_path_factory):
    """Install the page's package and the vendor's, for this process and those that it starts."""
    folder = written(tmp_path_factory.mktemp("acme"))
    entries = [str(folder / "site"), str(folder / "src")]
    before, sys.path[:0] = os.environ.get("PYTHONPATH"), entries
    offers._installed.cache_clear()
    os.environ["PYTHONPATH"] = paths_of(folder)
    yield folder
    for each in entries:
        sys.path.remove(each)
    offers._installed.cache_clear()
    os.environ.pop("PYTHONPATH") if before is None else os.environ.update(PYTHONPATH=before)
    for name in [name for name in sys.modules if name.partition(".")[0] == "acme_hil"]:
        del sys.modules[name]


@pytest.fixture
def spec(project):
    """Return the page's bench."""
    return load_bench(project / "fixtures/benches", "desk", project)


@pytest.fixture
def acme(tmp_path, spec):
    """Return the vendor's instrument, and the bench where it is."""
    file = tmp_path / "instrument.json"
    file.write_text(json.dumps({"voltage": 0.0, "limit": 0.0, "on": True}), encoding="utf-8")
    item = replace(spec.instruments[0], port=f"vendor:{str(file)[1:]}")
    return file, replace(spec, instruments=(item,))


def said(file):
    """Return the true state of the instrument."""
    return json.loads(file.read_text(encoding="utf-8"))


def test_the_stand_in_is_driven_and_replayed(spec, tmp_path):
    """Calls are recorded in the place of bytes, and are enough for a replay."""
    record = tmp_path / "transcript.tsv"
    with record.open("wb", buffering=0) as sink:
        transcript = Transcript(sink)
        with closing(bind_simulated(spec, transcript)) as bench:
            who = bench.drivers["psu1"].identify()
            assert who.simulated
            assert (who.unmarked.model, who.unmarked.serial) == ("P30", "A1")
            supply = bench.roles["supply"]
            supply.configure(voltage=5.0, current=0.4)
            supply.enable()
            found = (supply.voltage(), supply.current(), supply.enabled(), bench.drivers["psu1"].outlets()[0].on)
            state = bench.world.serial_peers["psu1"].state()
            supply.disable()
            assert not supply.enabled()
            bench.world.serial_peers["psu1"].restore(state)
            assert supply.enabled()
            with pytest.raises(ClampExceeded, match="outside its clamp"):
                supply.configure(voltage=5.1, current=0.4)
        transcript.flush()
    assert [(each.value, each.unit) for each in found[:2]] == [(4.0, "V"), (0.4, "A")]
    assert found[2:] == (True, True)
    assert any(b'"call":"configure"' in each.sent for each in read_transcript(record))
    with closing(bind_replayed(spec, Transcript(None), record, lambda: "")) as bench:
        assert bench.drivers["psu1"].identify() == who
        bench.roles["supply"].configure(voltage=5.0, current=0.4)


def test_the_vendors_driver_is_called_in_its_own_process(acme):
    """Settings are read back, what is set at the front panel is clamped, and what it raises is a fault."""
    file, spec = acme
    with closing(bind_live(spec, reach_of_hardware(spec), EPOCH, Transcript(None))) as bench:
        assert bench.drivers["psu1"].identify().serial == "A1"
        supply = bench.roles["supply"]
        supply.disable()
        supply.configure(3.3, current=0.5)
        supply.enable()
        assert said(file) == {"voltage": 3.3, "limit": 0.5, "on": True}
        assert supply.sample() == pytest.approx((3.3, 0.33))
        assert "acme_power" not in sys.modules
        file.write_text(json.dumps({**said(file), "voltage": 12.0}), encoding="utf-8")
        with pytest.raises(ClampExceeded):
            supply.enable()
        file.write_text(json.dumps({**said(file), "voltage": 3.0, "limit": None}), encoding="utf-8")
        with pytest.raises(ClampExceeded, match="current nan A"):
            supply.enable()
        file.write_text(json.dumps({"on": False}), encoding="utf-8")
        with pytest.raises(Rejected, match="voltage: KeyError: 'voltage'|settings: KeyError: 'voltage'"):
            supply.enable()
        file.write_text(json.dumps({"broken": True}), encoding="utf-8")
        with pytest.raises(NoReply, match="voltage: TimeoutError: no answer"):
            supply.voltage()


@pytest.mark.parametrize(
    ("role", "why"),
    [
        ("relays", "each contact is an output of its own"),
        ("rotation_table", "nothing would hold its clamp on turns"),
    ],
)
def test_a_role_that_calls_alone_cannot_keep_safe_is_refused(spec, role, why):
    """A generic wrapper would let through what its clamps forbid."""
    driver = type("Other", (Wrapped,), {"roles": frozenset({role}), "made_by": "a:b"})
    with (
        closing(bind_simulated(spec, Transcript(None))) as bench,
        pytest.raises(Refused, match=f"the role {role} cannot be wrapped, because {why}"),
    ):
        driver(bench.drivers["psu1"]._connection).role(Wire(role=role, instance="", instrument="psu1"))


def test_what_is_set_needs_a_clamp(spec):
    """As a load that is told to hold a voltage for which the bench file has none."""
    spec = replace(spec, clamps=spec.clamps[:1])
    with (
        closing(bind_simulated(spec, Transcript(None))) as bench,
        pytest.raises(Refused, match="current needs a clamp"),
    ):
        bench.roles["supply"].configure(1.0, 0.1)


def test_a_meter_that_reads_one_quantity_is_recorded(spec):
    """By the channels that its driver names, without the others of its role."""
    driver = type(
        "Meter", (Wrapped,), {"roles": frozenset({"multimeter"}), "made_by": "a:b", "quantities": ("voltage",)}
    )
    with closing(bind_simulated(spec, Transcript(None))) as bench:
        meter = driver(bench.drivers["psu1"]._connection).role(Wire(role="multimeter", instance="", instrument="psu1"))
        assert [(each.name, each.unit) for each in meter.channels()] == [("voltage", "V")]
        assert meter.sample() == (0.0,)


def test_what_cannot_be_opened_says_why(acme):
    """In one line, with what was called."""
    file, spec = acme
    file.unlink()
    with pytest.raises(NoReply, match=r"acme_hil.wrapper:Acme: RuntimeError: no ACME at .* is it on\?"):
        bind_live(spec, reach_of_hardware(spec), EPOCH, Transcript(None))


def test_its_safe_bytes_are_calls(acme, tmp_path):
    """They end half a line, and what they prove is asked of the instrument, not remembered."""
    file, spec = acme
    spec = replace(spec, instruments=(replace(spec.instruments[0], timeout_s=1.0),))
    with closing(bind_live(spec, reach_of_hardware(spec), EPOCH, Transcript(None))) as bench:
        plan = plan_of(bench, tmp_path, ())
        (port,), (output,) = plan.ports, plan.outputs
        worker = PortWorker(port, os.dup(bench.descriptors["psu1"]))
        bench.ports[0].write(b'{"number":1,"call":"ena')  # the run dies in the middle of a line
        assert worker.begin(output.code, Patience(), reopen=True).result(5.0).ok
        assert worker.off(output.code, Patience()).result(5.0).ok
        assert not said(file)["on"]
        proof = worker.prove(output.code).result(5.0)
        assert proof.ok, proof.detail
        worker.recognise(output.code).result(5.0)
        assert b'"serial":"A1"' in worker._who
        file.write_text(json.dumps({**said(file), "on": True, "voltage": 4.0}), encoding="utf-8")
        assert not worker.prove(output.code).result(5.0).ok
        worker._lose("the test has ended")
    _must_end(file)


@pytest.mark.system
def test_the_guardian_switches_it_off_whoever_is_dead(acme, tmp_path):
    """Its drill proves it; later the vendor's process dies and the run after it: the guardian starts it again."""
    file, spec = acme
    spec = replace(spec, instruments=(replace(spec.instruments[0], timeout_s=1.0),))
    (tmp_path / "data").mkdir()
    with closing(bind_live(spec, reach_of_hardware(spec), EPOCH, Transcript(None))) as bench:
        guardian = Guardian.start(plan_of(bench, tmp_path, ()), bench.descriptors)
        drilled = guardian.drill()
        assert all(each.ok for each in drilled), drilled
        assert not said(file)["on"]
        guardian.watch()
        bench.roles["supply"].configure(voltage=3.0, current=1.0)
        bench.roles["supply"].enable()
        assert said(file)["on"]
        _kill_hosts_of(file)
        guardian.close()
        until = time.monotonic() + 20.0
        while said(file)["on"]:
            assert time.monotonic() < until, "it is still on"
            time.sleep(0.02)
    _must_end(file)


@pytest.mark.usefixtures("spec")
def test_the_pages_check_prints_what_the_page_shows(project, monkeypatch, capsys):
    """The bench of the page, simulated."""
    monkeypatch.chdir(project)
    (project / "hil.toml").touch()
    with pytest.raises(SystemExit) as ended:
        main(["bench", "check", "desk", "--source", "simulated", "--energise"])
    assert ended.value.code == 0
    command, shown = re.findall(r"```console\n\$ (.*?)\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)[0]
    assert command == "hil bench check desk --source simulated --energise"
    assert capsys.readouterr().out == shown


def test_the_evidence_says_that_its_bytes_were_not_seen(acme):
    """As an exception where the bench file accepts it, else as what is left open."""
    _, spec = acme
    (gate,) = source_gates(spec, lambda _: ())
    assert gate.source is Source.HARDWARE
    assert gate.exception == (
        "its bytes were not seen, only the calls of its vendor's driver:"
        " the voltage is also read by dmm1, whose bytes are seen"
    )
    assert not gate.unproven
    spec = replace(spec, instruments=(replace(spec.instruments[0], bytes_unseen=""),))
    (gate,) = source_gates(spec, lambda _: ())
    assert not gate.exception
    assert gate.unproven.startswith("psu1: its bytes were not seen")


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (
            "    timeout: 2 s\n",
            '    baud: "9600"\n',
            "psu1 is opened by its vendor's driver, which sets its baud itself",
        ),
        ("    identity: {model: P30, serial: A1}\n", "", "psu1 is where its vendor's driver finds it, where anything"),
        ("driver: acme-psu", "driver: rigol-dp832", "rigol-dp832 is no wrapped driver, and cannot open 'vendor:ACME30"),
        ("driver: acme-psu", "driver: rigol-dp832", "the bytes of psu1 are seen: rigol-dp832 is no wrapped driver"),
    ],
)
def test_what_does_not_fit_is_refused(project, tmp_path, old, new, complaint):
    """At its place in the bench file."""
    text = (project / "fixtures/benches/desk/bench.yaml").read_text(encoding="utf-8")
    folder = tmp_path / "desk"
    folder.mkdir()
    (folder / "bench.yaml").write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=re.escape(complaint)):
        load_bench(tmp_path, "desk", tmp_path)


def _hosts_of(file):
    for each in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            line = each.read_bytes()
        except OSError:
            continue
        if b"hosted.py" in line and str(file)[1:].encode() in line:
            yield int(each.parent.name)


def _kill_hosts_of(file):
    for each in _hosts_of(file):
        os.kill(each, signal.SIGKILL)


def _must_end(file):
    until = time.monotonic() + 20.0
    while list(_hosts_of(file)):
        assert time.monotonic() < until, "a vendor's process is left"
        time.sleep(0.01)
