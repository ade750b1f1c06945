"""The plan battery_degradation on a served bench: a few cycles of a small cell, in a minute or two of the wall."""

from __future__ import annotations

import os
import re
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from battery_runs import BatteryWorkspace, battery_workspace
from live_runs import Served, guardian_of, seconds_until, served
from resumed_runs import without_git
from terminals import Terminal
from told_as_json import bodies
from workspaces import Ended, executive, finish, kill

from hil.evidence.folder import JOURNAL
from hil.evidence.journal.reader import Body, read_journal

__all__ = ["CYCLES", "SPEED", "Cycling", "cycling", "cycling_workspace"]

CYCLES = 4
SPEED = 120.0
"""Of the bench: a cycle is twenty seconds then."""

_PARAMETERS = {"rest": "480", "soak": "60", "settling": "0", "lowest_voltage": "2.55", "cycles": str(CYCLES)}
"""What the plan is told instead of its own: the plates here change their temperature in three minutes."""

_CELL = (
    'place: assembly, capacity: "0.12", fade: "0.02", plate_capacity: "70", cell_capacity: "14", cell_plate: "3",'
    ' slow_resistance: "0.04", slow_time: "200", open_circuit: ["2.7", "2.85", "3.1", "3.4", "3.6", "3.698", "3.738",'
    ' "3.778", "3.838", "3.908", "3.988", "4.078", "4.128", "4.2"]'
)
_CONTROLLER = 'period: 5 s, proportional_band: "15", integral_time: "120"'

_ANSWERS = """\
schema: hil/answers/1
answers: {cell-place: assembly}
"""
_ASKED = (("plus to plus? [yes or no]", "yes"), ("tightly to the cell? [yes or no]", "yes"))
"""What a person says at each arming: the cell is connected through its fuse, and the thermistor is at it."""


def cycling_workspace(root: Path) -> BatteryWorkspace:
    """Return a workspace with the plan and a bench whose small cell lies in its assembly, with answers for a run.

    Time on the wall counts many times on a bench that is served fast, so that limits on it are wider here.
    """
    workspace = battery_workspace(
        root,
        "battery_degradation",
        {
            "truth: {place: container}": f"truth: {{{_CELL}}}",
            'truth: {period: 60 s, proportional_band: "60", integral_time: "240"}': f"truth: {{{_CONTROLLER}}}",
            'unit: K/min, max: "20"': 'unit: K/min, max: "60"',
            'unit: K/min, max: "2"': 'unit: K/min, max: "30"',
        },
    )
    bench = root / "fixtures/benches/battery/bench.yaml"
    text = bench.read_text(encoding="utf-8")
    first, end = text.index("envelope:"), text.index("watch_after:")
    wider = re.sub(r"max_age: \d+ s", "max_age: 3600 s", text[first:end])
    wider = re.sub(r"within: \d+ s", "within: 1200 s", wider)
    bench.write_text(text[:first] + wider + text[end:], encoding="utf-8")
    (root / "answers.yaml").write_text(_ANSWERS, encoding="utf-8")
    return workspace


@dataclass
class Cycling:
    """The plan on a served bench of its own.

    Attributes:
        workspace: whose plan and bench it is.
        bench: where that is served.
        process: the command that goes on, or went on last.
        terminal: where that runs, and is answered.
    """

    workspace: BatteryWorkspace
    bench: Served
    process: subprocess.Popen[str]
    terminal: Terminal

    @property
    def folder(self) -> Path:
        """The run's folder."""
        return self.workspace.folders()[-1]

    @property
    def rows(self) -> Path:
        """The row file of the recording beside the tester's test, while that goes on."""
        return self.folder / "data/recordings/001-test_degradation-test.rows"

    def events(self) -> tuple[Body, ...]:
        """Return what its journal holds so far."""
        return bodies(read_journal(self.folder / JOURNAL))

    def wait_for(self, turn: int, phase: str, limit_s: float = 300.0) -> None:
        """Wait until the tester is in such a phase of a turn, by what the run has recorded."""
        steps = {"charge": "Charge", "discharge": "Discharge"}

        def there() -> bool:
            if self.process.poll() is not None:
                raise AssertionError(self.process.communicate()[0] + self.terminal.shown)
            if not self.workspace.folders() or not self.rows.exists():
                return False
            begun = [event for event in self.events() if event["kind"] == "step"]
            turns = [event.get("turn", 0) for event in begun]
            return turn in turns and steps[phase] in [event["path"][-1] for event in begun[turns.index(turn) :]]

        seconds_until(there, limit_s, f"{phase} of turn {turn}")
        flows = f"{phase}_contact"
        seconds_until(lambda: self.bench.ask(state="plants.battery")["inputs"][flows], 30.0, f"{phase} of turn {turn}")
        before = self.rows.stat().st_size
        seconds_until(lambda: self.rows.stat().st_size > before + 2000, 30.0, "some rows of it")

    def kill(self) -> bytes:
        """Kill the executive, wait for the end of its guardian, and return the rows that were on the disk by then."""
        guardian = guardian_of(executive(self.process))
        os.kill(executive(self.process), signal.SIGKILL)
        finish(self.process)
        seconds_until(lambda: not Path(f"/proc/{guardian}").exists(), 60.0, "the guardian's end")
        return self.rows.read_bytes()

    def resume(self) -> None:
        """Acknowledge what the guardian did, and go on."""
        name = self.folder.name
        acknowledged = self.workspace.hil("ack", name, "--by", "Ada", "--text", "all is off, the cell is cold")
        assert acknowledged.code == 0, acknowledged.err
        self.terminal.leave()
        self.process, self.terminal = _started(self.workspace, "resume", name, bench=self.bench)

    def ended(self) -> Ended:
        """Wait for its end."""
        return finish(self.process, 400)


@contextmanager
def cycling(root: Path, folder: Path) -> Iterator[Cycling]:
    """Serve a bench in a folder of a short name, and start the plan on it; nothing of both is left behind."""
    workspace = without_git(cycling_workspace(root))
    parameters = [word for name, value in _PARAMETERS.items() for word in ("--parameter", f"{name}={value}")]
    with served(folder, root, speed=SPEED) as bench:
        words = (*workspace.run_arguments, *parameters, "--operator", "Ada")
        run = Cycling(workspace, bench, *_started(workspace, *words, bench=bench))
        try:
            yield run
        finally:
            if run.process.poll() is None:
                kill(run.process)
            if run.process.stdout is not None:
                run.process.stdout.close()
            run.process.wait()
            run.terminal.leave()


def _started(workspace: BatteryWorkspace, *words: str, bench: Served) -> tuple[subprocess.Popen[str], Terminal]:
    """Start a command at a terminal of its own, at which a person sits; return both."""
    options = ("--served", str(bench.folder), "--answers", "answers.yaml")
    terminal = Terminal(*_ASKED)
    process = workspace.start(*words, *options, stdin=terminal.near, stdout=subprocess.PIPE, stderr=terminal.near)
    terminal.sit()
    return process, terminal
