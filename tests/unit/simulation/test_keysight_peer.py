"""The simulated E36312A: its dialect, its regulation, its protections."""

from __future__ import annotations

import pytest
from twin import Twin

NO_ERROR = '+0,"No error"'


@pytest.fixture
def twin():
    """Return a twin whose supply reads without noise."""
    return Twin(truths={"psu": {"voltage_noise": "0", "current_noise": "0"}})


def test_power_on_state(twin):
    """All outputs off, 0 V, rated current, protection at 110 %."""
    assert twin.scpi("OUTP? (@1:3)") == "0,0,0"
    assert twin.scpi("VOLT? (@1,3)") == "+0.00000000E+00,+0.00000000E+00"
    assert twin.scpi("CURR? (@1,2)") == "+5.00000000E+00,+1.00000000E+00"
    assert [float(text) for text in twin.scpi("VOLT:PROT? (@1:3)").split(",")] == pytest.approx([6.6, 27.5, 27.5])


@pytest.mark.parametrize(
    "text",
    [
        "VOLT 5,(@2)",
        "volt 5.0,(@2)",
        "VOLTAGE 5,(@2)",
        ":SOUR:VOLT:LEV:IMM:AMPL 5,(@2)",
        "source:voltage 5000 mV, (@2)",
        "VOLT 5 V,(@2)",
        "INST:NSEL 2;:VOLT 5",
        "INST CH2;:VOLT 5",
        "VOLT 5,CH2",
        "CURR 0.1,(@2);VOLT 5,(@2)",
        "VOLT\t+.5e1,( @ 2 )",
        "VOLT 5,(@2)\r",
    ],
)
def test_spellings_of_one_setting(twin, text):
    """Short and long forms, cases, units, selection and several commands per line all set 5 V."""
    assert twin.scpi(text) == ""
    assert twin.scpi("SYST:ERR?") == NO_ERROR
    assert twin.scpi("VOLT? (@2)") == "+5.00000000E+00"


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("VOLTS 5,(@2)", -113),
        ("VOL 5", -113),
        ("MEAS:POW? (@2)", -113),
        ("*IDN", -113),
        ("VOLT:PROT:TRIP 1", -113),
        ("VOLT 25.76,(@2)", -222),
        ("VOLT 6.2,(@1)", -222),
        ("VOLT -1,(@2)", -222),
        ("VOLT 5,(@4)", -222),
        ("VOLT 1E999,(@2)", -222),
        ("VOLT", -109),
        ("VOLT (@2)", -109),
        ("VOLT 1,2,(@2)", -108),
        ("OUTP? ON,(@1)", -108),
        ("*RST 1", -108),
        ("VOLT five,(@2)", -104),
        ("VOLT 5 A,(@2)", -131),
        ("OUTP MAYBE,(@1)", -224),
        ("INST CH9", -224),
        ("VOLT? SOME,(@2)", -224),
        ("VOLT 5,(@1,)", -102),
        ("OUTP ON,(@1:2:3)", -102),
        ("STAT:QUES:INST:ISUM4:COND?", -113),
    ],
)
def test_errors_go_to_the_queue_without_an_answer(twin, text, code):
    """A line that cannot be executed answers nothing, changes nothing, and leaves one error."""
    assert twin.scpi(text) == ""
    assert twin.scpi("SYST:ERR?").startswith(f"{code},")
    assert twin.scpi("SYST:ERR?") == NO_ERROR
    assert twin.scpi("VOLT? (@2)") == "+0.00000000E+00"


def test_error_queue_holds_twenty(twin):
    """The 21st error turns the last entry into an overflow; clearing forgets all."""
    for _ in range(25):
        twin.scpi("NONSENSE")
    codes = [twin.scpi("SYST:ERR?") for _ in range(21)]
    assert codes[:19] == ['-113,"Undefined header"'] * 19
    assert codes[19:] == ['-350,"Error queue overflow"', NO_ERROR]
    twin.scpi("NONSENSE")
    twin.scpi("*CLS")
    assert twin.scpi("SYST:ERR?") == NO_ERROR


def test_error_ends_a_line_but_not_what_came_before(twin):
    """Answers from before the error are given, what follows is not executed."""
    assert twin.scpi("*OPC?;NONSENSE;VOLT 5,(@2)") == "1"
    assert twin.scpi("VOLT? (@2)") == "+0.00000000E+00"


def test_relative_header_after_a_semicolon(twin):
    """A header without a colon goes on from the level before."""
    assert twin.scpi("MEAS:VOLT? (@1);CURR? (@1)") == "+0.00000000E+00;+0.00000000E+00"
    assert twin.scpi("OUTP:PROT:CLE (@1);VOLT 5,(@1)") == ""
    assert twin.scpi("SYST:ERR?").startswith("-113,")


def test_current_limit_and_condition(twin):
    """16 mA into the coil is constant current, without a board constant voltage, off is neither."""
    assert twin.scpi("STAT:QUES:INST:ISUM2:COND?") == "0"
    twin.scpi("VOLT 5,(@2);CURR 0.016,(@2);:OUTP ON,(@2)")
    assert twin.scpi("STATUS:QUESTIONABLE:INSTRUMENT:ISUMMARY2:CONDITION?") == "2"
    assert twin.scpi("MEAS:VOLT? (@2)") == "+5.00000000E+00"
    twin.coil.command(board="y_plus")
    twin.clock.sleep(0.02)
    assert twin.scpi("STAT:QUES:INST:ISUM2:COND?") == "1"
    assert float(twin.scpi("MEAS:CURR? (@2)")) == pytest.approx(0.016, rel=1e-9)
    assert float(twin.scpi("MEAS:VOLT? (@2)")) == pytest.approx(0.64, rel=1e-3)


def test_open_output_measures_its_own_voltage(twin):
    """Nothing is connected to channel 3: its voltage, and no current."""
    twin.scpi("VOLT 12,(@3);:OUTP ON,(@3)")
    assert twin.scpi("MEAS:VOLT? (@3);:MEAS:CURR? (@3)") == "+1.20000000E+01;+0.00000000E+00"


def test_fixed_load():
    """A resistor at an output draws what it must, and limits like any load."""
    twin = Twin(truths={"psu": {"channels": {"3": {"load": "24"}}, "voltage_noise": "0", "current_noise": "0"}})
    twin.scpi("VOLT 12,(@3);:OUTP ON,(@3)")
    assert twin.scpi("MEAS:CURR? (@3)") == "+5.00000000E-01"
    twin.scpi("CURR 0.1,(@3)")
    assert float(twin.scpi("MEAS:VOLT? (@3)")) == pytest.approx(2.4)
    assert twin.scpi("STAT:QUES:INST:ISUM3:COND?") == "1"


def test_bounds_and_defaults(twin):
    """MIN, MAX and DEF can be asked and set; settings are rounded to the resolution."""
    assert twin.scpi("VOLT? MAX,(@2)") == "+2.57500000E+01"
    assert twin.scpi("CURR? MINIMUM,(@2)") == "+0.00000000E+00"
    twin.scpi("CURR DEF,(@1);VOLT MAX,(@1)")
    assert twin.scpi("VOLT? (@1);CURR? (@1)") == "+6.18000000E+00;+5.00000000E+00"
    twin.scpi("VOLT 1.23456,(@1)")
    assert float(twin.scpi("VOLT? (@1)")) == pytest.approx(1.235)


def test_over_voltage_trips_and_latches(twin):
    """Above its level the output goes off, stays off until cleared, and says why."""
    twin.scpi("VOLT:PROT 5,(@3);:VOLT 4.9,(@3);:OUTP ON,(@3)")
    assert twin.scpi("OUTP? (@3)") == "1"
    twin.scpi("VOLT 5.1,(@3)")
    assert twin.scpi("OUTP? (@3);:VOLT:PROT:TRIP? (@3)") == "0;1"
    assert twin.scpi("STAT:QUES:INST:ISUM3:COND?") == "512"
    twin.scpi("OUTP ON,(@3)")
    assert twin.scpi("SYST:ERR?").startswith("-221,")
    twin.scpi("VOLT 4,(@3);:OUTP:PROT:CLE (@3);:OUTP ON,(@3)")
    assert twin.scpi("OUTP? (@3);:MEAS:VOLT? (@3)") == "1;+4.00000000E+00"


def test_over_current_trips_without_a_further_command(twin):
    """With the protection on, constant current switches the output off by itself, whoever looks."""
    twin.scpi("CURR:PROT:STAT ON,(@2);:VOLT 5,(@2);:CURR 0.016,(@2);:OUTP ON,(@2)")
    assert twin.scpi("CURR:PROT:TRIP? (@2)") == "0"
    twin.coil.command(board="y_plus")
    twin.clock.sleep(0.05)
    assert twin.coil.observe("voltage") == 0.0
    assert twin.scpi("CURR:PROT:TRIP? (@2);:STAT:QUES:INST:ISUM2:COND?") == "1;1024"


def test_reset_switches_off(twin):
    """After *RST nothing is on, and settings are those of power-on."""
    twin.scpi("VOLT 5,(@2);:OUTP ON,(@2);:CURR:PROT:STAT ON,(@2)")
    twin.scpi("*RST")
    assert twin.scpi("OUTP? (@2);:VOLT? (@2);:CURR:PROT:STAT? (@2)") == "0;+0.00000000E+00;0"
    assert twin.coil.inputs["supply_voltage"] == 0.0


def test_errors_of_output_and_reading_are_the_truth():
    """What is given and what is read deviate each by its own gain and offset."""
    truth = {
        "output_voltage_gain": "0.01", "output_voltage_offset": "0.1", "voltage_gain": "0.02", "voltage_offset": "-0.3",
        "voltage_noise": "0",
    }  # fmt: skip
    twin = Twin(truths={"psu": truth})
    twin.scpi("VOLT 5,(@2);:OUTP ON,(@2)")
    given = 5 * 1.01 + 0.1
    assert twin.coil.observe("voltage") == pytest.approx(given)
    assert float(twin.scpi("MEAS:VOLT? (@2)")) == pytest.approx(given * 1.02 - 0.3)


def test_reading_noise_has_its_level_and_does_not_depend_on_polling():
    """Readings spread as the truth says; a reading at an instant is the same however many came before."""
    often, once = Twin(), Twin()
    readings = [float(often.scpi("MEAS:VOLT? (@3)")) for _ in range(400)]
    spread = (sum(reading**2 for reading in readings) / len(readings)) ** 0.5
    assert spread == pytest.approx(1e-4, rel=0.2)
    once.clock.sleep(39.9)
    assert float(once.scpi("MEAS:VOLT? (@3)")) == readings[-1]


def test_latency(twin):
    """A setting takes effect 2 ms after its line, a measurement is answered after 10 ms."""
    line = twin.lines["psu"]
    line.write(b"VOLT 3,(@2);:OUTP ON,(@2)\n")
    twin.clock.sleep(0.0019)
    assert twin.coil.inputs["supply_voltage"] == 0.0
    twin.clock.sleep(0.0001)
    assert twin.coil.inputs["supply_voltage"] == 3.0
    line.write(b"MEAS:VOLT? (@2)\n")
    twin.clock.sleep(0.0099)
    assert line.waiting() == 0
    twin.clock.sleep(0.0002)
    assert line.waiting() == 16


def test_pieces_and_several_lines(twin):
    """Bytes may come in any pieces; lines are answered in order."""
    line = twin.lines["psu"]
    for piece in (b"*ID", b"N?\n*OP", b"C?\nVOLT? ", b"(@1)\n"):
        line.write(piece)
    twin.clock.sleep(0.1)
    identity, *others = line.read(line.waiting(), 0).split(b"\n")
    assert identity == b"Keysight Technologies,E36312A,SIM-MY00000001,2.1.0-1.0.4-1.12"
    assert others == [b"1", b"+0.00000000E+00", b""]


def test_endless_line_is_thrown_away(twin):
    """More than the input buffer holds without a line feed is an overrun, not a memory leak."""
    twin.exchange("psu", b"X" * 3000)
    assert twin.scpi("SYST:ERR?").startswith("-363,")


def test_lines_do_not_pile_up_for_ever(twin):
    """Of more lines than the instrument has room for the rest is lost, and the error queue says so."""
    answers = twin.exchange("psu", b"*OPC?\n" * 300, 1.0).count(b"1\n")
    assert answers == 256
    assert twin.scpi("SYST:ERR?").startswith("-363,")
