"""Counts the modules that one supply reading passes, and one check on its way into the report.

Run it from the top of the repository: `python tests/bench/modules_passed.py [--names]`. It runs the plan `jig` in a
process of its own, with a reading and a check under a profile. A function is passed by the reading if it is entered
during the call. It is passed by the check if it is entered during the call too, and from then to the end of the
process if it takes or returns something that holds the check: its headline, in a text, in bytes, or up to three
levels deep in a container or object. The headline is put together while the case runs, so that neither the plan's
sources nor its requirements hold it.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLAIN = '        check("JIG-MAG-010", "voltage", supply.sensor.voltage(), headline="Supply of the sensor")\n'
TRACED = """\
        supply.sensor.voltage()
        tracer = modules_tracer.Tracer("@FOLDER@")
        with tracer.entered("reading"):
            found = supply.sensor.voltage()
        with tracer.entered("check"):
            check("JIG-MAG-010", "voltage", found, headline=modules_tracer.MARK)
        tracer.follow("report")
"""
TRACER = '''\
"""Writes down which functions of hil are entered."""

import json
import sys
from contextlib import contextmanager
from pathlib import Path

DEPTH = 3
MARK = " ".join(("Supply", "to", "trace"))


def held_by(value):
    """Return what an object holds, without running any code of its own."""
    try:
        held = list(object.__getattribute__(value, "__dict__").values())
    except AttributeError:
        held = []
    for kind in type(value).__mro__:
        for descriptor in vars(kind).values():
            if type(descriptor).__name__ == "member_descriptor":
                try:
                    held.append(descriptor.__get__(value))
                except AttributeError:
                    continue
    return held


class Tracer:
    """Counts calls by module."""

    def __init__(self, folder):
        self._mark, self._bytes, self._folder = MARK, MARK.encode(), Path(folder)

    @contextmanager
    def entered(self, name):
        """Note every function that is entered."""
        calls = {}

        def profile(frame, event, argument):
            module = frame.f_globals.get("__name__", "")
            if event == "call" and module.startswith("hil."):
                calls[module] = calls.get(module, 0) + 1

        sys.setprofile(profile)
        try:
            yield
        finally:
            sys.setprofile(None)
            (self._folder / f"{name}.json").write_text(json.dumps(calls))

    def follow(self, name):
        """Note from now on the functions that take or return what holds the mark."""
        calls = {}

        def profile(frame, event, argument):
            module = frame.f_globals.get("__name__", "")
            if not module.startswith("hil.") or event not in ("call", "return"):
                return
            code = frame.f_code
            held = [argument] if event == "return" else [
                frame.f_locals.get(each) for each in code.co_varnames[: code.co_argcount + code.co_kwonlyargcount + 2]
            ]
            if module not in calls and any(self._holds(each, DEPTH) for each in held):
                calls[module] = 1
                (self._folder / f"{name}.json").write_text(json.dumps(calls))  # the process ends without a word

        sys.setprofile(profile)

    def _holds(self, value, depth):
        if isinstance(value, str):
            return self._mark in value
        if isinstance(value, bytes):
            return self._bytes in value
        if depth == 0 or value is None or isinstance(value, (int, float, type)):
            return False
        if isinstance(value, dict):
            return any(self._holds(each, depth - 1) for pair in list(value.items()) for each in pair)
        if isinstance(value, (list, tuple, set, frozenset)):
            return any(self._holds(each, depth - 1) for each in list(value))
        if type(value).__module__.startswith("hil."):
            return any(self._holds(each, depth - 1) for each in held_by(value))
        return False
'''


def workspace(folder: Path) -> Path:
    """Lay a copy of the workspace into a folder, with the case traced and the check under a headline of its own."""
    shutil.copytree(ROOT / "fixtures", folder / "fixtures", ignore=shutil.ignore_patterns("__pycache__"))
    plan = folder / "testplans" / "jig"
    shutil.copytree(ROOT / "testplans" / "jig", plan, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "testplans" / "requirements.yaml", folder / "testplans")
    (folder / "hil.toml").touch()
    (folder / "modules_tracer.py").write_text(TRACER, encoding="utf-8")
    case = plan / "test_jig.py"
    text = case.read_text(encoding="utf-8")
    if PLAIN not in text:
        raise SystemExit(f"{case}: the line to trace is not there any more; change PLAIN in {__file__}")
    traced = text.replace(PLAIN, TRACED.replace("@FOLDER@", str(folder)))
    head = f"import sys\n\nsys.path.insert(0, {str(folder)!r})\nimport modules_tracer\n"
    case.write_text(traced.replace("import pytest\n", f"{head}import pytest\n", 1), encoding="utf-8")
    return folder


def main() -> None:
    """Run the plan and print the counts."""
    with tempfile.TemporaryDirectory() as name:
        folder = workspace(Path(name))
        hil = Path(sys.executable).with_name("hil")
        command = [hil, "run", "jig", "--bench", "adcs", "--source", "simulated", "--dut", "SIM-ADCS-1"]
        ended = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
        if ended.returncode:
            raise SystemExit(f"{ended.stdout}{ended.stderr}")
        found = {each: json.loads((folder / f"{each}.json").read_text()) for each in ("reading", "check", "report")}
    for each in ("reading", "check"):
        print(f"{each}: {sum(found[each].values())} calls, {len(found[each])} modules")
    print(f"check to the report: {len(found['check'] | found['report'])} modules")
    if "--names" in sys.argv:
        for each, calls in found.items():
            print(f"{each}:\n  " + "\n  ".join(sorted(calls)))


if __name__ == "__main__":
    main()
