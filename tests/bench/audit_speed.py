"""The audit of a large workspace against StrictDoc's exports of the same catalogue, as whole processes in turns.

python tests/bench/audit_speed.py PATH-OF-STRICTDOC [REQUIREMENTS] [ROUNDS]
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "support"))

from large_catalogue import make_workspace, write_sdoc

HIL = (sys.executable, "-m", "hil.cli", "audit", "--format", "json", "--format", "csv", "--format", "html")


@dataclass(frozen=True)
class Cost:
    """What a process took: processor time and wall time in s, and the peak of its memory in MB."""

    cpu: float
    wall: float
    memory: float


def cost_of(command: Sequence[str], folder: Path, **environment: str) -> Cost:
    """Return what a process and the ones that it starts take.

    Raises:
        RuntimeError: if it fails, with its last words.
    """
    told = folder / "told.txt"
    began = time.perf_counter()
    with told.open("wb") as stream:
        process = subprocess.Popen(
            command, cwd=folder, env={**os.environ, **environment}, stdout=stream, stderr=subprocess.STDOUT
        )
        _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise RuntimeError(f"{' '.join(command)}: exit code {process.returncode}\n{told.read_text()[-2000:]}")
    return Cost(used.ru_utime + used.ru_stime, time.perf_counter() - began, used.ru_maxrss / 1024)


def say(line: str) -> None:
    """Print a line at once."""
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def strictdoc(program: str, source: Path, form: str) -> Cost:
    """Return what an export by StrictDoc takes, in a copy that it has never seen."""
    with tempfile.TemporaryDirectory(dir=source.parent) as place:
        copy = Path(place) / "documents"
        shutil.copytree(source, copy)
        return cost_of((program, "export", ".", "--formats", form, "--output-dir", "out"), copy)


def places_of(root: Path) -> dict[str, str]:
    """Return where an audit keeps what it found, and Python its byte code."""
    byte_code = {"PYTHONPYCACHEPREFIX": str(root / "bytecode"), "PYTHONDONTWRITEBYTECODE": ""}
    return {"XDG_CACHE_HOME": str(root / "cache"), **byte_code}


def measure(program: str, root: Path, requirements: int) -> dict[str, Cost]:
    """Measure everything once, one after the other; nothing has to be compiled."""
    workspace = root / "workspace"
    shutil.rmtree(root / "cache", ignore_errors=True)
    ours = (*HIL, "--output", "out")
    places = places_of(root)
    return {
        "hil audit, json, csv and html, cold": cost_of(ours, workspace, **places),
        "StrictDoc, json, cold": strictdoc(program, root / "sdoc", "json"),
        "hil audit, json, csv and html, repeated": cost_of(ours, workspace, **places),
        "StrictDoc, html, cold": strictdoc(program, root / "sdoc", "html"),
    }


def compile_once(root: Path) -> None:
    """Let Python compile what an audit imports, as an installation does: no round pays for it."""
    make_workspace(root / "small", 100)
    cost_of((*HIL, "--output", "out"), root / "small", **places_of(root))


def main(program: str, requirements: int = 10_000, rounds: int = 3) -> None:
    """Measure in turns, and print the least of every cost with the ratios that count."""
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        make_workspace(root / "workspace", requirements)
        write_sdoc(root / "sdoc", requirements)
        compile_once(root)
        found = []
        for number in range(1, rounds + 1):
            found.append(measure(program, root, requirements))
            say(f"round {number} of {rounds}")
            for name, cost in found[-1].items():
                say(f"  {name:<42} {cost.cpu:8.1f} s CPU {cost.wall:8.1f} s wall {cost.memory:6.0f} MB")
    cold, json, repeated, html = ([round_[name] for round_ in found] for name in found[0])
    for name, part, whole, most in (
        ("cold / StrictDoc's html", cold, html, 1 / 8),
        ("cold / StrictDoc's json", cold, json, 1 / 2),
        ("repeated / cold", repeated, cold, 1 / 5),
    ):
        cpu = min(each.cpu for each in part) / min(each.cpu for each in whole)
        wall = min(each.wall for each in part) / min(each.wall for each in whole)
        say(f"{name:<42} {cpu:8.3f} of CPU {wall:8.3f} of wall, at most {most:.3f} wanted")
    say(f"{'peak memory':<42} {max(each.memory for each in cold):8.0f} MB, under 300 wanted")


if __name__ == "__main__":
    main(sys.argv[1], *map(int, sys.argv[2:]))
