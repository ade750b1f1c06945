"""`hil simulate` as a process of its own, talked to by programs that are not ours."""

from __future__ import annotations

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from contextlib import suppress

import pytest
import serial
from pymodbus.client import ModbusSerialClient
from served import ROOT
from workspaces import command_line

from hil.model.errors import Refused
from hil.simulation.served.folder import ask

pytestmark = [pytest.mark.system, pytest.mark.alone]


class Served:
    """A served bench: its process, what it printed, and where it is."""

    def __init__(self, folder, *options, bench="adcs"):
        self.folder = folder
        # Where these tests run in the background, SIGINT is ignored, and would be here, too.
        listening = (
            "import os, signal, sys; signal.signal(signal.SIGINT, signal.SIG_DFL); os.execv(sys.argv[1], sys.argv[1:])"
        )
        command = [sys.executable, "-c", listening, *command_line("simulate", bench, "--folder", str(folder), *options)]
        self.process = subprocess.Popen(
            command, cwd=ROOT, text=True, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
        )
        self.said = []
        for line in self.process.stdout:
            self.said.append(line.rstrip("\n"))
            if self.said[-1] == "ready":
                return
        raise AssertionError(self.process.stderr.read())

    def ask(self, **document):
        """Ask at the control socket."""
        return next(iter(ask(self.folder, document).values()))

    def end(self, number=signal.SIGTERM):
        """End it and return its exit code and what it said on standard error."""
        if self.process.poll() is None:
            self.process.send_signal(number)
        _, error = self.process.communicate(timeout=60)
        return self.process.returncode, error


@pytest.fixture
def serve(tmp_path):
    """Start served benches; those that are left at the end are killed."""
    started = []

    def start(*options, **choices):
        started.append(Served(tmp_path / "ends", *options, **choices))
        return started[-1]

    yield start
    for one in started:
        one.end(signal.SIGKILL)


def test_pyserial_talks_to_a_network_instrument(serve):
    """SCPI over `socket://`; the true state has the output on, and the voltage at the plant."""
    bench = serve()
    with serial.serial_for_url(bench.ask(ends=None)["psu1"], timeout=5) as supply:
        supply.write(b"*IDN?\n")
        assert supply.readline() == b"Keysight Technologies,E36312A,SIM-MY59002391,2.1.0-1.0.4-1.12\n"
        supply.write(b"VOLT 3.3,(@3);CURR 0.05,(@3);:OUTP ON,(@3)\n*OPC?\n")
        assert supply.readline() == b"1\n"
    assert bench.ask(state="peers.psu1.channels.3.on") is True
    assert bench.ask(state="plants.coil.sensor_power.voltage") == pytest.approx(3.3)


def test_a_plain_socket_is_enough(serve):
    """Nothing but TCP is needed, and the port can be chosen."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    serve("--first-port", str(port))
    with socket.create_connection(("127.0.0.1", port), timeout=5) as supply:
        supply.sendall(b"SYST:ERR?\n")
        assert supply.recv(100) == b'+0,"No error"\n'


def test_pymodbus_drives_relays(serve):
    """A Modbus master of another make closes a contact; physics has it closed, and it is read back."""
    bench = serve()
    client = ModbusSerialClient(str(bench.folder / "relay1"), baudrate=9600, timeout=5, retries=0)
    assert client.connect()
    try:
        assert not client.write_coil(0, True, device_id=1).isError()
        assert client.read_coils(0, count=8, device_id=1).bits == [True, *[False] * 7]
    finally:
        client.close()
    deadline = time.monotonic() + 5
    while not bench.ask(state="plants.coil.contact_a"):
        assert time.monotonic() < deadline
    assert bench.ask(state="peers.relay1.closed") == {str(contact): contact == 1 for contact in range(1, 9)}


@pytest.mark.skipif(shutil.which("mbpoll") is None, reason="mbpoll is not installed")
def test_mbpoll_reads_relays(serve):
    """libmodbus, too, understands the relay board."""
    bench = serve()
    command = ["mbpoll", "-m", "rtu", "-a", "1", "-t", "0", "-r", "1", "-c", "8", "-b", "9600", "-P", "none", "-1"]
    read = subprocess.run(
        [*command, str(bench.folder / "relay1")], capture_output=True, text=True, timeout=60, check=False
    )
    assert read.returncode == 0, read.stdout + read.stderr
    assert "[8]: \t0" in read.stdout


def test_time_goes_at_the_speed_that_was_asked_for(serve):
    """At a hundred times real time a second of the bench takes a hundredth, and faults come when they are due."""
    bench = serve("--speed", "100")
    before = time.monotonic()
    began, after = bench.ask(time=None), time.monotonic()
    bench.ask(fault={"device": "table1", "kind": "dead", "until": "60 s"})
    with serial.serial_for_url(str(bench.folder / "table1"), 921_600, timeout=0.05) as table:
        answers = []
        while not any(answers):
            table.write(b"VE?\r\n")
            answers.append(table.readline())
    least = time.monotonic() - after
    now, most = bench.ask(time=None), time.monotonic() - before
    assert len(answers) > 1
    assert answers[-1].startswith(b"ESP301")
    passed = now["bench"] - began["bench"]
    assert passed > 60
    assert 100 * least - 0.001 < passed + 100 * now["slipped"] < 100 * most + 0.001


def test_an_injected_fault_shows_to_a_client(serve):
    """A supply that refuses to switch off says that it is off, and stays on in truth."""
    bench = serve()
    with serial.serial_for_url(bench.ask(ends=None)["psu1"], timeout=5) as supply:
        supply.write(b"VOLT 3,(@2);:OUTP ON,(@2)\n*OPC?\n")
        assert supply.readline() == b"1\n"
        assert bench.ask(fault={"device": "psu1", "kind": "refuse-off", "channel": "2", "says": "off"}) is True
        supply.write(b"OUTP OFF,(@2)\nOUTP? (@2)\n")
        assert supply.readline() == b"0\n"
    assert bench.ask(state="plants.coil.voltage") > 2.9


HEIR = """
import os, sys
supply, relays = map(int, sys.argv[1:])
sys.stdin.read()
os.write(supply, b"OUTP OFF,(@3)\\n")
os.write(relays, bytes.fromhex("010500000000CDCA"))
"""


def test_descriptors_outlive_who_opened_them(serve):
    """Who inherited open ports can use them after the one who opened them has gone; for the bench they stayed open."""
    bench = serve()
    supply = serial.serial_for_url(bench.ask(ends=None)["psu1"], timeout=5)
    relays = serial.Serial(str(bench.folder / "relay1"), 9600, timeout=5, exclusive=True)
    supply.write(b"VOLT 3.3,(@3);:OUTP ON,(@3)\n*OPC?\n")
    assert supply.readline() == b"1\n"
    relays.write(bytes.fromhex("01050000FF008C3A"))
    assert len(relays.read(8)) == 8
    descriptors = (supply._socket.fileno(), relays.fd)
    heir = subprocess.Popen(
        [sys.executable, "-c", HEIR, *map(str, descriptors)], pass_fds=descriptors, stdin=subprocess.PIPE
    )
    relays.close()
    supply._socket.detach()
    os.close(descriptors[0])
    assert bench.ask(state="lines.psu1.open") is True
    assert bench.ask(state="lines.relay1.open") is True
    assert bench.ask(state="peers.psu1.channels.3.on") is True
    heir.communicate(timeout=60)
    deadline = time.monotonic() + 5
    while bench.ask(state="peers.psu1.channels.3.on") or bench.ask(state="plants.coil.contact_a"):
        assert time.monotonic() < deadline


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_it_in_order(serve, number):
    """Nothing is left, and nothing is said; clients see a hang-up."""
    bench = serve()
    port = int(bench.ask(ends=None)["psu1"].rpartition(":")[2])
    with socket.create_connection(("127.0.0.1", port), timeout=30) as supply:
        assert bench.end(number) == (0, "")
        with suppress(ConnectionResetError):
            assert supply.recv(1) == b""
    assert not bench.folder.exists()


def test_stop_ends_it_in_order(serve):
    """Whoever may ask may also end it."""
    bench = serve()
    assert bench.ask(stop=True) is True
    assert bench.process.wait(timeout=60) == 0
    assert not bench.folder.exists()


def test_a_killed_server_leaves_nothing_that_prevents_the_next(serve):
    """SIGKILL leaves links and a socket; the next server takes the folder over, while a second one is refused."""
    bench = serve()
    command = command_line("simulate", "battery", "--folder", str(bench.folder))
    other = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert other.returncode == 4
    assert "another server serves a bench" in other.stderr
    os.kill(bench.process.pid, signal.SIGKILL)
    bench.process.wait(timeout=60)
    assert bench.folder.exists()
    with pytest.raises(Refused, match="no served bench answers"):
        bench.ask(time=None)
    again = serve()
    assert again.ask(time=None)["bench"] >= 0
    assert again.end() == (0, "")
    assert sorted(path.name for path in bench.folder.iterdir()) == []


def test_it_says_what_it_serves_and_what_not(serve):
    """One line per instrument, a warning before and `ready` after."""
    bench = serve()
    assert bench.said[0].startswith("SIMULATED: bench adcs")
    assert "none of this is hardware" in bench.said[0]
    where = dict(line.split(None, 1) for line in bench.said[1:-1])
    assert where["relay1"] == str(bench.folder / "relay1")
    assert where["psu1"].startswith("socket://127.0.0.1:")
    assert where["mag1"].startswith("not served: ")
    assert where["gyro1"] == "on bus adcs, through obc1"
    assert json.loads(json.dumps(bench.ask(state="")))["plants"].keys() == {"coil", "chamber", "table"}
