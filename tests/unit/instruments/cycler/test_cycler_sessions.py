"""The driver of the battery cycler against the sessions of the page, as bytes, and against single lines."""

from __future__ import annotations

import re
from functools import partial

import pytest
from cycler_bench import wire
from cycler_page import PAGE, SESSIONS

from hil.clock.virtual import VirtualClock
from hil.instruments.cycler.lines import plain_numbers, seal
from hil.instruments.cycler.session import refusal
from hil.instruments.cycler.settings import SETTINGS, checked, crc_of
from hil.instruments.cycler.tester import BatteryCycler
from hil.instruments.driver import Clamps, Connection
from hil.model.bench import Wire
from hil.model.errors import Garbled, NoReply, Refused

TITLES = list(SESSIONS)


class Page:
    """A port at whose far end a session of the page is read aloud; what the host writes is kept."""

    timeout = 0.5

    def __init__(self, clock, session):
        self.clock = clock
        self.written = b""
        self.come = bytearray()
        self.pulses = 0
        for seconds, kind, text in session:
            if kind == "<":
                clock.at(round(seconds * 1e9), partial(self.come.extend, text.encode("ascii")))

    @property
    def in_waiting(self):
        """The bytes at hand."""
        return len(self.come)

    def read(self, size=1):
        """Let time pass until so many bytes are here."""
        self.clock.run(self.clock.now_ns() + round(self.timeout * 1e9), lambda: len(self.come) >= size)
        data = bytes(self.come[:size])
        del self.come[:size]
        return data

    def write(self, data):
        """Keep the bytes."""
        self.written += data
        return len(data)

    def pulse_dtr(self):
        """Count."""
        self.pulses += 1


def facing_page(session, **settings):
    """Return clock, port, driver and role."""
    clock = VirtualClock()
    port = Page(clock, session)
    driver = BatteryCycler(Connection(device="cycler", clock=clock, clamps=Clamps(), port=port))
    return clock, port, driver, driver.role(wire(**settings))


def read_aloud(title, **settings):
    """Meet the device, keep rows from there, listen to the end of a session, and return what was told."""
    clock, _, driver, _ = facing_page(SESSIONS[title], **settings)
    session = driver._session
    told = session.meet()
    told.record()
    seen = [told.state]
    for seconds, _, _ in SESSIONS[title]:
        clock.wait_until(max(clock.now_ns(), round(seconds * 1e9)))
        session.poll()
        if told.state != seen[-1]:
            seen.append(told.state)
    rows = told.take_rows()
    return told, seen, [rows[place : place + 7] for place in range(0, len(rows), 7)]


def test_host_lines_are_sealed_as_on_the_page():
    """Every line of the host on the page is what the driver would send, but the one that is meant to be wrong."""
    lines = {
        line for session in SESSIONS.values() for _, kind, text in session if kind == ">" for line in text.split("\n")
    }
    asked = [line for line in lines if line.startswith(":")]
    assert len(asked) > 25
    assert [line for line in asked if seal(line.rpartition("*")[0]) != f"{line}\n".encode()] == [":1 ID*0000"]


def test_settings_are_those_of_the_page():
    """Names, units, decimals and defaults of the table, and the CRC of the defaults."""
    rows = re.findall(r"^\| `(\w+)` \| (\S*) ?\| (\d) \| (\S+) \| \S+ \| \S+ \|", PAGE.read_text("utf-8"), re.MULTILINE)
    assert rows == [(item.name, item.unit, str(item.decimals), item.default) for item in SETTINGS]
    assert crc_of(checked("cycler", {})) == "432A"
    assert crc_of(checked("cycler", {"cycles": 1})) == "339A"
    assert checked("cycler", {"tmin": -0.0})["tmin"] == "0.0"


def test_every_error_of_the_page_has_a_sentence():
    """Its word is in it, and what to do next."""
    names = re.findall(
        r"^\| `([A-Z]+)` \| [^|]+ \| [^|]+ \|$", PAGE.read_text("utf-8").partition("### Settings")[0], re.MULTILINE
    )
    errors = {
        name
        for name in names
        if name in {"COMMAND", "FIELD", "RANGE", "BUSY", "STATE", "RUN", "SETTINGS", "ORDER", "LIMIT"}
    }
    assert len(errors) == 9
    for name in errors:
        fault = refusal("cycler", "START", f"{name} word")
        assert "word" in fault.message
        assert "answers ERROR" not in fault.message
        assert fault.hint
    assert "answers ERROR NEW word" in refusal("cycler", "START", "NEW word").message


def test_the_session_of_level_1():
    """Two half-cycles and an end, from the campaign's fields; nothing is written."""
    told, seen, rows = read_aloud(TITLES[0], level="1")
    assert (told.level, seen) == ("1", ["idle", "charge", "discharge", "ended"])
    assert [row[1:] for row in rows] == [
        [3.8, 0.7, 0.0037, 25.1, 1.0, 1.0],
        [4.2, 0.049, 0.0040, 27.0, 1.0, 1.0],
        [3.0, -0.7, 0.0029, 28.0, -1.0, 1.0],
        [2.699, -0.7, 0.0055, 29.0, -1.0, 1.0],
    ]
    assert told.lost == 0


def test_the_session_of_level_2():
    """The same numbers, with the device's time."""
    told, seen, rows = read_aloud(TITLES[1])
    assert (told.level, seen) == ("2.0", ["idle", "charge", "discharge", "ended"])
    assert [row[0] for row in rows] == pytest.approx([11.4, 16.4, 21.4, 26.4])
    assert rows[1][1:] == [4.2, 0.049, 0.0040, 27.0, 1.0, 1.0]
    assert (told.lost, told.damaged, told.number) == (0, 0, 11)


@pytest.mark.parametrize(
    ("title", "states"),
    [(2, ["idle", "charge", "stopped", "charge", "tripped HEARTBEAT"]), (3, ["idle", "charge", "tripped VMAX"])],
)
def test_sessions_that_are_stopped_and_tripped(title, states):
    """States follow the marks; the reason is the device's."""
    told, seen, _ = read_aloud(TITLES[title])
    assert seen == states
    assert (told.lost, told.damaged) == (0, 0)


def test_level_1_gets_one_byte():
    """Identity, preparation and stream write nothing; start writes one byte, and stop pulses DTR."""
    _, port, driver, role = facing_page(SESSIONS[TITLES[0]][:3], level="1")
    driver.identify()
    driver.outlets()
    role.prepare(10)
    role.begin(0.2)
    role.drain()
    assert (role.state(), port.written) == ("idle", b"")
    role.start()
    assert len(port.written) == 1
    with pytest.raises(NoReply, match="was not reset"):
        role.stop()
    assert (len(port.written), port.pulses) == (1, 1)


def test_nothing_is_written_before_the_level_is_known():
    """Silence, noise and torn lines teach nothing."""
    noise = [(2.0, "<", "START ARDU\r\n"), (3.0, "<", ";0.700;0.0037;25.1\r\n"), (4.0, "<", "3.8;;0.1;2\r\nx*0000\r\n")]
    _, port, driver, role = facing_page(noise)
    for call in (driver.identify, role.state, lambda: role.prepare(1), role.stop):
        with pytest.raises(NoReply):
            call()
    assert port.written == b""


def test_a_device_of_level_2_that_was_taken_for_one_of_level_1():
    """A line that lost its seal can look like one of level 1; the next whole one tells the truth."""
    session = SESSIONS[TITLES[1]]
    torn = [(0.5, "<", "3.800;0.700;0.0037;25.1\r\n"), *session]
    clock, port, driver, role = facing_page(torn)
    assert role.level() == "1"
    clock.wait_until(7_000_000_000)
    driver._session.poll()
    assert role.level() == "2.0"
    assert port.written == b""


def test_a_sealed_line_that_means_nothing_is_told():
    """Its seal is right, so that no loss explains it."""
    line = seal("3.800;0.700;25.1;4;11400;C").decode().replace("\n", "\r\n")
    clock, _, driver, _ = facing_page([*SESSIONS[TITLES[1]][:3], (2.0, "<", line)])
    driver._session.meet()
    clock.wait_until(2_000_000_000)
    with pytest.raises(Garbled, match=r"3\.800;0\.700;25\.1;4;11400;C.*means nothing"):
        driver._session.poll()


def test_a_reset_without_its_banner_is_found_by_the_number():
    """Number and time that go back are a device that has started."""
    lines = [
        (float(at), "<", seal(text).decode().replace("\n", "\r\n"))
        for at, text in (
            (1, "TEST ITERATION 1;300;900000"),
            (2, "3.800;0.700;0.0037;25.1;301;905000;C"),
            (3, "IDLE;2;5000"),
        )
    ]
    clock, _, driver, _ = facing_page(lines)
    session = driver._session
    session.meet()
    clock.wait_until(3_000_000_000)
    session.poll()
    assert "restarted" in str(session.fault)
    assert session.told.state == "idle"


def test_device_time_goes_on_after_49_days():
    """The counter of the device begins again with 0, and rows go on."""
    last = 2**32 - 2500
    texts = [f"3.800;0.700;0.0037;25.1;{7 + k};{(last + 5000 * k) % 2**32};C" for k in range(4)]
    lines = [(1.0 + k, "<", seal(text).decode().replace("\n", "\r\n")) for k, text in enumerate(texts)]
    clock, _, driver, _ = facing_page(
        [(0.5, "<", seal(f"TEST ITERATION 1;6;{last - 5000}").decode()[:-1] + "\r\n"), *lines]
    )
    told = driver._session.meet()
    told.zero_ms = last - 5000
    told.record()
    clock.wait_until(5_000_000_000)
    driver._session.poll()
    assert told.take_rows()[::7] == pytest.approx([5.0, 10.0, 15.0, 20.0])
    assert driver._session.fault is None


@pytest.mark.parametrize(
    ("line", "numbers"),
    [
        (b"3.800;-0.700;0.0037;25.1", (3.8, -0.7, 0.0037, 25.1)),
        (b"3.8;0.7;0.00;-25.15", (3.8, 0.7, 0.0, -25.15)),
        (b"3.800;0.700;0.0037", None),
        (b"3.800;0.700;0.0037;25", None),
        (b"3.800;0.7.0;0.0037;25.1", None),
        (b"3.800;1e-1;0.0037;25.1", None),
        (b"3.800; 0.700;0.0037;25.1", None),
        (b".800;0.700;0.0037;25.1", None),
    ],
)
def test_what_is_a_data_line_of_level_1(line, numbers):
    """Four plain numbers, however many decimals they have."""
    assert plain_numbers(line) == numbers


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"level": "3"}, "'level' must be one of 1, 2"),
        ({"beat": "14 s"}, "'beat' must be at least 15"),
        ({"beat": "30.5 s"}, "'beat' must be whole seconds"),
        ({"level": "1", "beat": "60 s"}, "level 1 has no beat"),
        ({"cycles": "10"}, r"level 2\.0 has no cycles"),
        ({"level": "1", "cycles": "0"}, "'cycles' must be at least 1"),
        ({"levle": "1"}, "unknown key 'levle', did you mean 'level'"),
    ],
)
def test_settings_of_a_wire(settings, message):
    """What cannot be is refused, and says what can."""
    with pytest.raises(Refused, match=message):
        facing_page([], **settings)


def test_what_a_cycler_is_not():
    """Another role, a channel, and a bus are refused."""
    driver = facing_page([])[2]
    with pytest.raises(Refused, match="does not fill the role supply"):
        driver.role(Wire(role="supply", instance="", instrument="device"))
    with pytest.raises(Refused, match="no channels"):
        driver.role(Wire(role="cycler", instance="", instrument="device", channel=1))
    with pytest.raises(Refused, match="serial port"):
        BatteryCycler(Connection(device="cycler", clock=VirtualClock(), clamps=Clamps()))
