"""Keysight E36300: bytes of the programming guide, clamps before bytes, settings read back."""

from __future__ import annotations

import math

import pytest
from scripted import ScriptedPort

from hil.clock.virtual import VirtualClock
from hil.instruments.driver import Clamps, Connection, Outlet
from hil.instruments.keysight_e36300 import KeysightE36300
from hil.model.bench import Clamp, Wire
from hil.model.errors import ClampExceeded, Refused, Rejected
from hil.model.identity import Identity

IDN = (b"*IDN?\n", b"Keysight Technologies,E36312A,MY59002391,2.1.0-1.0.4-1.12\n")
NONE = (b"SYST:ERR?\n", b'+0,"No error"\n')
SOUND, TRIPPED = (b"VOLT:PROT:TRIP? (@2)\n", b"0\n"), (b"VOLT:PROT:TRIP? (@2)\n", b"1\n")


def clamp(quantity, unit, maximum):
    """Return a clamp from 0."""
    return Clamp(output="supply.coil", quantity=quantity, unit=unit, minimum=0.0, maximum=maximum)


def framed(request, reply):
    """Return question and reply as they go over the line: together with the identification."""
    if b"?" not in request or request == IDN[0]:
        return request, reply
    return b"*IDN?;:" + request, reply and IDN[1].strip() + b";" + reply


def driver(*script, clamps=()):
    """Return a driver on a port that plays this script, and the port."""
    port = ScriptedPort(VirtualClock(), [framed(*pair) for pair in script])
    connection = Connection(device="psu1", clock=port.clock, clamps=Clamps({2: tuple(clamps)}), port=port)
    return KeysightE36300(connection), port


def coil(**settings):
    """Return the wire of the coil's supply, channel 2."""
    return Wire(role="supply", instance="coil", instrument="psu1", channel=2, settings=settings)


def test_the_constructor_sends_nothing():
    """A driver that was only made has not touched the bench."""
    _, port = driver()
    assert port.written == []


def test_it_says_who_it_is():
    """The four fields of *IDN? become the identity."""
    psu, _ = driver(IDN)
    assert psu.identify() == Identity(
        manufacturer="Keysight Technologies", model="E36312A", serial="MY59002391", firmware="2.1.0-1.0.4-1.12"
    )


def test_outlets_are_all_three_channels():
    """Arm sees also the outputs that no wire names."""
    psu, _ = driver((b"OUTP? (@1)\n", b"0\n"), (b"OUTP? (@2)\n", b"1\n"), (b"OUTP? (@3)\n", b"0\n"))
    assert psu.outlets() == (Outlet(1, on=False), Outlet(2, on=True), Outlet(3, on=False))


def test_configure_sets_protection_then_current_then_voltage_and_reads_back():
    """The order never lets a voltage stand over an old current limit or without its protection."""
    psu, port = driver(
        NONE,
        (b"VOLT:PROT 5.5000,(@2)\n", b""),
        NONE,
        (b"VOLT:PROT? (@2)\n", b"+5.50000000E+00\n"),
        (b"CURR 0.7000,(@2)\n", b""),
        NONE,
        (b"CURR? (@2)\n", b"+6.99900000E-01\n"),
        (b"VOLT 4.2000,(@2)\n", b""),
        NONE,
        (b"VOLT? (@2)\n", b"+4.20000000E+00\n"),
    )
    psu.role(coil(over_voltage="5.5")).configure(4.2, 0.7)
    assert port.done


@pytest.mark.parametrize(("voltage", "current"), [(5.1, 0.1), (4.0, 0.6), (-0.1, 0.1), (5.00006, 0.1)])
def test_what_the_clamps_do_not_permit_sends_no_byte(voltage, current):
    """One setting beyond its clamp keeps the other back too."""
    psu, port = driver(clamps=[clamp("voltage", "V", 5.0), clamp("current", "A", 0.5)])
    with pytest.raises(ClampExceeded, match="supply.coil"):
        psu.role(coil()).configure(voltage, current)
    assert port.written == []


def test_the_clamps_judge_the_number_that_is_sent():
    """Binary dust beyond a clamp is rounded away before it is judged, because it is not sent either."""
    psu, port = driver(
        NONE,
        (b"CURR 0.3000,(@2)\n", b""),
        NONE,
        (b"CURR? (@2)\n", b"+3.0E-01\n"),
        (b"VOLT 5.0000,(@2)\n", b""),
        NONE,
        (b"VOLT? (@2)\n", b"+5.0\n"),
        clamps=[clamp("voltage", "V", 5.0), clamp("current", "A", 0.3)],
    )
    psu.role(coil()).configure(5.0, 0.1 + 0.2)
    assert port.done


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_sends_no_byte(number):
    """NaN and infinity are refused even where no clamp is set."""
    psu, port = driver()
    with pytest.raises(Refused, match="is not a number to set"):
        psu.role(coil()).configure(number, 0.1)
    assert port.written == []


def test_a_voltage_above_its_own_protection_is_refused():
    """Such a setting could only trip."""
    psu, port = driver()
    with pytest.raises(Refused, match="6 V is above its over-voltage protection of 5.5 V"):
        psu.role(coil(over_voltage="5.5 V")).configure(6.0, 0.1)
    assert port.written == []


def test_a_protection_level_beyond_its_clamp_is_not_sent():
    """The level of the protection is a setting like any other."""
    psu, port = driver(clamps=[clamp("over_voltage", "V", 5.0)])
    with pytest.raises(ClampExceeded, match="over_voltage 5.5 V"):
        psu.role(coil(over_voltage="5.5")).configure(4.0, 0.1)
    assert port.written == []


def test_a_setting_that_reads_back_otherwise_is_rejected():
    """An instrument that limits a setting without an error is found out."""
    psu, _ = driver(NONE, (b"CURR 2.0000,(@2)\n", b""), NONE, (b"CURR? (@2)\n", b"+1.0\n"))
    with pytest.raises(Rejected, match="current was set to 2.0000 and reads back 1"):
        psu.role(coil()).configure(4.2, 2.0)


def test_a_setting_that_reads_back_as_no_number_is_rejected():
    """NaN is not near anything."""
    psu, _ = driver(NONE, (b"CURR 2.0000,(@2)\n", b""), NONE, (b"CURR? (@2)\n", b"9.91E37\n"))
    with pytest.raises(Rejected, match="reads back nan"):
        psu.role(coil()).configure(4.2, 2.0)


def test_an_error_of_the_instrument_ends_the_configuration():
    """After a rejected setting nothing else is set."""
    psu, port = driver(NONE, (b"CURR 9.0000,(@2)\n", b""), (b"SYST:ERR?\n", b'-222,"Data out of range"\n'), NONE)
    with pytest.raises(Rejected, match="Data out of range"):
        psu.role(coil()).configure(4.2, 9.0)
    assert port.done


def test_enable_switches_on_and_reads_back():
    """What is set must be permitted, then the output goes on."""
    psu, port = driver(
        SOUND,
        (b"VOLT? (@2)\n", b"+4.2\n"),
        (b"CURR? (@2)\n", b"+0.2\n"),
        NONE,
        (b"OUTP ON,(@2)\n", b""),
        NONE,
        (b"OUTP? (@2)\n", b"1\n"),
        clamps=[clamp("voltage", "V", 5.0), clamp("current", "A", 0.5)],
    )
    psu.role(coil()).enable()
    assert port.done


def test_enable_refuses_what_a_person_left_on_the_front_panel():
    """An output that is set beyond its clamps is not switched on."""
    psu, port = driver(SOUND, (b"VOLT? (@2)\n", b"+2.5E+01\n"), clamps=[clamp("voltage", "V", 5.0)])
    with pytest.raises(ClampExceeded, match="voltage 25 V"):
        psu.role(coil()).enable()
    assert port.done


def test_enable_on_a_tripped_output_sends_nothing():
    """A tripped protection is a person's to clear."""
    psu, port = driver(TRIPPED)
    with pytest.raises(Rejected, match="over-voltage protection of supply.coil has tripped"):
        psu.role(coil()).enable()
    assert port.done


@pytest.mark.parametrize(
    ("after", "sentence"), [(TRIPPED, "has tripped"), (SOUND, "supply.coil was switched on and is off")]
)
def test_an_output_that_stays_off_is_rejected(after, sentence):
    """On that is not read back as on is no on, and the error says why if the instrument does."""
    psu, _ = driver(
        SOUND,
        (b"VOLT? (@2)\n", b"+4.2\n"),
        (b"CURR? (@2)\n", b"+0.2\n"),
        NONE,
        (b"OUTP ON,(@2)\n", b""),
        NONE,
        (b"OUTP? (@2)\n", b"0\n"),
        after,
    )
    with pytest.raises(Rejected, match=sentence):
        psu.role(coil()).enable()


def test_disable_sends_its_bytes_first():
    """Nothing is asked before the output is off."""
    psu, port = driver((b"OUTP OFF,(@2)\n", b""), NONE, (b"OUTP? (@2)\n", b"0\n"))
    psu.role(coil()).disable()
    assert port.done


def test_an_output_that_stays_on_is_rejected():
    """Off that is not read back as off is no off."""
    psu, _ = driver((b"OUTP OFF,(@2)\n", b""), NONE, (b"OUTP? (@2)\n", b"1\n"))
    with pytest.raises(Rejected, match="was switched off and is on"):
        psu.role(coil()).disable()


def test_measured_figures_have_units_and_no_uncertainty_of_their_own():
    """The bench adds the certificate's uncertainty."""
    psu, _ = driver((b"MEAS:VOLT? (@2)\n", b"+4.19987000E+00\n"), (b"MEAS:CURR? (@2)\n", b"+1.23000000E-02\n"))
    output = psu.role(coil())
    voltage, current = output.voltage(), output.current()
    assert (voltage.value, voltage.unit, voltage.uncertainty) == (4.19987, "V", None)
    assert (current.value, current.unit, current.uncertainty) == (0.0123, "A", None)


def test_a_measurement_without_a_number_is_nan():
    """SCPI's not-a-number passes no check."""
    psu, _ = driver((b"MEAS:VOLT? (@2)\n", b"+9.91000000E+37\n"))
    assert math.isnan(psu.role(coil()).voltage().value)


@pytest.mark.parametrize(
    ("register", "mode"), [(b"2", "CV"), (b"1", "CC"), (b"0", "unregulated"), (b"3", "unregulated"), (b"+514", "CV")]
)
def test_the_mode_is_in_the_two_low_bits(register, mode):
    """Bit 0 is constant current, bit 1 constant voltage; protection bits above do not matter."""
    psu, _ = driver((b"OUTP? (@2)\n", b"1\n"), (b"STAT:QUES:INST:ISUM2:COND?\n", register + b"\n"))
    assert psu.role(coil()).mode() == mode


def test_the_mode_of_an_output_that_is_off_is_off():
    """The condition register is not asked then."""
    psu, port = driver((b"OUTP? (@2)\n", b"0\n"))
    assert psu.role(coil()).mode() == "off"
    assert port.done


@pytest.mark.parametrize(
    ("wire", "sentence"),
    [
        (Wire(role="relays", instance="", instrument="psu1"), "does not fill the role relays"),
        (Wire(role="supply", instance="coil", instrument="psu1"), "has channels, and none is named"),
        (Wire(role="supply", instance="coil", instrument="psu1", channel=4), "has no channel 4"),
        (coil(overvoltage="5.5"), r"wiring supply.coil: unknown key .* \(its driver takes over_voltage"),
        (coil(over_voltage="much"), "'over_voltage' must be a number in V, like '5.5 V', found \"much\""),
        (coil(over_voltage="nan"), "'over_voltage' must be a number in V"),
    ],
)
def test_wires_that_it_cannot_serve_are_refused(wire, sentence):
    """The sentence says what is wrong with the wire."""
    psu, port = driver()
    with pytest.raises(Refused, match=sentence):
        psu.role(wire)
    assert port.written == []


def test_it_is_reached_by_a_port():
    """A bench file that gives it a bus is refused."""
    with pytest.raises(Refused, match="needs a port"):
        KeysightE36300(Connection(device="psu1", clock=VirtualClock(), clamps=Clamps()))
