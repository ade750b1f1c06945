"""Weeks on a served bench in minutes: the plates of the assembly go warm and cold, and endings come in between.

How fast a bench can be served is up to what counts wall time, or has to answer within bench time: the driver of the
tester waits for its replies by the bench's clock, so that a bench with it cannot be served much faster than 120 times.
On this one every instrument speaks only when it is asked, and none waits by the bench's clock for more than its pace.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from live_runs import Served, guardian_of, live_workspace, seconds_until, served
from moved_clocks import Machine
from resumed_runs import without_git
from workspaces import Ended, Workspace, executive, finish, kill

from hil.evidence.folder import JOURNAL

__all__ = ["HUB", "OTHER_BOOT", "PLATES", "Weeks", "weeks"]

PLATES = "envelope-plate-temperature"
"""The recording of the plates."""

_ROW = 2 * 8
_MOST_UNASKED = 10

HUB = ("psu2", "tec1")
"""What hangs on one USB hub."""

OTHER_BOOT = "00000000-1111-2222-3333-444444444444"

_CELL = "fixtures/benches/battery/bench.yaml"

_PLAN = '''\
"""The plates of the assembly, for weeks."""

import pytest


@pytest.mark.requirement("LIVE-010")
@pytest.mark.max_duration(90 * 86400)
@pytest.mark.repeatable("reading the bench does not change it")
def test_weeks(supply, thermal, clock, iterations, check, step):
    """The plates go warm and cold by turns, and the envelope is recorded."""
    with step("Switch on"):
        supply.apparatus.configure(12.0, 0.5)
        supply.apparatus.enable()
        supply.tec.configure(12.0, 5.0)
        supply.tec.enable()
    with step("Go warm and cold"):
        for turn in iterations("Turn", {turns}):
            thermal.hold(30.0 if turn % 2 else 20.0)
            clock.sleep({turn})
            check("LIVE-010", "temperature", thermal.temperature())
'''

_BENCH = """\
schema: hil/bench/1
bench: {name: battery, title: Plates of an assembly, place: Power laboratory}
instruments:
  psu1:
    driver: rigol-dp832
    port: TCPIP::192.168.10.22::5555::SOCKET
    identity: {manufacturer: RIGOL TECHNOLOGIES, model: DP832, serial: DP8C231402017}
    ratings:
    - {channel: "2", quantity: voltage, unit: V, max: "30"}
    - {channel: "2", quantity: current, unit: A, max: "3"}
  tec1:
    driver: eurotherm-3216
    port: /dev/serial/by-id/usb-FTDI_FT232R_A50285BK-if00-port0
    usb: {serial: A50285BK}
    baud: "19200"
    address: "1"
    identity: {model: "3216"}
    calibration:
      certificate: certificates/tec1.txt
      due: "2027-09-30"
      ranges:
      - {quantity: temperature, unit: degC, from: "-30", to: "60", absolute: "0.2"}
  psu2:
    driver: korad-ka3005p
    port: /dev/serial/by-id/usb-Nuvoton_USB_Virtual_COM_A02014090305-if00
    usb: {path: "pci-0000:00:14.0-usb-0:4:1.0"}
    baud: "9600"
    identity: {manufacturer: Korad, model: KA3005P}
    ratings:
    - {channel: "1", quantity: voltage, unit: V, max: "30"}
    - {channel: "1", quantity: current, unit: A, max: "5"}
wiring:
- {role: supply, instance: apparatus, instrument: psu1, channel: "2",
   settings: {over_voltage: "13"},
   reduced: {voltage: "12", current: "0.2", lowest_current: "0.02", highest_current: "0.15"},
   hazardous: false, note: "12 V for the fan"}
- {role: supply, instance: tec, instrument: psu2, channel: "1",
   reduced: {voltage: "12", current: "0.2", lowest_current: "0.02", highest_current: "0.15"},
   note: "12 V for the amplifier of the coolers"}
- {role: thermal, instrument: tec1, settings: {decimals: "1"}, note: "Pt100 between the plates"}
clamps:
- {output: supply.apparatus, quantity: voltage, unit: V, min: "0", max: "12"}
- {output: supply.apparatus, quantity: current, unit: A, min: "0", max: "0.5"}
- {output: supply.tec, quantity: voltage, unit: V, min: "0", max: "12"}
- {output: supply.tec, quantity: current, unit: A, min: "0", max: "5"}
- {output: thermal, quantity: temperature, unit: degC, min: "5", max: "45"}
envelope:
- {id: plate-temperature, output: thermal, quantity: temperature, unit: degC, min: "-10", max: "60",
   period: {period}, max_age: {long}, debounce: "2"}
- {id: coolers-feed, output: supply.tec, quantity: voltage, unit: V, min: "-1", max: "14",
   period: {period}, max_age: {long}}
- {id: fan-current, output: supply.apparatus, quantity: current, unit: A, min: "-1", max: "1",
   period: {period}, max_age: {long}}
safe_off:
- {output: thermal, state: standby, within: {long},
   proof: {output: thermal, quantity: output, unit: "%", min: "-0.05", max: "0.05"}}
- {output: supply.tec, state: "off", within: {long},
   proof: {output: supply.tec, quantity: voltage, unit: V, min: "-0.2", max: "0.2"}}
- {output: supply.apparatus, state: "off", within: {long},
   proof: {output: supply.apparatus, quantity: voltage, unit: V, min: "-0.2", max: "0.2"}}
rest:
- {output: thermal, state: standby, within: {long}}
cut_paths:
- {output: thermal, by: supply.tec, state: "off", within: {long}}
- {output: thermal, hardware: thermal cut-out, within: 300 s}
- {output: supply.tec, by: thermal, state: standby, within: {long}}
- {output: supply.tec, hardware: thermal cut-out, within: 300 s}
simulated:
  epoch: "2026-01-01T08:00:00Z"
  seed: "20260201"
  plants:
    battery: {model: battery, grid: 60 s, truth: {place: assembly}}
    apparatus: {model: power-feed, grid: 1 d, truth: {resistance: "150"}}
    tec_feed: {model: power-feed, grid: 1 d, truth: {resistance: "150"}}
  peers:
    psu1: {truth: {serial: DP8C231402017}, connects: {"2": apparatus.supply}}
    tec1:
      truth: {period: 60 s, proportional_band: "60", integral_time: "240"}
      connects: {sensor: battery.plate, drive: battery.tec, ambient: battery.ambient, power: tec_feed.voltage}
    psu2: {connects: {"1": tec_feed.supply}}
  person: {cell-place: battery.place}
"""


@dataclass
class Weeks:
    """The plan on a served bench of its own.

    Attributes:
        workspace: whose plan and bench it is, on a machine whose clocks can be moved.
        bench: where that is served.
        machine: that machine.
        process: the command that goes on, or went on last.
        kept: the rows that were on the disk at each ending, by recording.
        unasked: endings that no test asked for: on a machine under load a guardian finds that its run hangs.
    """

    workspace: Workspace
    bench: Served
    machine: Machine
    process: subprocess.Popen[str]
    kept: list[dict[str, bytes]] = field(default_factory=list)
    unasked: int = 0

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self.workspace.folders()[-1]

    def rows(self) -> dict[str, bytes]:
        """Return what the row file of each recording holds on the disk, after its header; half a row is none."""
        found = {}
        for path in sorted((self.folder / "data/recordings").glob("*.rows")):
            written = path.read_bytes().partition(b"\n")[2]
            found[path.stem] = written[: len(written) - len(written) % _ROW]
        return found

    @property
    def guardian(self) -> int:
        """The process that watches over it."""
        return guardian_of(executive(self.process))

    def wait_for(self, turn: int, limit_s: float = 600.0) -> None:
        """Wait until a turn has begun, and some rows of it are on the disk."""

        def there() -> bool:
            if self.process.poll() is not None:
                self._go_on_again(self.process.communicate()[0])
            return bool(self.workspace.folders()) and re.search(rf'"turn":{turn}\b', self._journal()) is not None

        seconds_until(there, limit_s, f"turn {turn}")
        before = len(self.rows()[PLATES])
        seconds_until(lambda: len(self.rows()[PLATES]) > before + 4 * _ROW, 60.0, "some rows of it")

    def _journal(self) -> str:
        path = self.folder / JOURNAL
        return path.read_text(encoding="utf-8") if path.exists() else ""

    def resume(self, boot_id: str = "") -> None:
        """Acknowledge what waits for that, and go on, after a reboot if there is another boot's id."""
        if "latched until" in self.workspace.hil("status", self.folder.name).out:
            seconds_until(self._acknowledged, 60.0, "acknowledged")
        if boot_id:
            self.workspace = self.machine.of(self.workspace, boot_id=boot_id)
        options = ("--served", str(self.bench.folder))
        self.process = _started(self.workspace, "resume", self.folder.name, *options)

    def _acknowledged(self) -> bool:
        return self.workspace.hil("ack", self.folder.name, "--by", "Ada", "--text", "all is off").code == 0

    def ended(self, limit_s: float = 900.0) -> Ended:
        """Wait for the end of the command, and keep the rows that are on the disk."""
        ended = finish(self.process, limit_s)
        self.kept.append(self.rows())
        return ended

    def sealed(self) -> Ended:
        """Wait for the end of the run."""
        while (ended := finish(self.process, 900.0)).code and not (self.folder / "bagit.txt").exists():
            self._go_on_again(ended.out)
        return ended

    def _go_on_again(self, said: str) -> None:
        self.unasked += 1
        sealed = bool(self.workspace.folders()) and (self.folder / "bagit.txt").exists()
        assert not sealed, said
        assert self.unasked <= _MOST_UNASKED, said
        self.kept.append(self.rows())
        self.resume()

    def kill(self) -> Ended:
        """Kill the executive, and wait for the end of its guardian."""
        guardian = self.guardian
        os.kill(executive(self.process), signal.SIGKILL)
        seconds_until(lambda: not Path(f"/proc/{guardian}").exists(), 60.0, "the guardian's end")
        return self.ended()


@contextmanager
def weeks(root: Path, machine: Machine, *, speed: float, turns: int, turn_s: float, every_s: float) -> Iterator[Weeks]:
    """Serve the bench, and start the plan on it; nothing of both is left behind.

    Args:
        root: a folder of a short name.
        machine: whose clocks the run has.
        speed: seconds of the bench in one of the wall.
        turns: how many turns the plates take.
        turn_s: how long one is, in bench time [s].
        every_s: how far apart the rows are, in bench time [s].
    """
    workspace = live_workspace(root / "w")
    plan = {"{turns}": f"{turns}", "{turn}": f"{turn_s:g}"}
    (workspace.plan / "test_on.py").write_text(_told(_PLAN, plan), encoding="utf-8")
    wall_s = {"{period}": f"{round(every_s)} s", "{long}": f"{round(30 * speed)} s"}  # times that the wall counts
    (workspace.root / _CELL).write_text(_told(_BENCH, wall_s), encoding="utf-8")
    there = machine.of(without_git(workspace))
    with served(root / "e", workspace.root, speed=speed) as bench:
        named = ("run", "on", "--bench", "battery", "--dut", "SIM-BAT-1", "--source", "simulated")
        run = Weeks(there, bench, machine, _started(there, *named, "--served", str(bench.folder)))
        try:
            yield run
        finally:
            if run.process.poll() is None:
                kill(run.process)
                run.process.communicate()


def _told(text: str, words: dict[str, str]) -> str:
    for name, word in words.items():
        text = text.replace(name, word)
    return text


def _started(workspace: Workspace, *words: str) -> subprocess.Popen[str]:
    return workspace.start(*words, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
