"""What goes wrong with simulated instruments, as the bench file asks for it."""

from __future__ import annotations

import json

import pytest
from twin import Twin

IDENTITY = b"Keysight Technologies,E36312A,SIM-MY00000001,2.1.0-1.0.4-1.12\n"


def supply(**fault):
    """Return a twin whose supply has one fault."""
    return Twin(faults={"psu": [{key.rstrip("_"): value for key, value in fault.items()}]})


def test_dead_supply_neither_answers_nor_acts():
    """From its instant on nothing comes, and nothing is done, until it is over."""
    twin = supply(kind="dead", from_="1 s", until="2 s")
    assert twin.exchange("psu", b"*IDN?\n") == IDENTITY
    twin.clock.wait_until(1_000_000_000)
    assert twin.exchange("psu", b"VOLT 5,(@2);*IDN?\n") == b""
    twin.clock.wait_until(2_000_000_000)
    assert twin.scpi("VOLT? (@2)") == "+0.00000000E+00"


def test_late_supply_answers_in_the_end():
    """The answer comes whole, but later."""
    twin = supply(kind="late", by="700 ms")
    assert twin.exchange("psu", b"*IDN?\n", 0.69) == b""
    assert twin.exchange("psu", b"", 0.1) == IDENTITY


def test_garbled_answers_differ_in_single_bits_and_repeat():
    """Every byte has one wrong bit; two runs are wrong in the same way; a share spares some."""
    spoiled = [supply(kind="garbled").exchange("psu", b"*IDN?\n") for _ in range(2)]
    assert spoiled[0] == spoiled[1]
    assert len(spoiled[0]) == len(IDENTITY)
    assert all((a ^ b).bit_count() == 1 for a, b in zip(spoiled[0], IDENTITY, strict=True))
    some = supply(kind="garbled", share="0.2").exchange("psu", b"*IDN?\n")
    assert 0 < sum(a != b for a, b in zip(some, IDENTITY, strict=True)) < 30


def test_partial_answer_ends_early():
    """Only the first bytes come through."""
    assert supply(kind="partial", bytes="7").exchange("psu", b"*IDN?\n") == IDENTITY[:7]
    assert supply(kind="partial", bytes="0").exchange("psu", b"*IDN?\n") == b""


def test_chatty_supply_speaks_unasked():
    """Bytes come at their own period, from first to last instant, among the answers."""
    twin = supply(kind="chatty", from_="1 s", until="2 s", every="300 ms", text="!")
    assert twin.exchange("psu", b"", 1.25) == b"!"
    assert twin.exchange("psu", b"*OPC?\n", 0.7) == b"1\n!!!"
    assert twin.exchange("psu", b"", 2.0) == b""


def test_chatty_goes_on_after_a_restore():
    """A restored world chats at the same instants."""
    twin = supply(kind="chatty", every="300 ms", text="!")
    twin.exchange("psu", b"", 1.0)
    other = supply(kind="chatty", every="300 ms", text="!")
    other.exchange("psu", b"", 1.0)
    other.world.restore(json.loads(json.dumps(twin.world.state())))
    assert other.exchange("psu", b"", 1.0) == twin.exchange("psu", b"", 1.0) == b"!!!"


def test_other_identity():
    """Another article answers at this port; it is as simulated as before, whatever the bench file has it say."""
    assert supply(kind="identity", value="KORADKA3005PV2.0").scpi("*IDN?") == "KORADKA3005PV2.0 SIMULATED"
    assert supply(kind="identity", value="A,B,C1,D").scpi("*IDN?") == "A,B,SIM-C1,D"


@pytest.mark.parametrize(("says", "answer"), [("on", "1"), ("off", "0")])
def test_supply_that_refuses_to_switch_off(says, answer):
    """The output stays on whatever it says, after OUTP OFF and after *RST, until the fault is over."""
    twin = supply(kind="refuse-off", channel="2", says=says, from_="1 s", until="3 s")
    twin.coil.command(board="y_plus")
    twin.scpi("VOLT 5,(@2);CURR 0.016,(@2);:OUTP ON,(@2)")
    twin.scpi("OUTP OFF,(@2)")
    assert twin.coil.observe("current") == pytest.approx(0.0, abs=1e-9)
    twin.scpi("OUTP ON,(@2)")
    twin.clock.wait_until(1_500_000_000)
    twin.scpi("OUTP OFF,(@2)")
    assert twin.scpi("OUTP? (@2)") == answer
    assert float(twin.scpi("MEAS:CURR? (@2)")) == pytest.approx(0.016, abs=1e-4)
    twin.clock.wait_until(3_000_000_000)
    twin.scpi("OUTP OFF,(@2)")
    assert twin.scpi("OUTP? (@2)") == "0"
    assert twin.coil.observe("current") == pytest.approx(0.0, abs=1e-9)


def test_refusal_of_one_channel_spares_the_others():
    """Channel 2 does not switch off, channel 3 does."""
    twin = supply(kind="refuse-off", channel="2")
    twin.scpi("OUTP ON,(@2,3)")
    twin.scpi("OUTP OFF,(@2,3)")
    assert twin.scpi("OUTP? (@2,3)") == "1,0"


def test_contact_that_welds_while_closed():
    """It opens no more though it reads released; one that was open when it welded closes first."""
    twin = Twin(faults={"relays": [{"kind": "welded", "contact": "1", "from": "1 s", "until": "2 s"}]})
    twin.modbus("01 05 00 00 FF 00 8C 3A")
    twin.clock.wait_until(1_000_000_000)
    assert twin.modbus("01 05 00 00 00 00 CD CA") == "01 05 00 00 00 00 CD CA"
    assert twin.modbus("01 01 00 00 00 08 3D CC") == "01 01 01 00 51 88"
    assert twin.coil.inputs["contact_a"] is True
    twin.clock.wait_until(2_000_000_000)
    assert twin.coil.inputs["contact_a"] is False


def magnetometer(**fault):
    """Return a twin whose magnetometer has one fault from 1 s on, awake and at rest."""
    twin = Twin(faults={"mag": [{"from": "1 s", **fault}]})
    twin.wake_sensor()
    twin.clock.wait_until(500_000_000)
    return twin


def test_dead_magnetometer_does_not_acknowledge():
    """Reads and writes are refused."""
    twin = magnetometer(kind="dead")
    assert twin.register(0x0F) == 0x3D
    twin.clock.sleep(1)
    for action in (lambda: twin.register(0x0F), lambda: twin.write(0x20, 0)):
        with pytest.raises(OSError, match="Remote I/O error"):
            action()


def test_stuck_magnetometer_repeats_one_sample():
    """New data is told, but it is the same for ever; without the fault it moves."""
    twin = magnetometer(kind="stuck", until="5 s")
    assert twin.field() != (twin.clock.sleep(0.1), twin.field())[1]
    twin.clock.wait_until(1_500_000_000)
    first = twin.field()
    twin.coil.command(board="y_plus", supply_voltage=5.0, supply_current=0.016)
    twin.clock.sleep(3)
    assert twin.register(0x27) & 0x0F == 0x0F
    assert twin.field() == first
    twin.clock.sleep(1)
    assert twin.field() != first


def test_saturated_magnetometer_reads_full_scale():
    """A magnet nearby: every axis at its end, in the largest range too."""
    twin = magnetometer(kind="saturated")
    twin.write(0x21, 0x60)
    twin.clock.sleep(1)
    assert twin.field() == (32767,) * 3


def test_garbled_and_strange_magnetometer():
    """Bits flip on the bus; or another chip sits at the address."""
    twin = magnetometer(kind="garbled")
    twin.clock.sleep(1)
    assert (twin.register(0x0F) ^ 0x3D).bit_count() == 1
    twin = magnetometer(kind="identity", value="0x3C")
    twin.clock.sleep(1)
    assert twin.register(0x0F) == 0x3C
