"""The guardian with the bytes of the real drivers, on the battery bench as another process serves it."""

from __future__ import annotations

import signal
import subprocess
import time
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import pytest
from guarded import Executive, lines_of
from served import ROOT
from workspaces import command_line

from hil.bench.file.reading import load_bench
from hil.bench.live import bind_live, reach_of_served
from hil.executive.watching.coverage import plan_of
from hil.guardian import latch
from hil.simulation.served.folder import ask
from hil.wire.transcript import Transcript

pytestmark = [pytest.mark.system, pytest.mark.alone]

ON = {
    "peers.psu1.channels.1.on": ("psu1", ":OUTP CH1,ON\n"),
    "peers.psu1.channels.2.on": ("psu1", ":OUTP CH2,ON\n"),
    "peers.psu2.output.on": ("psu2", "OUT1"),
}


@pytest.fixture
def stack():
    """Close in the reverse order what a test opens."""
    with ExitStack() as opened:
        yield opened


@pytest.fixture
def folder(tmp_path, stack):
    """Serve the battery bench, and return where."""
    where = tmp_path / "ends"
    process = subprocess.Popen(
        command_line("simulate", "battery", "--folder", str(where)),
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )
    stack.callback(process.wait, 60)
    stack.callback(process.stdout.close)
    stack.callback(process.send_signal, signal.SIGTERM)
    for line in process.stdout:
        if line == b"ready\n":
            return where
    raise AssertionError("it is not served")


def driven(folder, tmp_path, stack):
    """Return an executive with a guardian that was drilled, all of its supplies on, and the plan."""
    spec = load_bench(ROOT / "fixtures" / "benches", "battery", ROOT)
    reach = reach_of_served(spec, folder)
    with closing(bind_live(spec, reach, "2026-01-01T00:00:00Z", Transcript(lambda *_, **__: None))) as bench:
        for driver in bench.drivers.values():
            driver.identify()
        plan = replace(
            plan_of(bench, tmp_path, []), journal=str(tmp_path / "guardian.jsonl"), latches=(str(tmp_path / "1.latch"),)
        )
    executive = Executive(plan, dict(reach.ports), stack)
    until = time.monotonic() + 20.0
    while wrong := [each for each in executive.ask("drill")["results"] if not each["ok"]]:
        assert time.monotonic() < until, wrong  # the cycler's board starts over when its port is opened again
    executive.arm()
    for path, (device, text) in ON.items():
        executive.ask("write", device=device, text=text)
        wait_for(folder, path, on=True)  # the supply is slow, and would lose a second line
    return executive, plan


def wait_for(folder, *paths, on):
    """Ask until it is true of all of these outputs that they are on, or off."""
    until = time.monotonic() + 20.0
    while {next(iter(ask(folder, {"state": path}).values())) for path in paths} != {on}:
        assert time.monotonic() < until, paths


@pytest.mark.parametrize(("end", "limit_s"), [(signal.SIGKILL, 2.0), (signal.SIGSTOP, 3.0)])
def test_outputs_are_really_off(folder, tmp_path, stack, end, limit_s):
    """What the bench itself says is off in time, and everything is proven, through the bytes of the drivers."""
    executive, plan = driven(folder, tmp_path, stack)
    began = time.monotonic()
    executive.process.send_signal(end)
    wait_for(folder, *ON, on=False)
    assert time.monotonic() - began < limit_s + 1.0
    said = executive.wait_for_words()
    assert "all outputs are safe" in said
    assert {line["detail"] for line in lines_of(plan) if line["event"] == "proof" and line["ok"]} == {"safe"}
    assert latch.read(Path(plan.latches[0])).outputs == ()


def test_a_pulled_supply_is_cut_off_by_the_cycler(folder, tmp_path, stack):
    """The other outputs go off, and the supply's own cut path is proven where its port is gone."""
    executive, plan = driven(folder, tmp_path, stack)
    ask(folder, {"unplug": "psu1"})
    executive.process.kill()
    executive.wait_for_words()
    proofs = {line["output"]: line["detail"] for line in lines_of(plan) if line["event"] == "proof"}
    assert proofs["supply.charge"].startswith("cut off by cycler, which is safe; its port is gone")
    assert proofs["cycler"] == proofs["thermal"] == proofs["supply.tec"] == "safe"
    assert latch.read(Path(plan.latches[0])).outputs == ("supply.apparatus",)


def test_a_hub_that_is_unplugged_leaves_what_has_no_other_path(folder, tmp_path, stack):
    """What is on the network goes off and cuts the tester off; the coolers and their feed are named as not proven."""
    executive, plan = driven(folder, tmp_path, stack)
    for device in ("cycler1", "tec1", "psu2"):
        ask(folder, {"unplug": device})
    executive.process.kill()
    wait_for(folder, "peers.psu1.channels.1.on", "peers.psu1.channels.2.on", on=False)
    executive.wait_for_words()
    proofs = {line["output"]: line["detail"] for line in lines_of(plan) if line["event"] == "proof"}
    assert proofs["cycler"].startswith("cut off by supply.apparatus, which is safe; its port is gone")
    assert latch.read(Path(plan.latches[0])).outputs == ("thermal", "supply.tec")
    assert ask(folder, {"state": "peers.psu2.output.on"}) == {"state": True}
