"""The driver of the E5CC against its peer and the chamber; the peer against published frames."""

from __future__ import annotations

import math

import pytest
import sweeps
from by_bytes import BY_BYTES, rig
from chamber_bench import CLAMPS, THERMAL, chamber
from facing import facing
from talking import Talk

from hil.instruments.driver import Outlet
from hil.instruments.omron_e5cc import OmronE5cc
from hil.model.bench import Wire
from hil.model.errors import ClampExceeded, HilError, Refused, Rejected
from hil.model.identity import Identity
from hil.simulation.peers.modbus_rtu import seal
from hil.simulation.peers.omron_e5cc import MODEL

CONNECTS = {"sensor": "chamber.plate", "drive": "chamber.tec", "ambient": "chamber.ambient"}


def controller(*, faults=(), plant=None, clamps=CLAMPS, **truth):
    """Return a driver facing a controller on a 9600 baud line, with the chamber behind it."""
    return facing(
        MODEL,
        driver=OmronE5cc,
        truth={"sensor_noise": "0", **truth},
        faults=faults,
        clamps=clamps,
        connects=CONNECTS,
        plants={"chamber": plant or chamber()},
        baud=9600,
    )


@pytest.mark.parametrize("left", [{}, {"mode": "operating"}, {"communications_writing": True}])
def test_the_whole_role_however_it_was_left(left):
    """Held below zero, it gets there, tells temperature, setpoint and power, and stops."""
    plant = chamber()
    with controller(plant=plant, **left) as (driver, clock):
        assert driver.identify() == Identity()
        assert driver.outlets() == (Outlet(0, on=left.get("mode") == "operating"),)
        thermal = driver.role(THERMAL)
        thermal.hold(-7.3)
        clock.sleep(900)
        assert thermal.setpoint().value == -7.3
        assert thermal.temperature().value == pytest.approx(plant.observe("plate"), abs=0.06)
        assert thermal.temperature().value == pytest.approx(-7.3, abs=0.11)
        assert -80 < thermal.output().value < -20
        assert driver.outlets() == (Outlet(0, on=True),)
        thermal.standby()
        assert driver.outlets() == (Outlet(0, on=False),)
        assert thermal.output().value == 0
        assert plant.inputs["tec"] == 0


def test_a_setpoint_is_written_only_where_it_differs():
    """A hundred times the same setpoint is one write of the memory."""
    with rig(BY_BYTES["omron-e5cc"]) as found:
        for _ in range(100):
            found.role.hold(30.0)
        assert found.peer.memory_writes == 1
        found.role.hold(30.1)
        assert found.peer.memory_writes == 2


def test_what_it_refuses_is_rejected():
    """Beyond its own limits, and beyond the clamp, of which no byte leaves."""
    with controller(setpoint_high="40", clamps={}) as (driver, _), pytest.raises(Rejected, match="exception 3"):
        driver.role(THERMAL).hold(45.0)
    with controller() as (driver, clock):
        with pytest.raises(ClampExceeded):
            driver.role(THERMAL).hold(50.0)
        assert clock.now() == 0.0


def test_decimals_are_compared_before_a_temperature_is_believed():
    """Everything would be wrong by ten."""
    with controller(decimals="0") as (driver, _):
        for use in (lambda role: role.temperature(), lambda role: role.hold(25.0)):
            with pytest.raises(Rejected, match="the display has 0 decimals, the wiring says 1"):
                use(driver.role(THERMAL))
        wire = Wire(role="thermal", instance="", instrument="device", settings={"decimals": "0"})
        assert driver.role(wire).temperature().value == 22


def test_a_broken_sensor_is_not_a_number():
    """The input error of the status; the output is off."""
    with controller(faults=[{"kind": "sensor-open", "from": "5 s"}]) as (driver, clock):
        thermal = driver.role(THERMAL)
        thermal.hold(30.0)
        assert not math.isnan(thermal.temperature().value)
        clock.sleep(6)
        assert math.isnan(thermal.temperature().value)
        assert thermal.output().value == 0


def test_a_loop_that_somebody_took_by_hand_is_taken_back():
    """STOP alone would leave its output on; driver and bytes both end it, and RUN regulates again."""
    kind = BY_BYTES["omron-e5cc"]
    by_hand, stop = (seal(bytes.fromhex(f"01 06 00 00 {command}")) for command in ("09 01", "01 01"))
    for ends in (lambda found: found.role.standby(), lambda found: found.make_safe(found.code())):
        with rig(kind) as found:
            kind.drive(found)
            for command in (by_hand, stop):
                found.line.write(command)
                found.line.read(64, 0.2)
            found.clock.sleep(3)
            assert found.role.output().value > 0
            assert not found.proven(found.code())
            ends(found)
            assert found.proven(found.code())
            assert not found.on()
            found.role.hold(35.0)
            found.clock.sleep(3)
            assert found.role.output().value > 0


def test_wires_that_it_cannot_fill_are_refused():
    """Another role, and decimals that no display shows."""
    with controller() as (driver, _):
        for wire, match in (
            (Wire(role="supply", instance="a", instrument="device"), "does not fill the role supply"),
            (Wire(role="thermal", instance="", instrument="device", settings={"decimals": "3"}), "'decimals'"),
        ):
            with pytest.raises(Refused, match=match):
                driver.role(wire)


FAULTS = {
    "dead": {"kind": "dead"},
    "late": {"kind": "late", "by": "300 ms"},
    "garbled at times": {"kind": "garbled", "share": "0.05"},
    "partial": {"kind": "partial", "bytes": "4"},
    "chatty": {"kind": "chatty", "every": "70 ms", "text": "\x01\x03\x04"},
    "runaway": {"kind": "runaway"},
}


@pytest.mark.parametrize("start", sweeps.sample(["0 s", "2 s", "4 s", "4.03 s"], 2))
@pytest.mark.parametrize("name", FAULTS)
def test_what_is_called_safe_gives_nothing(name, start):
    """Whatever goes wrong and when: standby that returned means 0 %, but for an amplifier that runs away."""
    plant = chamber()
    with controller(faults=[{**FAULTS[name], "from": start, "until": "60 s"}], plant=plant) as (driver, clock):
        thermal, safe = driver.role(THERMAL), False
        for act in (lambda: thermal.hold(35.0), lambda: clock.wait_until(4_000_000_000), thermal.standby):
            try:
                act()
            except HilError:
                safe = False
            else:
                safe = act == thermal.standby
        assert not safe or plant.inputs["tec"] == 0 or name == "runaway"


def frame(text):
    """Return the bytes of a frame written in hexadecimal."""
    return bytes.fromhex(text)


def test_published_frames():
    """Of H175 and H186: alarm limits of 1000 and -1000, in two bytes, as their manuals print request and reply."""
    peer = Talk(MODEL, truth={"communications_writing": True}, baud=9600)
    request = frame("01 10 21 05 00 02 04 03 E8 FC 18 66 BB")
    assert peer.bytes(request) == frame("01 10 21 05 00 02 5B F5")
    assert peer.bytes(seal(frame("01 03 21 05 00 02"))) == seal(frame("01 03 04 03 E8 FC 18"))


@pytest.mark.parametrize(
    ("request_body", "reply_body"),
    [
        ("01 03 04 0C 00 02", "01 03 04 03 00 00 00"),  # stopped, writing on
        ("01 03 20 00 00 01", "01 03 02 00 DC"),  # 22.0
        ("01 03 00 00 00 02", "01 03 04 00 00 00 DC"),
        ("01 06 00 00 01 00", "01 06 00 00 01 00"),  # RUN
        ("01 06 21 03 00 FA", "01 06 21 03 00 FA"),
        ("01 06 21 03 03 E8", "01 86 03"),  # 100.0, beyond its limit
        ("01 06 20 00 00 00", "01 86 02"),  # nobody writes a process value
        ("01 06 00 00 0B 00", "01 86 03"),  # initialisation would end the line's protocol
        ("02 03 20 00 00 01", ""),
    ],
)
def test_request_and_reply(request_body, reply_body):
    """By the tables of the manual."""
    peer = Talk(MODEL, truth={"communications_writing": True, "sensor_noise": "0"}, baud=9600)
    peer.bytes(b"", 0.2)
    reply = peer.bytes(seal(frame(request_body)))
    assert reply == (seal(frame(reply_body)) if reply_body else b"")


def test_nothing_is_written_before_it_is_let():
    """All writes but the one that lets them are refused with exception 4."""
    peer = Talk(MODEL, baud=9600)
    for body in ("01 06 21 03 00 FA", "01 06 00 00 01 00", "01 10 21 05 00 01 02 03 E8"):
        reply = peer.bytes(seal(frame(body)))
        assert reply == seal(bytes((1, frame(body)[1] | 0x80, 4)))
    assert peer.bytes(seal(frame("01 06 00 00 00 01"))) == seal(frame("01 06 00 00 00 01"))
    assert peer.bytes(seal(frame("01 06 21 03 00 FA"))) == seal(frame("01 06 21 03 00 FA"))


def test_it_goes_on_after_a_restore():
    """Settings, status, the memory's writes and the regulation come back."""
    first, second = (Talk(MODEL, truth={"communications_writing": True}, baud=9600) for _ in range(2))
    for body in ("01 06 21 03 00 FA", "01 06 00 00 01 00"):
        first.bytes(seal(frame(body)))
    first.bytes(b"", 1.0)
    second.clock.wait_until(first.clock.now_ns())
    second.peer.restore(first.peer.state())
    assert second.peer.state() == first.peer.state()
    assert second.bytes(seal(frame("01 03 20 04 00 02"))) == first.bytes(seal(frame("01 03 20 04 00 02")))
