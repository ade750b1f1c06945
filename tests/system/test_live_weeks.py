"""Weeks on a served bench that lose a port, a hub, the guardian and the machine: each time the run is resumed."""

from __future__ import annotations

import html
import os
import re
import signal

import numpy as np
import pytest
from live_runs import seconds_until
from live_weeks import HUB, OTHER_BOOT, PLATES, weeks
from moved_clocks import machine
from told_as_json import bodies

from hil.evidence.folder import JOURNAL
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.alone]

DAY = 86400.0
GLITCH_S = 600
"""How long the machine was off, by the time of day."""


def unplugged(run, devices, away_s):
    """Pull plugs, and put them back after a while."""
    for device in devices:
        run.bench.ask(unplug=device)
    began = os.times().elapsed
    seconds_until(lambda: os.times().elapsed - began >= away_s, away_s + 60.0, "away for long enough")
    for device in devices:
        run.bench.ask(plug=device)


def stopped(run, codes, state, reason):
    """Wait until the run has ended unsealed, with that state and reason."""
    ended = run.ended()
    assert ended.code in codes, ended.out
    assert not (run.folder / "bagit.txt").exists()
    shown = run.workspace.hil("status", run.folder.name).out
    assert re.search(rf"^state +({state})$", shown, re.MULTILINE), shown
    assert re.search(rf"^stopped by +{reason}", shown, re.MULTILINE), shown
    assert re.search(rf"^next +hil (ack .*, then hil )?resume {run.folder.name}$", shown, re.MULTILINE), shown


def a_glitch(run, _):
    """A port is gone, and back at once."""
    unplugged(run, ["psu2"], 0.5)
    stopped(run, {2, 7}, "SAFED|INTERRUPTED", r"a lost port: (psu2: its port|the port of psu2) is gone")


def a_hub(run, away_s):
    """All that hangs on a hub is away for a while."""
    unplugged(run, HUB, away_s)
    stopped(run, {2, 7}, "SAFED|INTERRUPTED", "a lost port: .*is gone")
    seconds_until(lambda: not run.bench.on(), 10.0, "safe after its return")


def a_guardian(run, _):
    """Nobody watches over the run; and it is resumed only where every port is there."""
    os.kill(run.guardian, signal.SIGKILL)
    stopped(run, {2}, "INTERRUPTED", "a lost guardian: the guardian is gone")
    assert not run.bench.on()
    before = (run.folder / JOURNAL).read_bytes()
    run.bench.ask(unplug="tec1")
    refused = run.workspace.hil("resume", run.folder.name, "--served", str(run.bench.folder))
    run.bench.ask(plug="tec1")
    assert (refused.code, "tec1" in refused.err) == (4, True), refused.err
    assert (run.folder / JOURNAL).read_bytes() == before


def a_reboot(run, _):
    """The machine starts over, some minutes later."""
    assert run.kill().code == 3
    run.machine.is_set(GLITCH_S)


def lived_through(root, clocks, *, speed, turns, turn_s, every_s, away_s):
    """Run the plan, end it four times and resume it.

    Returned are its package, the rows on the disk at each ending, and how many endings nobody asked for.
    """
    with weeks(root, clocks, speed=speed, turns=turns, turn_s=turn_s, every_s=every_s) as run:
        for part, end in enumerate((a_glitch, a_hub, a_guardian, a_reboot), 1):
            run.wait_for(part * turns // 5 + 1)
            end(run, away_s)
            run.resume(OTHER_BOOT if end is a_reboot else "")
        ended = run.sealed()
        assert ended.code == 0, ended.out
        return Package(run.folder), run.kept, run.unasked


def judge(package, kept, unasked, turns):
    """Require that no row is missing that was on the disk, and that the package tells how it came about."""
    assert verify(package.folder).findings == ()
    for at, rows in enumerate(kept):
        assert len(rows) == 3
        for name, written in rows.items():
            found = package.recording(name)
            sealed = np.column_stack([found.time, *found.arrays.values()]).tobytes()
            assert sealed[: len(written)] == written, (at, name)
            assert len(sealed) > len(written) > 0
    assert len(bodies(package, "resumed")) >= 4
    lost = bodies(package, "lost")
    assert [event["what"] for event in lost if event["what"] != "reply"] == ["port", "port", "guardian"] or unasked
    (reboot,) = bodies(package, "reboot")
    assert reboot["seconds"] == pytest.approx(GLITCH_S, abs=120)
    assert all(event["resumable"] for event in bodies(package, "stop"))
    (case,) = package.outcome().cases
    assert case.verdict == "PASS"
    assert len(case.checks) == turns
    page = html.unescape(package.text("data/report/report.html"))
    assert all(event["text"] in page for event in lost)
    assert replay(package).differences == ()


@pytest.mark.timeout(300)
def test_minutes_with_every_ending(tmp_path_factory):
    """The four endings, each once, in some hours of bench time."""
    root = tmp_path_factory.mktemp("w")
    made = lived_through(root, machine(root), speed=500.0, turns=10, turn_s=400.0, every_s=20.0, away_s=2.0)
    judge(*made, 10)


@pytest.mark.soak
@pytest.mark.timeout(1800)
def test_thirty_five_days(tmp_path_factory):
    """The same in 35 days of bench time, with a hub that is away for a minute of the wall."""
    root = tmp_path_factory.mktemp("w")
    made = lived_through(root, machine(root), speed=10_000.0, turns=70, turn_s=43_200.0, every_s=600.0, away_s=60.0)
    judge(*made, 70)
    package, *_ = made
    assert package.recording(PLATES).time[-1] > 35 * DAY
