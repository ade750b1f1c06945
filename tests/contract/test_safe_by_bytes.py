"""What drivers say about bytes that make an output safe, against the peers: sent raw, whatever came before."""

from __future__ import annotations

from importlib.metadata import entry_points

import pytest
from by_bytes import BY_BYTES, SCPI, rig

from hil.instruments.registry import DRIVERS, ROLES
from hil.instruments.roles import SafeByBytes
from hil.model.bench import Proof, Wire
from hil.model.errors import DeviceFault, Refused

KINDS = pytest.mark.parametrize("name", BY_BYTES)


@KINDS
def test_what_is_on_goes_off_and_is_proven(name):
    """Nothing but bytes, after a whole session of the driver; nothing else of the instrument is on either."""
    kind = BY_BYTES[name]
    with rig(kind) as found:
        kind.drive(found)
        assert found.on()
        assert found.make_safe(found.code(kind.proof))
        assert not found.on()


@KINDS
def test_who_it_is_can_be_asked(name):
    """It replies at any time, so that another one is told from it; some protocols have no such question."""
    kind = BY_BYTES[name]
    with rig(kind) as found:
        found.driver.identify()
        code = found.code(kind.proof)
        assert (code.who is None) == (name == "omron-e5cc")
        if code.who is not None:
            assert found.exchange(code.who)
            kind.drive(found)
            assert found.exchange(code.who)


@KINDS
def test_what_is_on_is_not_proven_off(name):
    """The proof alone changes nothing and does not hold, with the bench file's bounds and without."""
    kind = BY_BYTES[name]
    with rig(kind) as found:
        kind.drive(found)
        before = found.on()
        assert not found.proven(found.code(kind.proof))
        assert not found.proven(found.code())
        assert found.on() == before


@KINDS
def test_what_is_off_stays_off_and_the_driver_goes_on(name):
    """A drill leaves nothing behind: no byte that nobody asked for, and no error that the driver would be told of."""
    kind = BY_BYTES[name]
    with rig(kind) as found:
        found.driver.outlets()
        for _ in range(2):
            assert found.make_safe(found.code(kind.proof))
            assert not found.on()
        kind.drive(found)
        assert found.on()
        assert found.make_safe(found.code(kind.proof))
        assert not any(outlet.on for outlet in found.driver.outlets())
        assert name == "cycler" or found.line.read(4096, 0.3) == b""


@KINDS
def test_a_dead_instrument_proves_nothing_in_little_time(name):
    """Nothing comes; each pass is over soon, for others wait for it."""
    kind = BY_BYTES[name]
    with rig(kind) as found:
        if name == "cycler":
            found.driver.identify()
        code = found.code(kind.proof)
        found.line.write = lambda _: None
        begun = found.clock.now()
        found.switch_off(code)
        assert not found.proven(code)
        assert found.clock.now() - begun < 3.0


@KINDS
def test_driver_and_bytes_wait_as_long_as_the_connection_says(name):
    """One limit for both: what the driver accepts, the guardian accepts."""
    kind = BY_BYTES[name]
    with rig(kind, timeout=0.2) as found:
        found.driver.identify()
        code = found.code(kind.proof)
        lines_s = 0.5 if name == "cycler" else 0.0  # a reply waits for the lines before it
        limits = {each.within_s for each in (*code.resync, *code.off, *code.proof) if each.expect}
        many_s = {0.2 + 0.3} if name == "newport-esp301" else set()  # eighteen questions at once
        assert limits == {0.2 + lines_s} | many_s
        found.line.write = lambda _: None
        begun = found.clock.now()
        with pytest.raises(DeviceFault):
            found.driver.identify()
        assert found.clock.now() - begun < 3 * (0.3 + lines_s)


@KINDS
def test_another_state_is_refused(name):
    """It names the one that there is."""
    with rig(BY_BYTES[name]) as found, pytest.raises(Refused, match="has no state 'asleep'") as refused:
        found.role.safe_bytes("asleep")
    assert BY_BYTES[name].state in refused.value.hint


@KINDS
def test_a_proof_that_reads_something_else_is_left_out(name):
    """Another output's quantity cannot be asked for here."""
    kind = BY_BYTES[name]
    other = Proof(output="supply.other", quantity="current", unit="A", minimum=1.0, maximum=2.0)
    with rig(kind) as found:
        if name == "cycler":
            found.driver.identify()
        assert found.code(other) == found.code()


@pytest.mark.parametrize("name", [*SCPI, "korad-ka3005p"])
def test_a_supply_that_refuses_is_found_out(name):
    """By its own word; where that is a lie, by the current, which is asked for if the bench file proves it so."""
    kind = BY_BYTES[name]
    with rig(kind, faults=[{"kind": "refuse-off"}]) as found:
        _switch_on(found)
        assert not found.make_safe(found.code())
        assert found.on()
    with rig(kind, faults=[{"kind": "refuse-off", "says": "off"}]) as found:
        _switch_on(found)
        assert not found.make_safe(found.code(kind.proof))
        assert found.make_safe(found.code())
        assert found.on()


def _switch_on(found):
    found.role.configure(4.2, 0.7)
    found.role.enable()


@pytest.mark.parametrize("name", [*SCPI, "korad-ka3005p"])
def test_a_voltage_can_be_asked_for_too(name):
    """It is the quantity of the bench file's proof; what is not within its bounds is not proven."""
    proof = Proof(output="supply.coil", quantity="voltage", unit="V", minimum=-0.2, maximum=0.2)
    with rig(BY_BYTES[name]) as found:
        _switch_on(found)
        asked = found.code(proof).proof
        assert asked[-1].between == (-0.2, 0.2)
        assert not found.exchange(asked[-1])
        assert found.make_safe(found.code(proof))


def test_a_welded_contact_is_beyond_bytes():
    """The board tells of its coils: it takes the command, proves it, and the contact is closed."""
    with rig(BY_BYTES["waveshare-relay"], faults=[{"kind": "welded", "contact": "4"}]) as found:
        found.role.close("lamp")
        assert found.make_safe(found.code())
        assert found.on() == {4}


def test_relays_of_other_wires_are_released_too():
    """As by the driver; a board on which one relay is closed proves nothing."""
    with rig(BY_BYTES["waveshare-relay"]) as found:
        found.role.close("valve")
        assert not found.proven(found.code())
        assert found.make_safe(found.code())


def test_a_controller_that_does_not_stop_is_cut_from_power():
    """The stop is ignored; without power the table runs out."""
    kind = BY_BYTES["newport-esp301"]
    with rig(kind, faults=[{"kind": "no-stop", "from": "1 s"}]) as found:
        found.role.set_rate(25.0)
        assert found.make_safe(found.code(kind.proof))
        assert not found.on()


@pytest.mark.parametrize("rate", [0.2, 25.0])
def test_a_table_that_turns_without_power_is_seen_by_its_encoder(rate):
    """The controller says that it commands nothing and that the motor is off; two angles differ."""
    kind = BY_BYTES["newport-esp301"]
    with rig(kind, faults=[{"kind": "no-stop", "power": "stays"}]) as found:
        found.role.set_rate(rate)
        assert not found.make_safe(found.code(kind.proof))
        assert found.on() == {"turning"}


def test_a_relay_of_a_cycler_that_sticks_is_seen_by_its_current():
    """The device says that both are open, and measures a current."""
    kind = BY_BYTES["cycler"]
    with rig(kind, faults=[{"kind": "stuck-relay", "relay": "charge", "from": "20 s"}]) as found:
        found.plant.lines = 1000
        found.role.prepare(2)
        found.role.start()
        found.clock.sleep(30)
        assert found.on() == {"charge"}
        assert not found.make_safe(found.code(kind.proof))
        assert found.make_safe(found.code())
        assert found.on() == {"charge"}


def test_a_cycler_in_a_rest_is_not_stopped_yet():
    """Both relays are open, and it would go on by itself."""
    with rig(BY_BYTES["cycler"]) as found:
        found.plant.lines = 2
        found.role.prepare(2, rest=600.0)
        found.role.start()
        for _ in range(6):
            found.clock.sleep(10)
            assert found.role.state() in {"charge", "rest"}
        assert found.role.state() == "rest"
        assert not found.on()
        assert not found.proven(found.code())
        assert found.make_safe(found.code())
        found.clock.sleep(6)
        assert found.role.state() == "stopped"


def test_no_byte_goes_to_a_cycler_of_level_1_or_of_no_level():
    """Any byte starts the test of a level 1 device that waits; which level it is a line must have told."""
    with rig(BY_BYTES["cycler"], truth={"level": "1"}) as found:
        with pytest.raises(Refused, match="has not shown its level yet"):
            found.code()
        found.driver.identify()
        with pytest.raises(Refused, match="speaks level 1: no byte stops it") as refused:
            found.code()
        assert "cut paths" in refused.value.hint
        assert found.sent == []


def test_every_driver_with_a_safe_state_and_a_port_is_tested_here():
    """Who fills a role that safe-off may name says how bytes lead there; sensors on a bus have no stream of bytes."""
    streams = {point.name for point in entry_points(group="hil.peers") if point.load().link == "serial"}
    due = {name for name in DRIVERS if any(ROLES[role].states for role in DRIVERS[name].roles)}
    assert due & streams == set(BY_BYTES)
    for name, kind in BY_BYTES.items():
        with rig(kind) as found:
            assert isinstance(found.role, SafeByBytes), name
            assert set(ROLES[kind.wire.role].states) == {kind.state}


def test_another_unit_is_sent_other_frames():
    """Address and checksum are those of the board."""
    kind = BY_BYTES["waveshare-relay"]
    with rig(kind) as found:
        assert found.code().off[0].send == bytes.fromhex("01 0F 00 00 00 08 01 00 FE 95")
        assert found.code().proof[0].send == bytes.fromhex("01 01 00 00 00 08 3D CC")


def test_another_channel_is_sent_other_commands():
    """What the wire names is what goes off."""
    with rig(BY_BYTES["keysight-e36300"]) as found:
        role = found.driver.role(Wire(role="supply", instance="b", instrument="device", channel=3))
        assert role.safe_bytes("off").off[0].send == b"OUTP OFF,(@3)\n"
        assert found.code().off[0].send == b"OUTP OFF,(@2)\n"
