"""The plan battery_charge with the real firmware of the cycler under simavr, run by `hil run` as anybody would."""

from __future__ import annotations

import math
import os
import resource
import signal
from dataclasses import replace

import pytest
import sweeps
from battery_runs import battery_workspace
from cycler_firmware import declared_in
from live_runs import live_workspace, running, seconds_until, served
from told_as_json import bodies, results_as_json
from workspaces import finish, kill

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify

pytestmark = [pytest.mark.system, pytest.mark.timeout(900)]

ITS_PEER = {"    cycler1:\n": "    cycler1:\n      model: cycler-firmware\n"}
MOST_S = 120
"""Processor time of the executive, and of the simulator: they take turns, so that together it is 4 minutes."""

COVERAGE = 2.0
BEAT_S = 15
FADING_H = 0.014
"""What the last digit of the current, 1 mA, is worth where a charge ends: there it fades by 20 uA/s."""

LINE_H, LINE_V = 5 / 3600, 0.007
"""From one line to the next, and by how much the voltage falls in it where a discharge ends."""

BESIDES = {
    "charge_time": FADING_H,
    "constant_voltage_time": FADING_H,
    "constant_current_time": LINE_H,
    "rest_voltage_discharged": LINE_V,
    "duration": 10 * 3600 * FADING_H,
}
"""What numbers may differ by besides their uncertainties; the line that first has a voltage may be the next one."""

WARM = {"truth: {place: container}": 'truth: {place: container, ambient: "44"}', 'toward: "24.5"': 'toward: "44"'}
"""A warm room. The cell gets warmer than the firmware allows, and not as warm as the envelope does."""


def with_firmware(folder, changes=None):
    """Return a workspace whose bench file names the firmware as the cycler's peer; nothing else in it is changed."""
    variables = declared_in(folder / "declared")
    workspace = battery_workspace(folder / "workspace", "battery_charge", ITS_PEER | (changes or {}))
    return replace(workspace, environment={**workspace.environment, **variables})


def ran(workspace, *arguments):
    """Run the plan, and return how the command ended, and the package; no process of it may take too long."""
    process = workspace.start_run(*arguments)
    resource.prlimit(process.pid, resource.RLIMIT_CPU, (MOST_S, MOST_S))
    ended = finish(process, 800)
    return ended, Package(workspace.root / ended.last_line)


def checks(package):
    """Return every check by requirement, parameter and what it is of."""
    return {(each["requirement"], each["parameter"], each["of"]): each for each in bodies(package, "check")}


@pytest.fixture(scope="module")
def firmware(tmp_path_factory):
    """Run the plan as it is committed, but for its cycler."""
    return ran(with_firmware(tmp_path_factory.mktemp("firmware")))


@pytest.fixture(scope="module")
def peer(tmp_path_factory):
    """Run the plan as it is committed."""
    return ran(battery_workspace(tmp_path_factory.mktemp("peer") / "workspace", "battery_charge"))


@pytest.mark.soak
def test_the_whole_plan_with_the_firmware(firmware):
    """Ten cycles run to their end in four minutes, no line is lost, the bench is safe and the package whole."""
    ended, package = firmware
    assert ended.code == 1
    assert "bench safe: every output proven" in ended.out
    found = checks(package)
    assert found["EPS-BAT-010", "lost_lines", None]["value"] == 0
    assert found["EPS-BAT-007", "charge_time", "10"]["verdict"] == "RECORDED"
    assert verify(package.folder).ok


@pytest.mark.soak
def test_every_verdict_is_that_of_the_peer(firmware, peer):
    """The declaration is doubted with both: the cell has more than its label says."""
    assert firmware[0].code == peer[0].code
    real, simulated = (checks(package) for _, package in (firmware, peer))
    assert {key: each["verdict"] for key, each in real.items()} == {
        key: each["verdict"] for key, each in simulated.items()
    }
    assert (
        results_as_json(firmware[1])["cases"][0]["requirements"] == results_as_json(peer[1])["cases"][0]["requirements"]
    )


@pytest.mark.soak
def test_every_number_is_that_of_the_peer(firmware, peer):
    """No two numbers differ by more than twice their stated uncertainties, and times by what a digit is worth."""
    real = checks(firmware[1])
    far = []
    for key, wanted in checks(peer[1]).items():
        got, parameter = real[key], key[1]
        if isinstance(wanted["value"], str):
            assert got["value"] == wanted["value"], key
            continue
        stated = COVERAGE * math.hypot(*(each["uncertainty"] or 0.0 for each in (wanted, got)))
        if abs(got["value"] - wanted["value"]) > stated + BESIDES.get(parameter, 0.0):
            far.append((key, wanted["value"], got["value"], stated))
    assert far == []


@pytest.mark.parametrize(
    ("changes", "parameter", "reason"),
    sweeps.sample(
        [
            ({}, "longest_half_cycle=3600", "tripped TIME"),
            ({}, "highest_voltage=4.18", "tripped VMAX"),
            (WARM, "rest=60", "tripped TMAX"),
        ],
        1,
    ),
)
def test_the_firmware_ends_the_plan_by_its_own_limits(tmp_path, changes, parameter, reason):
    """Its relays open before the envelope is left: the case is an ERROR at once, and the bench is safe."""
    ended, package = ran(with_firmware(tmp_path, changes), "--parameter", parameter)
    assert (ended.code, results_as_json(package)["cases"][0]["verdict"]) == (1, "ERROR")
    assert f"ended its test by itself, it says '{reason}'" in ended.out
    assert "bench safe: every output proven" in ended.out


def test_a_firmware_that_hangs_is_reset_and_told(tmp_path):
    """Its watchdog opens the relays and it says so; the case is an ERROR, and the bench is safe."""
    clock = "      truth: {clock_drift:"
    ended, package = ran(with_firmware(tmp_path, {clock: '      truth: {converter_hangs: "12000", clock_drift:'}))
    assert (ended.code, results_as_json(package)["cases"][0]["verdict"]) == (1, "ERROR")
    assert "it has restarted (boot 43, WATCHDOG): its relays are open" in ended.out
    assert "bench safe: every output proven" in ended.out


def test_the_firmware_opens_its_relays_when_nobody_is_left(tmp_path, monkeypatch):
    """Executive and guardian are killed at once while it charges: it opens its relays within the declared heartbeat."""
    for name, value in declared_in(tmp_path / "declared").items():
        monkeypatch.setenv(name, value)
    workspace = live_workspace(tmp_path / "workspace", changes=ITS_PEER | {"beat: 360 s": f"beat: {BEAT_S} s"})

    def state(path):
        return bench.ask(state=path)

    with served(tmp_path / "ends", workspace.root) as bench, running(bench, workspace) as run:
        seconds_until(lambda: state("plants.battery.current") > 0.5, 20, "a current flows")
        last, guardian = run.executive, run.guardian
        os.kill(last, signal.SIGSTOP)
        os.kill(guardian, signal.SIGKILL)
        kill(run.process)
        run.ended()
        seconds = seconds_until(lambda: not state("plants.battery.charge_contact"), BEAT_S + 1, "the relay opens")
        assert seconds > BEAT_S / 3
        assert state("peers.psu1.channels.1.on") is True
        assert state("peers.cycler1.watchdog_resets") == []
        assert abs(state("plants.battery.current")) < 0.001
