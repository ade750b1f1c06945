"""The simulated battery cycler against the page: every session byte for byte, and every rule."""

from __future__ import annotations

import re

import pytest
from cycler_page import PAGE, SESSIONS, CyclerUnderTest, sealed


def as_simulated(line):
    """Return a line of the page as a simulated device sends it: it says so in the place of its firmware's version."""
    if "hil-cycler" not in line:
        return line.encode("ascii")
    return sealed(line.rpartition("*")[0].replace("1.0.0", "SIM.0")).replace(b"\n", b"\r\n")


def play(session, **truth):
    """Play a session's own part; return what the device should have sent, and what it did."""
    under, wanted = CyclerUnderTest(truth), []
    for seconds, kind, text in session:
        if kind == "<":
            wanted.append((round(seconds * 1e9), as_simulated(text)))
            continue
        under.clock.wait_until(round(seconds * 1e9))
        if kind == "open":
            under.peer.opened()
        elif kind == ">":
            under.peer.receive(text.encode("ascii"))
        else:
            under.battery.show(*map(float, text.split()))
    under.clock.wait_until(max(at_ns for at_ns, _ in wanted))
    return wanted, under.sent


def test_the_page_has_its_sessions():
    """All four are found, and everything in them is understood."""
    assert [title.split(",")[0] for title in SESSIONS] == ["Level 1", "Level 2", "Level 2", "Level 2"]
    assert min(len(session) for session in SESSIONS.values()) > 15


@pytest.mark.parametrize("title", SESSIONS)
def test_sessions_byte_for_byte(title):
    """What the device sends, and when, is what the page says, and nothing else is sent."""
    truth = {"level": "1", "cycles": "1"} if title.startswith("Level 1") else {}
    wanted, sent = play(SESSIONS[title], **truth)
    assert sent == wanted


def test_host_lines_of_the_sessions_are_sealed():
    """Every line of the host has the CRC that the page describes, but the one that is meant to be wrong."""
    lines = [
        line for session in SESSIONS.values() for _, kind, text in session for line in text.split("\n") if kind == ">"
    ]
    wrong = [line for line in lines if line.startswith(":") and sealed(line.rpartition("*")[0]) != f"{line}\n".encode()]
    assert wrong == [":1 ID*0000"]


def test_what_the_page_computes():
    """The CRC of the defaults, the example of a line, and the bytes that stop every device."""
    page = PAGE.read_text(encoding="utf-8")
    assert f"`{CyclerUnderTest().cycler.settings.check()}`. ORDER" in page
    for text in (":7 GET vmax", ":0 STOP"):
        assert sealed(text).decode("ascii").replace("\n", "\\n") in page


def test_the_table_of_settings():
    """Every row of the page is the device's: default, lowest and highest value are taken, what is beyond is not."""
    rows = re.findall(
        r"^\| `(\w+)` \| (\S*) ?\| (\d) \| (\S+) \| (\S+) \| (\S+) \|", PAGE.read_text("utf-8"), re.MULTILINE
    )
    assert len(rows) == 13
    for name, _, decimals, default, lowest, highest in rows:
        under, places = CyclerUnderTest(), int(decimals)
        assert under.ask(f":1 GET {name}") == [f":1 OK {name}={default}"]
        for text, step in ((lowest, -1), (highest, 1)):
            value = f"{float(text):.{places}f}"
            assert under.ask(f":1 SET {name}={value}") == [f":1 OK {name}={value}"]
            beyond = f"{float(text) + step * 10**-places:.{places}f}"
            assert under.ask(f":1 SET {name}={beyond}") == [f":1 ERROR RANGE {name}"]
            assert under.ask(f":1 GET {name}") == [f":1 OK {name}={value}"]


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
        ("GET", "FIELD -"),
        ("GET vmax vmin", "FIELD vmin"),
        ("START run=0007A3F2", "FIELD -"),
        ("START run=7a3f2 settings=0000", "FIELD run"),
        ("START settings=0000 run=0007A3F2", "FIELD settings"),
        ("BEAT", "FIELD -"),
        ("START*OF*A*WORD*TOO*LONG", "COMMAND START?OF?A?WORD?"),
    ],
)
def test_refusals(text, reply):
    """Each is told with its name and the word that is meant."""
    assert CyclerUnderTest().ask(f":9 {text}") == [f":9 ERROR {reply}"]


@pytest.mark.parametrize(
    "line",
    [
        b"x",
        b":1 ID",
        b":01 ID*0000",
        b"1 ID*0000",
        sealed(":65536 ID"),
        sealed(":1  ID"),
        sealed(":1 ID "),
        sealed(":1 GET " + 60 * "x"),
    ],
)
def test_what_is_no_line_of_a_host(line):
    """It is thrown away with a mark; the next line is understood again."""
    under = CyclerUnderTest()
    under.peer.receive(line.rstrip(b"\n") + b"\n")
    assert [text.split(";")[0] for text in under.fetch()] == ["ERROR FRAME"]
    assert under.ask(":1 GET vmax") == [":1 OK vmax=4.250"]


def test_a_line_of_64_bytes_is_the_longest():
    """One of exactly 64 is answered, empty ones and a CR before the end are nothing."""
    under = CyclerUnderTest()
    longest = sealed(":1 " + 55 * "X")
    assert len(longest) == 64
    under.peer.receive(b"\n\r\n" + longest[:20])
    under.peer.receive(longest[20:])
    assert under.fetch() == [":1 ERROR COMMAND " + 16 * "X"]
    under.peer.receive(sealed(":1 GET vmax").replace(b"\n", b"\r\n"))
    assert under.fetch() == [":1 OK vmax=4.250"]


@pytest.mark.parametrize(
    ("settings", "word"),
    [
        ({"vmin": "2.700"}, "vmin"),
        ({"vfull": "3.000", "vend": "3.000"}, "vend"),
        ({"vmax": "4.150"}, "vfull"),
        ({"iend": "1.000"}, "iend"),
        ({"tmin": "30.0", "tmax": "30.0"}, "tmin"),
    ],
)
def test_settings_that_contradict_each_other(settings, word):
    """START refuses them."""
    assert CyclerUnderTest().start(**settings) == [f":2 ERROR ORDER {word}"]


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
def test_limits_of_what_is_measured(shown, reason):
    """The first line beyond one opens the relays, then tells; equal is not beyond, and START refuses it at once."""
    under = CyclerUnderTest()
    under.battery.show(4.25 if reason == "VMAX" else 3.6, 1.0, 45.0)
    assert len(under.start()) == 2
    under.wait(5)
    assert under.relays() == "C"
    under.battery.show(*shown)
    line, mark = under.wait(5)
    assert line.endswith(";C")
    assert mark.startswith(f"TEST TRIPPED {reason};")
    assert under.relays() == "-"
    assert under.ask(":3 CLEAR") == [":3 OK state=IDLE"]
    assert under.start("00000001") == [f":2 ERROR LIMIT {reason}"]


def marks(lines):
    """Return the texts of the marks among lines."""
    return [line.split(";")[0] for line in lines if line[0].isupper()]


def test_limits_of_a_half_cycle():
    """Time and charge are told by the first line that is beyond them, and no current after twelve lines."""
    for shown, settings, line in (
        ((3.6, 0.7, 25.0), {"time": "60"}, 13),
        ((3.6, 0.72, 25.0), {"charge": "0.010"}, 11),
        ((3.6, 0.0, 25.0), {}, 12),
    ):
        under = CyclerUnderTest()
        under.battery.show(*shown)
        under.start(beat="600", **settings)
        assert marks(under.wait(5 * line - 1)) == []
        reason = next(iter(settings), "current").upper()
        assert marks(under.wait(1)) == [f"TEST TRIPPED {reason}"]


def test_a_line_that_ends_its_half_cycle_does_not_trip_time():
    """The charge ends at the line that would be beyond the time."""
    under = CyclerUnderTest()
    under.battery.show(4.2, 0.7, 25.0)
    under.start(time="60", beat="600")
    under.wait(61)
    under.battery.show(4.2, 0.05, 25.0)
    assert marks(under.wait(5)) == ["CHARGE END"]


def test_rests_and_changes_of_the_relays():
    """Relays are never closed together, rests are rounded up to lines, and the last discharge has none."""
    under = CyclerUnderTest()
    under.battery.show(4.2, 0.04, 25.0)
    under.start(cycles="2", rest="7", beat="600")
    lines = under.wait(5) + under.wait(10)
    under.battery.show(2.7, -0.7, 25.0)
    lines += under.wait(5)
    under.battery.show(4.2, 0.04, 25.0)
    lines += under.wait(10) + under.wait(5) + under.wait(10)
    under.battery.show(2.7, -0.7, 25.0)
    lines += under.wait(5)
    assert [line.rpartition(";")[2] if line[0].isdigit() else line.split(";")[0] for line in lines] == [
        *("C", "CHARGE END", "R", "R", "D", "DISCHARGE END", "R", "R", "TEST ITERATION 2"),
        *("C", "CHARGE END", "R", "R", "D", "DISCHARGE END", "TEST END"),
    ]
    assert [(at_ns / 1e9, name, value) for at_ns, name, value in under.battery.history] == [
        *((0.1, "charge", True), (5, "charge", False), (15.1, "discharge", True), (20, "discharge", False)),
        *((30.1, "charge", True), (35, "charge", False), (45.1, "discharge", True), (50, "discharge", False)),
    ]


def test_a_stop_in_the_pause_of_the_relays():
    """What should have closed stays open."""
    under = CyclerUnderTest()
    under.start()
    under.ask(":0 STOP")
    under.wait(1)
    assert under.battery.history == []


def test_a_second_host_and_a_late_start():
    """Another run is BUSY while one is tested; the last one never starts again."""
    under = CyclerUnderTest()
    under.start()
    assert under.start("00000001") == [":2 ERROR BUSY 0007A3F2"]
    assert under.ask(":3 CLEAR") == [":3 ERROR BUSY 0007A3F2"]
    assert under.start() == [":2 OK run=0007A3F2"]
    under.ask(":0 STOP")
    assert under.start() == [":2 ERROR STATE STOPPED"]
    under.ask(":4 CLEAR")
    assert under.ask(":4 CLEAR") == [":4 OK state=IDLE"]
    assert under.start() == [":2 ERROR RUN 0007A3F2"]


def test_a_heartbeat_keeps_it_running():
    """For as long as it comes; then the relays open at the very instant."""
    under = CyclerUnderTest()
    under.battery.load = 0.7
    under.start(beat="10")
    for _ in range(10):
        assert marks(under.wait(9)) == []
        under.ask(":3 BEAT run=0007A3F2")
    under.fetch()
    assert marks(under.wait(11)) == ["TEST TRIPPED HEARTBEAT"]
    assert under.battery.history[-1] == (100_000_000_000, "charge", False)


def test_level_one_takes_one_byte_and_no_other():
    """The bootloader swallows bytes; the first after the banner starts; nothing later stops it or starts it again."""
    under = CyclerUnderTest({"level": "1", "cycles": "1"})
    under.peer.opened()
    under.peer.receive(b"x")
    assert under.wait(100) == ["START ARDUINO"]
    under.battery.show(4.2, 0.05, 25.0)
    assert under.ask(":0 STOP") == ["TEST ITERATION 1"]
    assert marks(under.wait(5)) == ["CHARGE END"]
    under.battery.show(2.7, -0.7, 25.0)
    assert marks(under.wait(5)) == ["DISCHARGE END", "TEST END"]
    assert under.ask("x") == under.wait(100) == []


def test_ten_cycles_by_default():
    """Both levels run ten if nobody says otherwise."""
    for level in "12":
        under = CyclerUnderTest({"level": level})
        under.start(beat="600") if level == "2" else under.ask("x")
        lines = []
        for _ in range(10):
            under.battery.show(4.2, 0.05, 25.0)
            lines += under.wait(5)
            under.battery.show(2.7, -0.7, 25.0)
            lines += under.wait(5)
        assert marks(lines).count("DISCHARGE END") == 10
        assert marks(lines)[-1] == "TEST END"


def test_opening_resets_unless_prevented():
    """A reset opens the relays and forgets settings and run; where it is prevented the test goes on."""
    under = CyclerUnderTest()
    under.start(beat="600")
    under.wait(1)
    (banner,) = under.opened()
    assert banner == "START ARDUINO;1;0;2.0;hil-cycler;SIM.0;C0001;42;EXTERNAL"
    assert under.relays() == "-"
    assert under.ask(":1 GET beat") == [":1 OK beat=60"]
    assert "state=IDLE run=- cycle=0 relays=- lines=1" in under.ask(":1 STATE")[0]
    under = CyclerUnderTest({"reset_on_open": False})
    under.start()
    under.wait(1)
    assert under.opened() == []
    assert under.relays() == "C"
