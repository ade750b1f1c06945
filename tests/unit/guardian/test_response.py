"""All outputs in order, and none kept on by what goes wrong at another."""

from __future__ import annotations

import os
import select
import threading
import time
from contextlib import ExitStack

import pytest
from guarded import DistantInstrument, Instrument, code, lines_of, output_of, plan_of

from hil.guardian.incident import IncidentLog
from hil.guardian.ports.outputs import Outputs, switch_off
from hil.guardian.ports.worker import Outcome, PortWorker
from hil.guardian.response import Response, state_of
from hil.model.safing import Exchange, GuardedOutput, GuardedPort, SafeBytes

SAFE = Outcome(ok=True)
REFUSED = Outcome(ok=False, detail="said 'on'")
GONE = Outcome(ok=False, detail="its port is gone", silent=True)


@pytest.fixture
def stack():
    """Close in the reverse order what a test opens."""
    with ExitStack() as opened:
        yield opened


def facing(stack, plan, **instruments):
    """Return who acts on instruments."""
    workers = {name: PortWorker(GuardedPort(device=name), os.dup(each.near)) for name, each in instruments.items()}
    for each in instruments.values():
        stack.callback(each.close)
    return Outputs(plan, workers, lambda: None)


def broken(device: str) -> GuardedOutput:
    """Return an output whose bytes nobody can work with."""
    return GuardedOutput(
        output="broken",
        state="off",
        device=device,
        within_s=0.1,
        code=SafeBytes(off=(Exchange(send=b"OFF 1\n", expect=b"("),), proof=(Exchange(send=None, expect=b"x"),)),
    )


def test_what_nobody_foresaw_at_one_output_keeps_no_other_on(tmp_path, stack):
    """An exception in the middle of an output is that output's matter, also for others on its port."""
    psu, relay = Instrument(2), Instrument()
    outputs = broken("psu"), output_of("two", "psu", 2), output_of("relay", "board")
    outputs = facing(stack, plan_of(tmp_path, *outputs), psu=psu, board=relay)
    assert outputs.first_pass()["broken"].detail.startswith("unexpected: ")
    proofs = outputs.round()
    assert (psu.on, relay.on) == (set(), set())
    assert {name: proof.ok for name, proof in proofs.items()} == {"broken": False, "two": True, "relay": True}


def test_a_descriptor_that_is_none_keeps_no_other_on(tmp_path, stack):
    """A port that could not be taken over is gone from the start."""
    relay = Instrument()
    plan = plan_of(tmp_path, output_of("one", "psu"), output_of("relay", "board"))
    outputs = facing(stack, plan, board=relay)
    closed = os.open("/dev/null", os.O_RDWR)
    os.close(closed)
    outputs._workers["psu"] = PortWorker(GuardedPort(device="psu"), closed)
    assert outputs.first_pass()["one"].silent
    assert outputs.round()["relay"].ok


@pytest.mark.parametrize("what", ["first_pass", "round"])
def test_every_step_is_taken_though_one_before_it_breaks(tmp_path, stack, monkeypatch, what):
    """The bench is latched whatever happened, with every output that is not known to be safe."""
    psu = Instrument()
    plan = plan_of(tmp_path, output_of("one", "psu", within_s=0.0))
    outputs = facing(stack, plan, psu=psu)
    monkeypatch.setattr("hil.guardian.response._KEEPS_S", 0.0)
    monkeypatch.setattr(outputs, what, lambda: 1 // 0)
    response = Response(plan, outputs, IncidentLog(plan), -1)
    assert response.act("why", kill=False)
    assert psu.on == set()
    assert (tmp_path / "latches" / "one.latch").exists()
    assert "ZeroDivisionError" in (tmp_path / "guardian.jsonl").read_text()


@pytest.mark.parametrize(
    ("own", "other", "said"),
    [
        (SAFE, REFUSED, "safe"),
        (GONE, SAFE, "cut off by relay, which is safe; its port is gone"),
        (GONE, GONE, "not proven: its port is gone"),
        (REFUSED, SAFE, "not proven: said 'on'"),
    ],
)
def test_a_cut_path_counts_only_for_a_port_that_is_gone(own, other, said):
    """An instrument that answers that it is on is on, whatever else is open."""
    outputs = output_of("supply", "psu", cut_by=("relay",)), output_of("relay", "board")
    assert state_of(outputs, {"supply": own, "relay": other})["supply"] == said


def test_a_line_is_brought_in_step_once_a_round(tmp_path, stack):
    """Outputs of one port share its resynchronisation, in every round."""
    psu = Instrument(2)
    outputs = facing(stack, plan_of(tmp_path, output_of("one", "psu"), output_of("two", "psu", 2)), psu=psu)
    outputs.round()
    assert [line for _, line in psu.heard if line != b""] == [
        b"SYNC", b"OFF 1", b"OFF 2", b"ON? 1", b"CURR? 1", b"ON? 2", b"CURR? 2",
    ]  # fmt: skip
    outputs.round()
    assert len(psu.said(b"SYNC")) == 2
    assert code().resync


def test_no_output_waits_for_the_replies_of_another(tmp_path, stack):
    """Four outputs on two slow lines are switched off in less time than two replies take, and no reply is left over."""
    one, two = DistantInstrument(2), DistantInstrument(2)
    for each in (one, two):
        each.latency_s = 0.3
        stack.callback(each.close)
    names = ("a", "one", 1), ("b", "two", 1), ("c", "one", 2), ("d", "two", 2)
    plan = plan_of(tmp_path, *[output_of(*name, reply_s=0.35) for name in names])
    before, looks = threading.active_count(), []
    switch_off(plan, {"one": one.near, "two": two.near}, lambda: looks.append(time.monotonic()))
    assert (one.on, two.on) == (set(), set())
    times = [at for each in (one, two) for at, said in each.heard if said.startswith(b"OFF")]
    assert len(times) == 4
    assert max(times) - min(times) < 0.6
    assert len(looks) > 5
    for each in (one, two):
        assert select.select([each.near], [], [], 0.0)[0] == []
        os.write(each.near, b"WHO?\n")
        assert os.read(each.near, 100) == b"i am psu 1\n"
    assert threading.active_count() == before


def test_a_port_that_is_gone_keeps_no_other_one_on(tmp_path, stack):
    """Who drives the bench is told, and goes on."""
    pulled, relay = Instrument(), Instrument()
    stack.callback(relay.close)
    plan = plan_of(tmp_path, output_of("one", "psu"), output_of("relay", "board"))
    gone = os.dup(pulled.near)
    stack.callback(os.close, gone)
    pulled.close()
    done = switch_off(plan, {"psu": gone, "board": relay.near})
    assert (done["one"].ok, done["relay"].ok) == (False, True)
    assert relay.on == set()


def test_another_device_under_the_name_of_one_that_is_gone_gets_no_byte(tmp_path, stack):
    """A port is reopened only where the same device is behind it."""
    pulled, other = Instrument(), Instrument()
    stack.callback(other.close)
    worker = PortWorker(GuardedPort(device="psu", url=other.url), os.dup(pulled.near))
    worker._identity = ("0403", "6001", "A50285BK")
    pulled.close()
    outputs = Outputs(plan_of(tmp_path, output_of("one", "psu")), {"psu": worker}, lambda: None)
    outputs.first_pass()
    assert "is no USB device now, not 0403 6001 A50285BK" in outputs.round()["one"].detail
    assert other.heard == []


def test_the_terminal_of_another_program_gets_no_byte(tmp_path, stack):
    """A served bench that was killed leaves a link, which may lead to another bench by now, or to a person's shell."""
    killed, other = Instrument(), Instrument()
    stack.callback(other.close)
    link = tmp_path / "link"
    link.symlink_to(other.url)
    os.utime(link, (0.0, 0.0), follow_symlinks=False)
    worker = PortWorker(GuardedPort(device="psu", url=str(link)), os.dup(killed.near))
    killed.close()
    outputs = Outputs(plan_of(tmp_path, output_of("one", "psu")), {"psu": worker}, lambda: None)
    outputs.first_pass()
    assert "another program has opened since" in outputs.round()["one"].detail
    assert other.heard == []


class Flapping:
    """Outputs whose proofs read another number each time, until they are proven after so many turns."""

    def __init__(self, turns: int) -> None:
        self.turns = turns
        self.rounds = 0

    def first_pass(self) -> dict[str, Outcome]:
        """Switch off."""
        return {"one": SAFE}

    def round(self) -> dict[str, Outcome]:
        """Prove it in a round of its own at the end."""
        self.rounds += 1
        return {"one": self._outcome()}

    def turn(self, _names) -> dict[str, Outcome]:
        """Try again."""
        self.turns -= 1
        return {"one": self._outcome()}

    def _outcome(self) -> Outcome:
        return SAFE if self.turns <= 0 else Outcome(ok=False, detail=f"said '{self.turns}'")


def test_hours_of_trying_make_no_long_journal(tmp_path, monkeypatch):
    """Proofs are noted some hundred times in words; that one is safe in the end is noted all the same."""
    plan = plan_of(tmp_path, output_of("one", "psu", within_s=0.0))
    monkeypatch.setattr("hil.guardian.response._KEEPS_S", 0.0)
    monkeypatch.setattr("hil.guardian.response._LOOK_S", 0.0)
    monkeypatch.setattr("hil.guardian.latch._sync", lambda _: None)
    outputs, told = Flapping(1000), []
    log = IncidentLog(plan)
    monkeypatch.setattr(log, "save", lambda: None)
    assert Response(plan, outputs, log, -1, told.append).act("why", kill=False)
    monkeypatch.undo()
    log._executive = None
    log.save()
    events = [line["event"] for line in lines_of(plan)]
    assert events.count("proof") < 210
    assert events.count("latched") == 1
    assert events[-1] == "done"
    assert outputs.rounds == 2
    assert told == [("one",)]


def test_each_port_is_tried_by_itself(tmp_path, stack):
    """One that is silent does not keep another, which was proven late, waiting; nothing blocks."""
    dead, psu = Instrument(), Instrument()
    dead.dead = psu.refuses = True
    outputs = facing(stack, plan_of(tmp_path, output_of("one", "psu"), output_of("two", "dead")), psu=psu, dead=dead)
    proofs = {}
    began = time.monotonic()
    while len(psu.said(b"OFF 1")) < 2:
        proofs |= outputs.turn(("one", "two"))
        time.sleep(0.01)
        assert time.monotonic() < began + 20.0
    assert not proofs["one"].ok
    psu.refuses = False
    while not (found := outputs.turn(("one",)).get("one")) or not found.ok:
        time.sleep(0.01)
        assert time.monotonic() < began + 20.0
    assert psu.on == set()


def test_an_executive_that_left_finds_its_folder_as_it_was(tmp_path):
    """What becomes of the outputs while it lives is noted and not written; into a sealed folder it never is."""
    plan = plan_of(tmp_path, output_of("one", "psu"))
    log = IncidentLog(plan)
    log.note("acting", why="it left")
    log.save()
    alive, end = os.pipe()
    log.wait_for(alive)
    log.note("proof", output="one", ok=True, detail="safe")
    log.save()
    assert [line["event"] for line in lines_of(plan)] == ["acting"]
    os.close(end)
    log.save()
    assert [line["event"] for line in lines_of(plan)] == ["acting", "proof"]
    (tmp_path / "bagit.txt").write_text("")
    log.note("done", unproven=())
    log.save()
    assert len(lines_of(plan)) == 2
    os.close(alive)
