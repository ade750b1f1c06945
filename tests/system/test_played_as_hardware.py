"""A simulated bench that is played as hardware: whatever else is in order, it closes nothing, and says why."""

from __future__ import annotations

import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from live_runs import seconds_until, served
from told_as_json import results_as_json
from told_pages import Written, steps_of
from workspaces import ROOT, command_line, kill
from wrapped_package import paths_of, written

from hil.evidence.folder import JOURNAL
from hil.evidence.ledger.book import read
from hil.evidence.ledger.entries import Baseline
from hil.evidence.package.contents import Package

PAGE = ROOT / "docs" / "how-to" / "write-a-plan.md"
INHIBITOR = "#!/bin/sh\necho held\nexec sleep 3600\n"


def free_port():
    """Return a port of this computer's own network that nobody has."""
    with socket.socket() as asking:
        asking.bind(("127.0.0.1", 0))
        return asking.getsockname()[1]


def workspace_of(root, port, **bench):
    """Write the workspace of the guide, as somebody would who wants it to be taken for hardware; commit it."""
    for step in steps_of(PAGE):
        if isinstance(step, Written):
            (root / step.path).parent.mkdir(parents=True, exist_ok=True)
            (root / step.path).write_text(step.content)
    inhibitor = root / "inhibit.sh"
    inhibitor.write_text(INHIBITOR)
    inhibitor.chmod(0o755)
    (root / "hil.toml").write_text(f'name = "own"\n[hardware]\ninhibitor = ["{inhibitor}"]\n')
    changes = {"192.168.10.21::5025": f"127.0.0.1::{port}", **bench}
    change(root / "fixtures/benches/load/bench.yaml", changes)
    change(root / "fixtures/duts.yaml", {"model: EM": "model: FM", ", simulated: true": ""})
    plan = root / "testplans/load/requirements.yaml"
    plan.write_text(re.sub(r"(\n\s*method: test\n)", r"\1  stage: acceptance\n", plan.read_text()))
    assert "stage: acceptance" in plan.read_text()
    (root / ".gitignore").write_text("reports/\n__pycache__/\n")


def change(path, changes):
    """Replace texts in a file; each is there."""
    text = path.read_text()
    for old, new in changes.items():
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text)


def hil(root, *arguments, **environment):
    """Call the command in a workspace, and return how it ended."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    command = [sys.executable, "-P", "-m", "hil.cli", *arguments]
    return subprocess.run(
        command, cwd=root, env=kept | environment, stdin=subprocess.DEVNULL, capture_output=True, text=True, check=False
    )


def git(root, *arguments):
    """Call git in a workspace."""
    named = ("-c", "user.name=Ada", "-c", "user.email=ada@example.org")
    subprocess.run(["git", *named, *arguments], cwd=root, check=True, capture_output=True)


RUN = ("run", "load", "--bench", "load", "--dut", "SIM-LOAD-1", "--purpose", "acceptance", "--operator", "Ada")
BRIDGE = {"driver: keysight-e36300": 'driver: keysight-e36300\n    stands_for_hardware: "a bridge"'}
READS_AND_WAITS = {"    check(": "    clock.sleep(3.0)\n    check("}


def put_in_order(root):
    """Lock the requirements, and put everything into version control."""
    assert hil(root, "requirements", "lock", "load").returncode == 0
    git(root, "init", "-q")
    git(root, "add", "-A")
    git(root, "commit", "-qm", "all")


@pytest.mark.system
@pytest.mark.timeout(120)
def test_a_served_bench_called_hardware_is_not_eligible(tmp_path):
    """A bench that is served on loopback and called hardware, the rest in order, closes nothing; each way says why."""
    port = free_port()
    root = tmp_path / "own"
    workspace_of(root, port, **BRIDGE)
    put_in_order(root)
    with served(tmp_path / "e", root, "load", first_port=port):
        refused = hil(root, *RUN, PYTHONOPTIMIZE="1")
        done = hil(root, *RUN)
    assert refused.returncode == 4
    assert "this Python leaves assertions out" in refused.stderr
    assert done.returncode == 0, done.stdout + done.stderr
    package = Package(Path(root / done.stdout.splitlines()[-1]))
    results = results_as_json(package.outcome())
    (item, *_) = results["requirements"]
    assert (item["verdict"], item["eligible"]) == ("PASS", False)
    product = {
        "the product differs from its commit",
        "the product is not in version control",
        "PYTHONPATH changes which code is executed",  # of these tests, as is the next one
        "Python executed hil-tests/sitecustomize.py",
    }
    reasons = [each for each in item["reasons"] if not any(each.startswith(start) for start in product)]
    assert reasons == ["SIMULATED: psu1"]
    ports = [gate.detail for gate in package.state.host_gates if gate.instrument == "psu1"]
    assert ports == [f"TCPIP::127.0.0.1::{port}::SOCKET belongs to a bench that is served on this computer"]
    (identity,) = [gate for gate in package.state.gates if gate.instrument == "psu1"]
    assert (identity.detail, identity.source) == ("Keysight Technologies E36312A SIM-MY59000001", "simulated")
    assert hil(root, "verify", str(package.folder)).returncode == 0
    assert {each.subject for each in read(root / "reports").of(Baseline)} == {"catalogue", "units", "instruments"}


def killed_after_reading(root):
    """Start a run, kill it with -9 once its journal has a current outside the limit, acknowledge; return its folder."""
    process = subprocess.Popen(
        command_line(*RUN), cwd=root, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, start_new_session=True
    )

    def reading():
        return [path for path in root.glob(f"reports/*/{JOURNAL}") if b"supply.load.current" in path.read_bytes()]

    try:
        seconds_until(lambda: reading() or process.poll() is not None, 60.0, "a reading")
    finally:
        kill(process)
        said, _ = process.communicate()
    assert reading(), said.decode()
    folder = reading()[0].parents[1]
    acknowledged = ("ack", folder.name, "--by", "Ada", "--text", "the resistor is warm")
    seconds_until(lambda: hil(root, *acknowledged).returncode == 0, 30.0, "acknowledged")
    return folder


@pytest.mark.system
@pytest.mark.alone
@pytest.mark.timeout(150)
def test_a_bad_reading_is_not_undone_by_kill_acknowledge_and_resume(tmp_path):
    """120 ohm was read, then 100.4 ohm, and it was a PASS: no file edited, or the journal cut before the reading."""
    port, root, other = free_port(), tmp_path / "own", tmp_path / "other"
    for each, load in ((root, "120"), (other, "100.4")):
        workspace_of(each, port, **BRIDGE)
        change(each / "testplans/load/test_load.py", READS_AND_WAITS)
        change(each / "fixtures/benches/load/bench.yaml", {'load: "100.4"': f'load: "{load}"'})
    put_in_order(root)
    with served(tmp_path / "e", root, "load", first_port=port):
        folder = killed_after_reading(root)
    journal = (folder / JOURNAL).read_bytes()
    lines = journal.splitlines(keepends=True)
    first = next(number for number, line in enumerate(lines) if b'"kind":"case"' in line)
    (folder / JOURNAL).write_bytes(b"".join(lines[: first + 1]))
    with served(tmp_path / "f", other, "load", first_port=port):
        cut = hil(root, "resume", folder.name)
        (folder / JOURNAL).write_bytes(journal)
        resumed = hil(root, "resume", folder.name)
    assert cut.returncode == 4
    assert f"cannot resume: the journal has {first + 1} events, and the ledger saw event" in cut.stderr
    assert resumed.returncode == 1, resumed.stdout + resumed.stderr
    results = results_as_json(Package(folder).outcome())
    (case,) = results["cases"]
    assert [(each["attempt"], each["verdict"]) for each in case["attempts"]] == [(1, None), (2, "ABORTED")]
    assert case["verdict"] == "ABORTED"
    assert any("without a verdict, after it had read supply.load.voltage" in each for each in case["reasons"])
    assert [check["verdict"] for check in case["checks"]] == ["PASS"]
    (item, *_) = results["requirements"]
    assert (item["verdict"], item["eligible"]) == ("ABORTED", False)
    assert hil(root, "verify", folder.name).returncode == 0


WRAPPED = {
    "driver: keysight-e36300": "driver: acme-psu\n    timeout: 1 s\n    bytes_unseen: read by a multimeter, too",
    "{manufacturer: Keysight Technologies, model: E36312A, serial: MY59000001}": "{model: P30, serial: A1}",
    '{channel: "2", ': "{",
    ', channel: "2",\n   settings: {over_voltage: "8"},': ",",
    '      truth: {serial: MY59000001, load: "100.4"}': "      {}",
}


@pytest.mark.system
@pytest.mark.alone
@pytest.mark.timeout(300)
def test_a_wrapped_supply_is_run_replayed_and_made_safe(tmp_path, monkeypatch):
    """Calls stand in the place of bytes; the guardian acts after kill -9; a replay needs no code of the vendor."""
    package, file, root = written(tmp_path / "acme"), tmp_path / "instrument.json", tmp_path / "own"
    file.write_text(json.dumps({"voltage": 0.0, "limit": 0.0, "on": False, "ohms": 100.4}), encoding="utf-8")
    workspace_of(root, 1, **WRAPPED, **{"TCPIP::127.0.0.1::1::SOCKET": f'"vendor:{file}"'})
    change(root / "testplans/load/test_load.py", READS_AND_WAITS)
    monkeypatch.setenv("PYTHONPATH", paths_of(package))
    put_in_order(root)
    done = hil(root, *RUN)
    assert done.returncode == 0, done.stdout + done.stderr
    run = Package(root / done.stdout.splitlines()[-1])
    (item, *_) = results_as_json(run.outcome())["requirements"]
    assert item["verdict"] == "PASS"
    exception = "psu1: its bytes were not seen, only the calls of its vendor's driver: read by a multimeter, too"
    assert run.state.exceptions == (exception,)
    assert "its bytes were not seen" in " ".join((done.stdout + done.stderr).split())
    assert not json.loads(file.read_text(encoding="utf-8"))["on"]
    replayed = hil(root, "replay", run.folder.name, PYTHONPATH=paths_of(package, vendor=False))
    assert replayed.returncode == 0, replayed.stdout + replayed.stderr

    process = subprocess.Popen(command_line(*RUN), cwd=root, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        seconds_until(
            lambda: (
                process.poll() is not None
                or [each for each in root.glob(f"reports/*/{JOURNAL}") if b"supply.load.current" in each.read_bytes()][
                    1:
                ]
            ),
            60.0,
            "a reading",
        )
        assert process.poll() is None
        assert json.loads(file.read_text(encoding="utf-8"))["on"]
    finally:
        kill(process)
        process.wait()
    seconds_until(lambda: not json.loads(file.read_text(encoding="utf-8"))["on"], 4.0, "off")
