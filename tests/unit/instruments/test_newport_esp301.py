"""ESP301: the bytes of every operation, replies that are believed, and those that are not."""

from __future__ import annotations

import pytest
from scripted import ScriptedPort, late

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection
from hil.instruments.newport_esp301 import NewportEsp301
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded, Garbled, NoReply, Refused, Rejected
from hil.model.identity import Identity

WIRE = Wire(role="rotation_table", instance="", instrument="table", channel=1, settings={"acceleration": "100"})


class Controller:
    """Writes replies whose status has the bench's time, as a controller that was switched on 1000 s before."""

    def __init__(self, *script, clamps=()) -> None:
        self.clock = VirtualClock()
        self.port = ScriptedPort(self.clock)
        self.port.script = [(request, Reply(self, reply)) for request, reply in (EMPTY, *script)]
        connection = Connection(device="table", clock=self.clock, clamps=Clamps({1: clamps}), port=self.port)
        self.driver = NewportEsp301(connection)
        self.role = self.driver.role(WIRE)

    def status(self, code=0, text="NO ERROR DETECTED", age=0.0):
        """Return what `TB?` answers now."""
        return f"{code}, {round((1000 + self.clock.now() - age) / 4e-4)}, {text}\r\n".encode()


class Reply:
    """A reply that is made when it is asked for, as pairs of delay and bytes."""

    def __init__(self, controller, make) -> None:
        self.controller = controller
        self.make = make

    def __iter__(self):
        made = self.make(self.controller) if callable(self.make) else self.make + self.controller.status()
        return iter(late(0.001, made) if isinstance(made, bytes) else made)


EMPTY = (b"TB?\r", b"")


def ask(command, reply=b""):
    """Return a command followed by the error buffer, and its reply without one."""
    return (command + b"\rTB?\r", reply + b"\r\n" if reply else b"")


def test_identity():
    """Version of the controller, serial number of the stage."""
    controller = Controller(ask(b"VE?", b"ESP301 Version 3.0.1 6/1/99"), ask(b"1ID?", b"URS75BPP, SN1263"))
    assert controller.driver.identify() == Identity(model="ESP301", serial="SN1263", firmware="3.0.1 6/1/99")
    assert controller.port.done


def test_outlets_ask_every_axis():
    """A motor that is on is on; one that is off must stand still."""
    controller = Controller(
        ask(b"1MO?", b"1"), ask(b"2MO?", b"0"), ask(b"2MD?", b"0"), ask(b"3MO?", b"0"), ask(b"3MD?", b"1")
    )
    assert [outlet.on for outlet in controller.driver.outlets()] == [True, True, False]


def test_bytes_of_a_rotation_and_its_end():
    """Checked, set and read back, powered, started; then stopped, proven and without power."""
    at_rest = (ask(b"1TP?", b"10.0"), ask(b"1TP?", b"10.0"))
    controller = Controller(
        ask(b"1SN?", b"7"),
        ask(b"1VU?", b"80"),
        at_rest[0],
        at_rest[1],
        ask(b"1SU?", b"0.0002"),
        ask(b"1TP?", b"10.0"),
        ask(b"1SL?", b"-1000"),
        ask(b"1SR?", b"1000"),
        ask(b"1VA20.0000"),
        ask(b"1VA?", b"20"),
        ask(b"1AC100.0000"),
        ask(b"1AC?", b"1.0E2"),
        ask(b"1AG100.0000"),
        ask(b"1AG?", b"100.0"),
        ask(b"1MO"),
        ask(b"1MO?", b"1"),
        ask(b"1MV-"),
        ask(b"1TP?", b"8"),
        ask(b"1TP?", b"8"),
        ask(b"1TP?", b"3.98"),
        (b"1ST\r", lambda _: b""),
        (b"TB?\r", b""),
        ask(b"1TP?", b"1"),
        ask(b"1TP?", b"1"),
        ask(b"1MF"),
        ask(b"1MO?", b"0"),
    )
    controller.role.set_rate(-20.0)
    controller.role.stop()
    assert controller.port.done
    assert controller.port.longest_wait <= 0.5


def test_a_setting_that_reads_back_otherwise_is_rejected():
    """Nothing is powered."""
    controller = Controller(
        ask(b"1SN?", b"7"),
        ask(b"1VU?", b"80"),
        ask(b"1TP?", b"0"),
        ask(b"1TP?", b"0"),
        ask(b"1SU?", b"0.0002"),
        ask(b"1TP?", b"0"),
        ask(b"1SL?", b"-1000"),
        ask(b"1SR?", b"1000"),
        ask(b"1VA20.0000"),
        ask(b"1VA?", b"10"),
    )
    with pytest.raises(Rejected, match="VA was set to 20 and reads back 10"):
        controller.role.set_rate(20.0)


def test_beyond_the_clamp_no_byte_leaves():
    """Not even a question."""
    clamp = Clamp(output="rotation_table", quantity="rate", unit="deg/s", minimum=-5, maximum=5)
    controller = Controller(clamps=(clamp,))
    with pytest.raises(ClampExceeded):
        controller.role.set_rate(20.0)
    assert controller.port.written == []


@pytest.mark.parametrize(
    ("reply", "error", "match"),
    [
        (lambda c: b"fast\r\n" + c.status(), Garbled, "expected a number, got 'fast'"),
        (lambda c: b"nan\r\n" + c.status(), Garbled, "expected a number"),
        (lambda c: b"\xff12\r\n" + c.status(), Garbled, "expected a number"),
        (lambda _: b"12.5\r\n12.5\r\n", Garbled, "expected code, time and text"),
        (lambda _: b"12.5\r\n", NoReply, "asked `TB\\?`, nothing came"),
        (lambda _: b"12.5", NoReply, "only b'12.5' came"),
        (lambda c: c.status(), Garbled, "a reply before that of `TB\\?`"),
        (lambda c: b"12.5\r\n" + c.status(age=0.4), Garbled, "its clock went -0.399 s"),
        (lambda c: b"12.5\r\n" + c.status(age=-5), Garbled, "its clock went 5"),
        (lambda c: b"12.5\r\n" + c.status(age=1000), Garbled, "its clock went -"),
    ],
)
def test_replies_that_are_not_believed(reply, error, match):
    """Asked three times, and the first reason is told: nonsense, a stray line, half a line, a stale time, a restart."""
    controller = Controller(*[(b"1TP?\rTB?\r", reply)] * 3)
    with pytest.raises(error, match=match):
        controller.role.angle()
    assert controller.port.done


def test_a_good_reply_after_a_bad_one_counts():
    """A question only reads, so it is asked again; what came late is thrown away."""
    controller = Controller(
        (b"1TP?\rTB?\r", lambda c: ((0.001, b"1"), (0.51, b"2.0\r\n" + c.status()))),
        ask(b"1TP?", b"13.0"),
        ask(b"1SU?", b"0.0002"),
    )
    assert controller.role.angle().value == 13.0
    assert controller.driver._session.discarded > 5


def test_what_waits_before_a_question_is_told():
    """Nobody owes the host a byte that it did not ask for."""
    controller = Controller(ask(b"1TP?", b"1"), ask(b"1SU?", b"0.0002"))
    controller.role.angle()
    controller.port.come(b"99.0\r\n")
    with pytest.raises(Garbled, match="arrived unsolicited"):
        controller.role.angle()


def test_errors_of_the_controller_are_told_with_code_and_text():
    """All entries are taken out, those of the axis too."""
    controller = Controller(
        (b"1TP?\rTB?\r", lambda c: b"1\r\n" + c.status(103, "FOLLOWING ERROR THRESHOLD EXCEEDED", age=3)),
        (b"TB?\r", lambda c: c.status(6, "COMMAND DOES NOT EXIST")),
        EMPTY,
    )
    with pytest.raises(Rejected, match="103 FOLLOWING ERROR THRESHOLD EXCEEDED; 6 COMMAND DOES NOT EXIST"):
        controller.role.angle()
    assert controller.port.done


def test_a_dead_port_is_no_reply():
    """What the operating system says becomes a fault of the device."""
    controller = Controller()
    controller.port.script = [(b"TB?\r", OSError("gone"))] * 3
    with pytest.raises(NoReply, match="the port failed at `TB\\?`: gone"):
        controller.role.angle()


def test_a_port_is_needed():
    """A controller on a bus does not exist."""
    with pytest.raises(Refused, match="by a port"):
        NewportEsp301(Connection(device="table", clock=VirtualClock(), clamps=Clamps()))
