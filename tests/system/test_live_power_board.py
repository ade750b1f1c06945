"""The power board on a served bench: the whole campaign, and a run that is killed while a case waits with a figure."""

from __future__ import annotations

import os
import shutil
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from live_runs import guardian_of, put_away, seconds_until, served
from told_as_json import bodies, results_as_json
from workspaces import ROOT, Workspace, executive, finish

from hil.evidence.events import RecordingEnd
from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.plugin.rehearsing import replay

pytestmark = [pytest.mark.system, pytest.mark.alone, pytest.mark.timeout(180)]

SPEED = 2.0
"""Beyond it, a busy computer makes the instant of an event too uncertain for the limit on the time to power on."""

REQUIREMENTS = """\
schema: hil/requirements/1
document: {id: WAIT, issue: "1.0", title: A figure that takes a while}
requirements:
- {id: WAIT-010, rev: 1, text: Twelve seconds shall last that long., kind: limit, method: test,
   limits: [{parameter: time, unit: s, min: "11.5", max: "14", decision: simple}]}
- {id: WAIT-020, rev: 1, text: What the supply reads shall be recorded for eleven seconds., kind: record, method: test,
   records: {recording: rail, channels: [voltage, current], rate: 1 Hz, duration: 11 s, max_gap: 3 s}}
"""
"""Limits that a busy computer does not miss: it may hold a sample up by a second of bench time and more."""

PLAN = '''\
"""A case that waits with `clock.until`."""

import pytest


@pytest.mark.requirement("WAIT-010", "WAIT-020")
@pytest.mark.max_duration(60)
@pytest.mark.repeatable("waiting changes nothing of the board")
def test_waiting(supply, relays, electronic_load, clock, check, record, step):
    """The rail is on all the time."""
    with step("Switch on"):
        supply.configure(7.4, 1.0)
        supply.enable()
        relays.close("feed")
        electronic_load.constant_current(0.5)
        electronic_load.enable()
    with step("Wait"), record.during("rail", supply, rate=2.0):
        since = clock.now()
        check("WAIT-010", "time", clock.until(
            lambda: electronic_load.voltage().value > 4.5 and clock.now() > since + 12.0, since=since, within=30.0,
            every=0.2,
        ))
'''


def workspace(root):
    """Return a copy of the plan with its bench, and of one that waits."""
    skipped = shutil.ignore_patterns("__pycache__")
    for each in ("fixtures", "testplans/eps"):
        shutil.copytree(ROOT / each, root / each, ignore=skipped)
    shutil.copy(ROOT / "testplans/requirements.yaml", root / "testplans")
    (root / "hil.toml").touch()
    plan = root / "testplans/waiting"
    plan.mkdir()
    (plan / "requirements.yaml").write_text(REQUIREMENTS, encoding="utf-8")
    (plan / "parameters.yaml").write_text("schema: hil/parameters/1\nparameters: []\n", encoding="utf-8")
    (plan / "test_waiting.py").write_text(PLAN, encoding="utf-8")
    made = Workspace(root, plan)
    made.lock()
    return made


def arguments(plan, bench):
    """Return the command that runs a plan on a served bench."""
    named = ("run", plan, "--bench", "eps", "--dut", "SIM-EPS-1", "--source", "simulated")
    return (*named, "--served", str(bench.folder))


def on(bench):
    """Return which outputs are on in truth."""
    peers = bench.ask(state="peers")
    return {name for name in ("load1", "psu1") if peers[name]["channels"]["1"]["on"]}


@contextmanager
def started(made, bench, plan):
    """Start a run; nothing of it is left behind."""
    process = made.start(*arguments(plan, bench), stderr=subprocess.STDOUT)
    try:
        yield process
    finally:
        put_away(process, made)


def test_the_campaign_passes_on_a_served_bench(tmp_path):
    """Over sockets and a serial line, in wall time; the package verifies, and its bytes come to the same again.

    When the rail came up is as uncertain as the computer is busy, and a recording that a busy computer held up is
    doubted; neither makes a FAIL.
    """
    made = workspace(tmp_path / "w")
    with served(tmp_path / "s", made.root, "eps", speed=SPEED) as bench:
        ended = made.hil(*arguments("eps", bench))
        assert on(bench) == set()
    package = Package(made.folders()[-1])
    assert verify(package.folder).findings == ()
    cases = {case["case"].partition("::")[2]: case for case in results_as_json(package)["cases"]}
    assert cases.pop("test_power_on_time")["verdict"] in {"PASS", "INCONCLUSIVE"}, ended.out
    for case in cases.values():
        doubted = [check["reason"] for check in case["checks"] if check["verdict"] == "INCONCLUSIVE"]
        assert all("was held up" in reason for reason in doubted), ended.out
        assert case["verdict"] == ("INCONCLUSIVE" if doubted else "PASS"), ended.out
    assert replay(package).differences == ()


def test_a_run_that_is_killed_while_it_waits_is_safe_and_its_figure_is_of_the_last_attempt(tmp_path):
    """The guardian switches off; resumed, the case is entered again, and the figure has nothing of the interruption.

    What was recorded at the kill is kept, and ended as incomplete; the recording of the second attempt is whole.
    """
    made = workspace(tmp_path / "w")
    with served(tmp_path / "s", made.root, "eps", speed=SPEED) as bench:
        with started(made, bench, "waiting") as process:
            seconds_until(lambda: made.folders() and looked(made.folders()[-1], 3), 60.0, "looks within until")
            assert on(bench) == {"load1", "psu1"}
            guardian = guardian_of(executive(process))
            os.kill(executive(process), signal.SIGKILL)
            finish(process)
            seconds_until(lambda: not Path(f"/proc/{guardian}").exists(), 60.0, "the guardian's end")
            assert on(bench) == set()
        (folder,) = made.folders()
        assert made.hil("ack", folder.name, "--by", "Ada", "--text", "all is off").code == 0
        ended = made.hil("resume", folder.name, "--served", str(bench.folder))
        assert ended.code == 0, ended.out + ended.err
        assert on(bench) == set()
    package = Package(folder)
    assert verify(package.folder).findings == ()
    (case,) = results_as_json(package)["cases"]
    check = next(each for each in case["checks"] if each["parameter"] == "time")
    assert case["verdict"] == "PASS"
    assert 11.5 <= check["value"] <= 14.0
    assert check["uncertainty"] < 1.0
    assert len(case["attempts"]) == 2
    ends = [line.event for line in package.lines() if isinstance(line.event, RecordingEnd)]
    whole = {end.recording: end.complete for end in ends}
    assert (whole["001-test_waiting-rail"], whole["002-test_waiting-rail"]) == (False, True)
    rail = package.recording("002-test_waiting-rail")
    assert len(rail) >= 22
    assert np.diff(rail.time).max() <= 1.2
    assert [event["number"] for event in bodies(package, "resumed")] == [1]
    assert replay(package).differences == ()


def looked(folder, times):
    """Return whether the journal has so many readings of the load."""
    journal = folder / "data/journal.jsonl"
    return journal.exists() and journal.read_bytes().count(b'"electronic_load.voltage"') >= times
