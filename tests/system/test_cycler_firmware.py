"""The real firmware of the battery cycler under simavr: every session of its page, every limit, and its driver."""

from __future__ import annotations

import re

import cycler_page
import numpy as np
import pytest
from cycler_bench import Cell, wire
from cycler_firmware import FIRMWARE, close_all, living, size_of
from cycler_page import PAGE, SESSIONS, CyclerUnderTest, sealed
from facing import facing

from hil.clock.virtual import VirtualClock
from hil.instruments.cycler.tester import BatteryCycler
from hil.model.bench import InstrumentSpec
from hil.model.identity import Identity
from hil.simulation.peers.cycler.firmware import MODEL
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.plants.battery.plant import build
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

pytestmark = pytest.mark.system

FLASH_BYTES, RAM_BYTES = 32_256, 2048
SOON_NS = 50_000_000
TERMINALS = {name: f"battery.{name}" for name in ("voltage", "current", "temperature", "charge", "discharge")}
WIRING = TERMINALS | {
    "temperature": "battery.ntc_temperature",
    "charge": "battery.charge_contact",
    "discharge": "battery.discharge_contact",
}


@pytest.fixture(autouse=True)
def ended():
    """No simulator outlives its test."""
    yield
    close_all()


class Board(CyclerUnderTest):
    """The firmware where the simulated cycler is else; replies take some milliseconds."""

    def __init__(self, **truth):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(cycler_page, "MODEL", FIRMWARE)
            super().__init__(truth)

    def wait(self, seconds):
        """Let time pass, and return the lines that came; to the last one, where the device is ahead of the bench."""
        self.clock.sleep(seconds)
        if self.sent:
            self.clock.wait_until(max(self.clock.now_ns(), self.sent[-1][0]))
        return self.fetch()

    def ask(self, text):
        """Give a line of the host, and return the lines that came soon."""
        self.peer.receive(sealed(text))
        return self.wait(0.06)

    def reply(self, text):
        """Give a line of the host, and return the reply alone."""
        return next(line for line in self.ask(text) if line.startswith(":"))

    def start(self, run="0007A3F2", **settings):
        """Set settings, start a test whose settings' CRC the device itself tells, and return the lines."""
        for name, value in settings.items():
            assert self.ask(f":1 SET {name}={value}") == [f":1 OK {name}={value}"]
        (told,) = self.ask(f":2 START run={run} settings=0000")
        return self.ask(f":2 START run={run} settings={told[-4:]}") if "SETTINGS" in told else [told]

    def until(self, text, seconds):
        """Let time pass until a line has a text, and return what came."""
        lines = []
        for _ in range(round(seconds)):
            lines += self.wait(1)
            if any(text in line for line in lines):
                return lines
        raise AssertionError(lines)


@pytest.fixture
def board():
    """A board of level 2, opened, and its banner read."""
    under = Board()
    assert under.opened() == ["START ARDUINO;1;0;2.0;hil-cycler;1.0.0;C0001;42;EXTERNAL"]
    return under


@pytest.mark.parametrize("title", SESSIONS)
def test_sessions_byte_for_byte(title):
    """What the firmware sends is what the page says, nothing else, and no later than it takes to measure."""
    under = Board(**({"level": "1", "cycles": "1"} if title.startswith("Level 1") else {}))
    wanted = [(round(seconds * 1e9), text.encode("ascii")) for seconds, kind, text in SESSIONS[title] if kind == "<"]
    for seconds, kind, text in SESSIONS[title]:
        if kind == "<":
            continue
        under.clock.wait_until(round(seconds * 1e9))
        if kind == "open":
            under.peer.opened()
        elif kind == ">":
            under.peer.receive(text.encode("ascii"))
        else:
            under.battery.show(*map(float, text.split()))
    under.clock.wait_until(wanted[-1][0] + SOON_NS)
    assert [data for _, data in under.sent] == [data for _, data in wanted]
    for (came_ns, data), (due_ns, _) in zip(under.sent, wanted, strict=True):
        assert 0 <= came_ns - due_ns < SOON_NS, data


@pytest.mark.parametrize("level", [1, 2])
def test_flash_and_memory(level):
    """Flash holds the program beside a bootloader, and a quarter of the RAM is never touched."""
    flash, fixed = size_of(level)
    assert flash < FLASH_BYTES / 2
    under = Board(level=str(level))
    under.opened()
    under.battery.show(4.2, 0.04, 25.0)
    if level == 1:
        under.peer.receive(b"x")
    else:
        under.start()
        for text in (":3 STATE", ":4 ID", ":5 GET charge", ":6 START run=0007A3F2 settings=0000", ":7 SET vmax=x"):
            under.ask(text)
    under.wait(11)
    _, stack, untouched, _ = living().examine()
    assert fixed + stack < RAM_BYTES * 3 / 4
    assert untouched > RAM_BYTES / 4


def test_speed_of_the_line():
    """The firmware sets 9600 baud; at that speed the longest reply's last byte leaves within 300 ms."""
    under = Board(real_baud=True)
    under.opened()
    baud = living().examine()[0]
    assert baud == pytest.approx(9600, rel=0.005)
    command = sealed(":65535 STATE")
    ended_ns = under.clock.now_ns() + round(11e9 * len(command) / baud)
    under.fetch()
    under.peer.receive(command)
    under.clock.sleep(0.4)
    ((left_ns, reply),) = under.sent
    assert reply.startswith(b":65535 OK state=IDLE")
    assert left_ns + round(11e9 * len(reply) / baud) - ended_ns < 300e6


def test_the_table_of_settings(board):
    """Every row of the page is the firmware's: default, lowest and highest value are taken, what is beyond is not."""
    rows = re.findall(
        r"^\| `(\w+)` \| (\S*) ?\| (\d) \| (\S+) \| (\S+) \| (\S+) \|", PAGE.read_text("utf-8"), re.MULTILINE
    )
    assert len(rows) == 13
    for name, _, decimals, default, lowest, highest in rows:
        places = int(decimals)
        assert board.reply(f":1 GET {name}") == f":1 OK {name}={default}"
        for text, step in ((lowest, -1), (highest, 1)):
            value, beyond = f"{float(text):.{places}f}", f"{float(text) + step * 10**-places:.{places}f}"
            assert board.reply(f":1 SET {name}={value}") == f":1 OK {name}={value}"
            assert board.reply(f":1 SET {name}={beyond}") == f":1 ERROR RANGE {name}"
            assert board.reply(f":1 GET {name}") == f":1 OK {name}={value}"


@pytest.mark.parametrize(
    ("text", "reply"),
    [
        ("ID now", "FIELD now"),
        ("SET", "FIELD -"),
        ("SET vmax", "FIELD vmax"),
        ("SET vmax=04.200", "FIELD vmax"),
        ("SET tmin=-0.0", "FIELD tmin"),
        ("SET vmaxx=4.200", "FIELD vmaxx"),
        ("SET vmax=4.200 vmin=2.600", "FIELD vmin"),
        ("SET vmax=4294967300.000", "RANGE vmax"),
        ("GET vmax vmin", "FIELD vmin"),
        ("START run=0007A3F2", "FIELD -"),
        ("START run=7a3f2 settings=0000", "FIELD run"),
        ("START settings=0000 run=0007A3F2", "FIELD settings"),
        ("BEAT run=0007A3F2", "STATE IDLE"),
        ("START*OF*A*WORD*TOO*LONG", "COMMAND START?OF?A?WORD?"),
    ],
)
def test_refusals(board, text, reply):
    """Each is told with its name and the word that is meant."""
    assert board.ask(f":9 {text}") == [f":9 ERROR {reply}"]


def test_what_is_no_line_of_a_host(board):
    """It is thrown away with a mark; the next line is understood again; empty lines are nothing."""
    longest = sealed(":1 " + 55 * "X")
    assert len(longest) == 64
    for line in (
        *(b"x\n", b":1 ID\n", b":01 ID*0000\n", b"1 ID*0000\n", b":\xff ID*38C3\n", b":1 ID*38c3\n"),
        *(sealed(text) for text in (":65536 ID", ":99999999999 ID", ":1  ID", ":1 ID ", ":1 ", ":1 " + 56 * "X")),
        100 * b"x" + b"\n",
    ):
        board.wait(0.5)
        board.peer.receive(line)
        assert [text.split(";")[0] for text in board.wait(0.06)] == ["ERROR FRAME"], line
        assert board.ask(":1 GET vmax") == [":1 OK vmax=4.250"]
    board.peer.receive(b"\n\r\n" + longest[:20])
    board.clock.sleep(0.1)
    board.peer.receive(longest[20:-1] + b"\r\n")
    assert board.wait(0.06) == [":1 ERROR COMMAND " + 16 * "X"]


@pytest.mark.parametrize(
    ("shown", "reason"),
    [
        ((3.6, 0.7, -273.0), "SENSOR"),
        ((3.6, 0.7, 999.9), "SENSOR"),
        ((4.251, 0.7, 25.0), "VMAX"),
        ((2.599, 0.7, 25.0), "VMIN"),
        ((3.6, 1.001, 25.0), "IMAX"),
        ((3.6, -1.001, 25.0), "IMAX"),
        ((3.6, 0.7, 45.1), "TMAX"),
        ((3.6, 0.7, -0.1), "TMIN"),
    ],
)
def test_limits_of_what_is_measured(board, shown, reason):
    """The first line beyond one opens the relays, then tells; equal is not beyond, and START refuses it at once."""
    board.battery.show(4.25 if reason == "VMAX" else 3.6, 1.0, 45.0)
    assert len(board.start()) == 2
    assert board.until(";C", 6)
    assert board.relays() == "C"
    board.battery.show(*shown)
    line, mark = board.until("TEST", 6)
    assert line.endswith(";C")
    assert mark.startswith(f"TEST TRIPPED {reason};")
    assert board.relays() == "-"
    assert board.ask(":3 CLEAR") == [":3 OK state=IDLE"]
    assert board.start("00000001") == [f":2 ERROR LIMIT {reason}"]


@pytest.mark.parametrize(
    ("shown", "settings", "lines"),
    [
        ((3.6, 0.7, 25.0), {"time": "60"}, 13),
        ((3.6, 0.72, 25.0), {"charge": "0.010"}, 11),
        ((3.6, 0.0, 25.0), {}, 12),
    ],
)
def test_limits_of_a_half_cycle(board, shown, settings, lines):
    """Time and charge are told by the first line that is beyond them, and no current after twelve lines."""
    board.battery.show(*shown)
    board.start(beat="600", **settings)
    told = board.until("TEST TRIPPED", 70)
    assert sum(line.endswith(";C") for line in told) == lines
    assert told[-1].split(";")[0] == f"TEST TRIPPED {next(iter(settings), 'current').upper()}"


def test_rests_and_changes_of_the_relays(board):
    """One closes 100 ms after the decision, never both; rests are rounded up to lines; current in a rest trips."""
    board.battery.show(4.2, 0.04, 25.0)
    board.start(cycles="2", rest="12", beat="600")
    told = board.until("CHARGE END", 6) + board.until(";R", 6)
    board.battery.show(2.7, -0.7, 25.0)
    told += board.until("TRIPPED", 35)
    assert [line.rpartition(";")[2] if line[0].isdigit() else line.split(";")[0] for line in told] == [
        *("C", "CHARGE END", "R", "R", "R", "D", "DISCHARGE END", "R", "R", "R", "TEST TRIPPED RELAY"),
    ]
    changes = [(name, closed) for _, name, closed in board.battery.history]
    assert changes == [("charge", True), ("charge", False), ("discharge", True), ("discharge", False)]
    decided_ns = [at_ns for at_ns, _, closed in board.battery.history if closed]
    opened_ns = [at_ns for at_ns, _, closed in board.battery.history if not closed]
    assert decided_ns[1] - opened_ns[0] == pytest.approx(15.1e9, abs=3e6)


def test_a_heartbeat_keeps_it_running(board):
    """For as long as it comes; then the relays open at the very instant, in the middle of a measurement too."""
    board.start(beat="10")
    for seconds in (9, 9, 9.7):
        assert not any("TEST" in line for line in board.wait(seconds))
        board.peer.receive(sealed(":3 BEAT run=0007A3F2"))
        beaten_ns = board.clock.now_ns()
    assert board.until("TEST TRIPPED HEARTBEAT", 12)
    opened_ns, name, closed = board.battery.history[-1]
    assert (name, closed) == ("charge", False)
    assert opened_ns - beaten_ns == pytest.approx(10e9, abs=2e6)
    assert board.relays() == "-"


@pytest.mark.parametrize("at", [0.05, 1.26, 4.99, 5.04])
def test_stop_opens_both_relays(board, at):
    """In the pause of the relays, in a measurement, around a line; nothing closes any more."""
    board.battery.show(3.8, 0.7, 25.0)
    board.start()
    board.wait(at - 0.03)
    board.peer.receive(b"\n" + sealed(":0 STOP"))
    lines = board.wait(0.06)
    assert lines[-2] == ":0 OK state=STOPPED"
    assert lines[-1].startswith("TEST STOPPED;")
    board.wait(1)
    assert board.relays() == "-"


def test_a_converter_that_does_not_answer(board):
    """The watchdog resets the device within 2.5 s after the last measurement, which opens the relays; it says so."""
    board.battery.show(3.8, 0.7, 25.0)
    board.start()
    board.until(";C", 6)
    assert board.relays() == "C"
    living().break_converter()
    broken_ns = board.clock.now_ns()
    lines = board.until("START ARDUINO", 5)
    living().break_converter(dead=False)
    opened_ns, name, closed = board.battery.history[-1]
    assert (name, closed) == ("charge", False)
    assert opened_ns - broken_ns < 3.75e9
    assert lines[-1] == "START ARDUINO;1;0;2.0;hil-cycler;1.0.0;C0001;43;WATCHDOG"
    assert board.until("IDLE", 6)
    assert len(living().watchdog_resets) == 1


def test_the_watchdog_leaves_a_device_that_measures(board):
    """Whenever a test begins and is stopped between two of the 5 s, nothing is so far apart that it resets."""
    board.battery.show(3.8, 0.7, 25.0)
    for number, seconds in enumerate(np.arange(0.3, 5.3, 0.7), start=1):
        board.start(f"{number:08X}")
        board.wait(seconds)
        assert board.ask(":3 STOP")[0] == ":3 OK state=STOPPED"
        assert not any("START" in line for line in board.wait(11.2))
        assert board.ask(":4 CLEAR") == [":4 OK state=IDLE"]
    assert living().watchdog_resets == []


@pytest.mark.parametrize("seconds", np.arange(0.0, 5.0, 0.7))
def test_the_watchdog_leaves_a_device_of_level_1_that_begins(seconds):
    """Whenever the byte comes that begins a test: it goes on."""
    under = Board(level="1")
    under.opened()
    under.battery.show(3.8, 0.7, 25.0)
    under.wait(5 + seconds)
    under.peer.receive(b"x")
    assert len(under.wait(11)) == 3
    assert living().watchdog_resets == []


def test_the_boot_counter_is_kept(board):
    """Every start counts up what the EEPROM holds, and nothing else in it changes."""
    before = living().examine()[3]
    assert board.opened() == ["START ARDUINO;1;0;2.0;hil-cycler;1.0.0;C0001;43;EXTERNAL"]
    after = living().examine()[3]
    assert (int.from_bytes(before[:4], "little"), int.from_bytes(after[:4], "little")) == (42, 43)
    assert after[4:] == before[4:]


def test_a_board_that_gets_power():
    """It says so; the port's opening comes later."""
    under = Board(powered=True)
    assert under.wait(0.1) == ["START ARDUINO;1;0;2.0;hil-cycler;1.0.0;C0001;42;POWER"]


def facing_firmware(lines, **truth):
    """Return a driver, its clock and its battery on a real line of 9600 baud."""
    cell = Cell()
    cell.lines = lines
    return cell, facing(
        FIRMWARE, driver=BatteryCycler, truth=truth, connects=TERMINALS, plants={"battery": cell}, baud=9600
    )


@pytest.mark.parametrize("level", ["1", "2"])
def test_the_driver_follows_a_whole_test(level):
    """Prepared, started, followed to its end: phases, cycles and states are the firmware's, every line comes."""
    cell, opened = facing_firmware(3, level=level, cycles="2")
    with opened as (driver, clock):
        cell.clock = clock
        settings = {"level": "1", "cycles": "2"} if level == "1" else {}
        role = driver.role(wire(**settings))
        wanted = "START ARDUINO" if level == "1" else "hil-cycler"
        assert driver.identify().model == wanted
        role.prepare(2)
        role.begin(0.2)
        role.start()
        rows = []
        for _ in range(13):
            clock.sleep(5)
            rows += role.drain().tolist()
        rows = np.array(rows)
        assert rows[:, 5].tolist() == 2 * [1, 1, 1, -1, -1, -1]
        assert rows[:, 6].tolist() == 6 * [1] + 6 * [2]
        assert np.diff(rows[:, 0]) == pytest.approx(5.0, abs=0.2)
        assert rows[0, 1:5].tolist() == [4.2, 0.7, 0.0041, 25.0]
        assert role.state() == "ended"
        assert role.end().lost == 0


def test_the_driver_stops_the_firmware():
    """Both relays open, and another test can follow with another run."""
    cell, opened = facing_firmware(0)
    with opened as (driver, clock):
        cell.clock = clock
        cell.load = 0.7
        role = driver.role(wire())
        assert driver.identify() == Identity(model="hil-cycler", serial="C0001", firmware="1.0.0")
        for _ in range(2):
            role.prepare(10)
            role.start()
            clock.sleep(7)
            assert cell.inputs["charge"]
            role.stop()
            assert role.state() == "stopped"
            assert not any(cell.inputs.values())


class Terminal:
    """A line without a speed that keeps what came as text."""

    def __init__(self):
        self.lines = []

    def send(self, data, after_ns=0):
        """Keep a line."""
        self.lines.append(data.decode("ascii").removesuffix("\r\n"))


def cycled(model, hours):
    """Return the lines of a test of level 1 with a small battery behind a device."""
    clock, terminal = VirtualClock(), Terminal()
    battery = build("battery", 5_000_000_000, Truth({"capacity": "0.7", "charge": "0.3"}, ("truth",)))
    battery.follow(clock.now_ns)
    setup = PeerSetup(
        instrument=InstrumentSpec(name="cycler", driver="cycler"),
        truth=Truth({"level": "1", "cycles": "1"}, ("truth",)),
        connections=Connections(WIRING, {"battery": battery}, set(), ("connects",)),
        seeds=Seeds(1),
    )
    device = model.build(setup)
    device.attach(terminal, clock)
    battery.command(supply_voltage=4.2, supply_current=0.7)
    device.opened()
    clock.sleep(2)
    device.receive(b"\r")
    clock.sleep(hours * 3600)
    assert terminal.lines[-1] == "TEST END"
    return terminal.lines


@pytest.mark.timeout(600)
def test_peer_and_firmware_agree_over_a_cycle():
    """With the same battery every mark is at its place, and every field within its last digit.

    The firmware tells the mean of the second before a line, the peer what is at its end: half a second of a slope, a
    tenth of what there is between two lines, may stand between them. Energy adds up what the last digits of voltage
    and current leave: the firmware's is that of its own lines.
    """
    peer, firmware = cycled(MODEL, 4), cycled(FIRMWARE, 4)
    assert [line for line in firmware if line[0].isupper()] == [line for line in peer if line[0].isupper()]
    assert len(peer) == len(firmware)
    energy, before = 0, None
    for simulated, real in zip(peer, firmware, strict=True):
        if real[0].isupper():
            assert simulated == real
            energy, before = 0, None
            continue
        wanted, got = ([int(field.replace(".", "")) for field in line.split(";")] for line in (simulated, real))
        energy += abs(got[0] * got[1])
        assert got[2] == (energy + 36_000) // 72_000
        slope = np.ceil(np.abs(np.subtract(wanted, before or wanted)) * 0.11)
        assert (np.abs(np.subtract(wanted, got)) <= np.add(slope, [1, 1, 4, 1])).all(), (simulated, real)
        before = wanted
