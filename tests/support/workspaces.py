"""Small workspaces with one plan on a bench of their own, and ways to run it."""

from __future__ import annotations

import contextlib
import io
import os
import signal
import subprocess
import sys
import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree as ET

from adcs_bench import copy_fixtures
from told_as_json import bodies, results_as_json

from hil.evidence.package.contents import Package
from hil.evidence.package.verification import verify
from hil.executive.setup.configuration import Request
from hil.executive.setup.pins import PINNED
from hil.model.identity import Source
from hil.plugin.running import run
from hil.requirements.catalogue import load_catalogue
from hil.requirements.lock import LOCK

__all__ = [
    "DUT",
    "HEAD",
    "REQUIREMENTS",
    "ROOT",
    "Ended",
    "Ran",
    "Workspace",
    "agreed",
    "command_line",
    "executive",
    "finish",
    "kill",
    "make",
    "module",
    "said_of",
]

ROOT = Path(__file__).parents[2]
DUT = "SIM-ADCS-1"

HEAD = """\
import math

import pytest

from hil.model.figure import Figure
"""

REQUIREMENTS = """\
- {id: T-010, rev: 1, text: The ratio shall be about one., kind: limit, method: test,
   limits: [{parameter: ratio, unit: "1", min: "0.5", max: "1.5", decision: simple}]}
- {id: T-020, rev: 1, text: Both axes shall be small., kind: limit, method: test,
   limits: [{parameter: rate, of: [x, y], unit: deg/s, max: "0.5", decision: simple}]}
- {id: T-030, rev: 1, text: The field shall be recorded., kind: record, method: test,
   records: {recording: field, channels: [x, y, z], rate: 40 Hz, duration: 1 s, max_gap: 0.1 s}}
- {id: T-040, rev: 1, text: The magnetometer shall answer., kind: limit, method: test,
   limits: [{parameter: answers, equals: "yes"}]}
- {id: T-050, rev: 1, text: The voltage shall be known., kind: limit, method: test,
   limits: [{parameter: voltage, unit: V, min: "0", max: "6"}]}
- {id: T-060, rev: 2, text: Nobody asks for this any more., kind: limit, method: test, withdrawn: true,
   limits: [{parameter: ratio, unit: "1", min: "0.5", decision: simple}]}
- {id: T-070, rev: 1, text: Each board shall have its ratio., kind: limit, method: test, over: {board: [a, b]},
   limits: [{parameter: ratio, unit: "1", min: "0.5", decision: simple}]}
"""

_DOCUMENT = """\
schema: hil/requirements/1
document: {id: T, issue: "1.0", title: A small plan}
requirements:
"""

_PARAMETERS = """\
schema: hil/parameters/1
parameters:
- {name: current, value: "0.01", unit: A, text: Coil current}
"""

_MEASURED = """\
import resource, subprocess, sys
code = subprocess.call(sys.argv[1:])
sys.stderr.write(f"{resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss}\\n")
sys.exit(code)
"""
"""Runs a command and tells the peak memory of its processes; a process of its own, because a child begins with the
memory of whoever started it, and other children of that one are not to be counted."""
_PLACES = {"psu1": '      connects: {"2"', "relay1": '      connects: {"1"', "mag1": "      connects: {field"}


@dataclass(frozen=True)
class Ended:
    """A command that ended in a process of its own."""

    code: int
    out: str
    err: str

    @property
    def last_line(self) -> str:
        """The last line of standard output."""
        return self.out.splitlines()[-1] if self.out else ""


@dataclass(frozen=True)
class Ran:
    """A run that ended in this process: its exit code, what was shown, and its package."""

    code: int
    out: str
    package: Package

    def verdicts(self) -> dict[str, str]:
        """Return the verdict of every planned case, by the case's own name."""
        return {_short(case["case"]): str(case["verdict"]) for case in results_as_json(self.package)["cases"]}

    def reasons(self, case: str) -> str:
        """Return the reasons of one case, a line each."""
        found = next(each for each in results_as_json(self.package)["cases"] if _short(each["case"]) == case)
        return "\n".join(found["reasons"])

    def junit(self) -> dict[str, str]:
        """Return what JUnit says of every case: `passed`, `failure`, `error` or `skipped`."""
        return {_short(case): element for case, element in self.elements().items()}

    def elements(self) -> dict[str, str]:
        """Return the same by the whole name of the case."""
        root = ET.fromstring(self.package.text("data/report/junit.xml"))  # noqa: S314 - we wrote it
        kinds = ("failure", "error", "skipped")
        return {
            case.get("name", ""): next((kind for kind in kinds if case.find(kind) is not None), "passed")
            for case in root.iter("testcase")
        }

    def page(self) -> str:
        """Return the report's page."""
        return self.package.text("data/report/report.html")


@dataclass(frozen=True)
class Workspace:
    """A workspace in a folder of its own."""

    root: Path
    plan: Path
    environment: dict[str, str] = field(default_factory=lambda: {**os.environ, **PINNED})

    @property
    def reports(self) -> Path:
        """Where packages go."""
        return self.root / "reports"

    def folders(self) -> list[Path]:
        """Return every run's folder."""
        return sorted(self.reports.glob("[!.]*"))

    def request(self, **changes) -> Request:
        """Return the request for the plan on the simulated bench."""
        wanted = {"start": self.root, "plans": (self.plan.name,), "bench": "adcs", "dut": DUT}
        return Request(**{**wanted, "source": Source.SIMULATED, **changes})

    def run(self, **changes) -> Ran:
        """Run the plan in this process, and return how it ended; the workspace holds no other run."""
        before = self.folders()
        out = io.StringIO()
        code = run(self.request(**changes), out)
        (folder,) = [folder for folder in self.folders() if folder not in before]
        return Ran(code, out.getvalue(), Package(folder))

    @property
    def run_arguments(self) -> tuple[str, ...]:
        """`run` for the plan on the simulated bench."""
        return ("run", self.plan.name, "--bench", "adcs", "--dut", DUT, "--source", "simulated")

    def start(self, *arguments: str, **options) -> subprocess.Popen[str]:
        """Start `hil` in a process group of its own, which `kill` ends."""
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL}
        options = {**pipes, "start_new_session": True, **options}
        options = {"text": True, **options}
        return subprocess.Popen(command_line(*arguments), cwd=self.root, env=self.environment, **options)

    def start_run(self, *arguments: str, **options) -> subprocess.Popen[str]:
        """Start `hil run` for the plan on the simulated bench, in a process of its own."""
        return self.start(*self.run_arguments, *arguments, **options)

    def start_run_command(self) -> list[str]:
        """Return the command line of `hil run` for the plan on the simulated bench."""
        return command_line(*self.run_arguments)

    def hil(self, *arguments: str, timeout: float = 150) -> Ended:
        """Run `hil` in a process of its own to its end."""
        return finish(self.start(*arguments), timeout)

    def hil_measured(self, *arguments: str, timeout: float = 150) -> tuple[Ended, int]:
        """Run `hil` to its end, and return its peak memory in KiB as well."""
        command = [sys.executable, "-c", _MEASURED, *command_line(*arguments)]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "stdin": subprocess.DEVNULL}
        options = {**pipes, "start_new_session": True, "text": True}
        ended = finish(subprocess.Popen(command, cwd=self.root, env=self.environment, **options), timeout)
        return ended, int(ended.err.splitlines()[-1])

    def lock(self) -> None:
        """Write the plan's lock as its requirements are now."""
        from hil.requirements.lock import lock_text  # noqa: PLC0415 - beside its only use

        catalogue = load_catalogue(self.root, [self.plan], locked=False)
        (self.plan / LOCK).write_text(lock_text(catalogue.of_plan(self.plan.name)), encoding="utf-8")

    def change(self, file: str, changes: Mapping[str, str]) -> None:
        """Replace texts of a file, each of which is there once."""
        path = self.root / file
        text = path.read_text(encoding="utf-8")
        for old, new in changes.items():
            assert text.count(old) == 1, f"{file} has {text.count(old)} times {old!r}"
            text = text.replace(old, new)
        path.write_text(text, encoding="utf-8")

    def change_bench(self, changes: Mapping[str, str]) -> None:
        """Replace texts of the bench file."""
        self.change("fixtures/benches/adcs/bench.yaml", changes)

    def give_faults(self, device: str, *faults: str) -> None:
        """Let a simulated instrument go wrong."""
        place = _PLACES[device]
        self.change_bench({place: f"      faults: [{', '.join(faults)}]\n{place}"})


def command_line(*arguments: str) -> list[str]:
    """Return the command line of `hil`."""
    return [sys.executable, "-m", "hil.cli", *arguments]


STARTED: list[subprocess.Popen[str]] = []
"""Processes that a test has started and may leave behind; see `end_started`."""


def end_started() -> None:
    """End what a failed test leaves."""
    while STARTED:
        process = STARTED.pop()
        if process.poll() is None:
            kill(process)
        process.wait()
        for stream in (process.stdout, process.stderr):
            if stream is not None:
                stream.close()


def kill(process: subprocess.Popen[str]) -> None:
    """End a command at once: the process that runs and the one that waits for it."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


def executive(process: subprocess.Popen[str]) -> int:
    """Return the id of the process that runs and holds the bench."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text(encoding="ascii").split()
    return int(children[0])


def finish(process: subprocess.Popen[str], timeout: float = 150) -> Ended:
    """Wait for the end of a command; one that does not end is killed, and fails the test."""
    try:
        out, err = process.communicate(timeout=timeout)
    except subprocess.TimeoutExpired:
        kill(process)
        process.communicate()
        raise
    return Ended(process.returncode, out or "", err or "")


def make(
    root: Path,
    *cases: str,
    requirements: str = REQUIREMENTS,
    parameters: str = _PARAMETERS,
    fixtures: Mapping[str, str] | None = None,
) -> Workspace:
    """Make a workspace with one plan and a copy of the magnetorquer bench.

    Args:
        root: its folder, which must not exist yet.
        cases: parts of the test module after its imports, see `HEAD`; each may be indented.
        requirements: the entries of `requirements.yaml`.
        parameters: the whole `parameters.yaml`.
        fixtures: more fixture modules by file name.
    """
    copy_fixtures(root)
    (root / "hil.toml").touch()
    for name, text in (fixtures or {}).items():
        (root / "fixtures" / name).write_text(textwrap.dedent(text), encoding="utf-8")
    plan = root / "testplans/small"
    plan.mkdir(parents=True)
    (plan / "requirements.yaml").write_text(_DOCUMENT + requirements, encoding="utf-8")
    (plan / "parameters.yaml").write_text(parameters, encoding="utf-8")
    (plan / "test_small.py").write_text(module(*cases), encoding="utf-8")
    workspace = Workspace(root, plan)
    workspace.lock()
    return workspace


def module(*cases: str) -> str:
    """Return a module of a plan: the usual imports, and these parts, each of which may be indented."""
    return "\n\n".join((HEAD, *(textwrap.dedent(part).strip("\n") + "\n" for part in cases)))


_ELEMENTS = {"PASS": "passed", "RECORDED": "passed", "ERROR": "error", "ABORTED": "error", "NOT_RUN": "skipped"}


def agreed(ran: Ran, verdicts: Mapping[str, str], run_verdict: str, code: int) -> None:
    """Assert that journal, results, JUnit, page, last lines and exit code say the same of a sealed run."""
    ends = {_short(end["case"]): end["verdict"] for end in bodies(ran.package, "case-end")}
    results = results_as_json(ran.package)
    assert ran.verdicts() == dict(verdicts)
    assert {**verdicts, **ends} == dict(verdicts)
    assert results["verdict"] == run_verdict
    assert next(iter(bodies(ran.package, "results")))["verdict"] == run_verdict
    assert ran.junit() == {case: _ELEMENTS.get(verdict, "failure") for case, verdict in verdicts.items()}
    assert f"</svg>{run_verdict}</p>" in ran.page()
    assert all(f"{verdict}</span>" in ran.page() for verdict in verdicts.values())
    assert f"\n{run_verdict}  " in ran.out
    assert (ran.code, bodies(ran.package, "end")[0]["exit_code"]) == (code, code)
    assert ran.out.splitlines()[-1].endswith(ran.package.name)
    assert verify(ran.package.folder).findings == ()


def said_of(ran: Ran, file: str, verdicts: Mapping[str, str]) -> None:
    """Assert that journal, results, JUnit and page say the same of the cases of one module of the plan."""
    prefix = f"testplans/small/{file}::"
    expected = {prefix + case: verdict for case, verdict in verdicts.items()}
    results = {case["case"]: case["verdict"] for case in results_as_json(ran.package)["cases"]}
    ends = {end["case"]: end["verdict"] for end in bodies(ran.package, "case-end")}
    assert {case: verdict for case, verdict in results.items() if case.startswith(prefix)} == expected
    assert {case: verdict for case, verdict in ends.items() if case.startswith(prefix)}.items() <= expected.items()
    elements = ran.elements()
    assert {case: elements[case] for case in expected} == {
        case: _ELEMENTS.get(verdict, "failure") for case, verdict in expected.items()
    }
    assert all(f"{verdict}</span>" in ran.page() for verdict in verdicts.values())


def _short(case: str) -> str:
    return case.rpartition("::")[2]
