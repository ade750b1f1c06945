"""Supplies of every SCPI dialect as firmware differs: what they say is understood, and on is never taken for off."""

from __future__ import annotations

import re
from contextlib import suppress

import pytest
import sweeps
from by_bytes import SCPI, rig
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.instruments.driver import Outlet
from hil.instruments.scpi_session import as_switch
from hil.model.bench import Proof, Wire
from hil.model.errors import Garbled, HilError, NoReply, Refused, Rejected

MANNERS = {
    "as the manual has it": {},
    "carriage returns": {"line_end": "crlf"},
    "blanks at the end": {"line_end": "blank crlf"},
    "digits": {"switches": "digits"},
    "digits with a sign": {"switches": "signed digits"},
    "words": {"switches": "words"},
    "small words": {"switches": "small words"},
    "plain numbers": {"numbers": "plain"},
    "numbers with a sign": {"numbers": "signed"},
    "numbers with an exponent": {"numbers": "exponent"},
    "leading zeros": {"numbers": "zeros"},
    "blanks around numbers": {"numbers": "blanks"},
    "units": {"numbers": "unit"},
    "units after a blank": {"numbers": "blank unit"},
    "no quotes": {"no_error": "0 No Error"},
    "a sign and no quotes": {"no_error": "+0, No error"},
    "echo": {"echo": True, "line_end": "crlf"},
    "banner": {"banner": "Welcome, SCPI parser 1.2"},
    "much at once": {
        "line_end": "crlf",
        "switches": "words",
        "numbers": "unit",
        "no_error": "0 No Error",
        "echo": True,
    },
}
EVERY = [(name, manner) for name in SCPI for manner in MANNERS]
SAMPLE = sweeps.sample(EVERY, 60)
VOLTS = Proof(output="supply.coil", quantity="voltage", unit="V", minimum=-0.2, maximum=0.2)


@pytest.mark.parametrize(("name", "manner"), SAMPLE)
def test_the_whole_role_in_any_manner(name, manner):
    """Identified, looked at, configured, switched on, measured in both modes, switched off."""
    with rig(SCPI[name], truth=MANNERS[manner]) as found:
        assert found.driver.identify().model
        before = found.driver.outlets()
        assert not any(outlet.on for outlet in before)
        output = found.role
        assert output.mode() == "off"
        output.configure(4.2, 0.7)
        assert not output.enabled()
        output.enable()
        assert found.on()
        assert found.driver.outlets() == tuple(
            Outlet(outlet.channel, outlet.channel == SCPI[name].wire.channel) for outlet in before
        )
        assert output.mode() == "CV"
        assert output.voltage().value == pytest.approx(4.2)
        assert output.current().value == pytest.approx(0.42)
        output.configure(5.0, 0.3)
        assert output.mode() == "CC"
        assert output.voltage().value == pytest.approx(3.0)
        output.disable()
        assert not output.enabled()
        assert not found.on()


@pytest.mark.parametrize(("name", "manner"), SAMPLE)
def test_bytes_make_it_safe_in_any_manner(name, manner):
    """What is on is never proven off; what was made safe is, by the instrument's word, current and voltage."""
    with rig(SCPI[name], truth=MANNERS[manner]) as found:
        found.driver.identify()
        SCPI[name].drive(found)
        for proof in (None, SCPI[name].proof, VOLTS):
            assert not found.proven(found.code(proof))
            assert found.on()
        assert found.make_safe(found.code(SCPI[name].proof))
        assert found.proven(found.code(VOLTS))
        assert not found.on()


@pytest.mark.parametrize(("terminator", "line_end"), [(b"\r", "cr"), (b"\r\n", "crlf"), (b"\n", "lf"), (b"", "crlf")])
@pytest.mark.parametrize("name", ["keysight-e36300", "rigol-dp832"])
def test_lines_end_as_the_bench_file_says(name, terminator, line_end):
    """Both ways, and for the guardian; without a word a carriage return before the line feed does not count."""
    with rig(SCPI[name], truth={"line_end": line_end}, terminator=terminator) as found:
        SCPI[name].drive(found)
        code = found.code(SCPI[name].proof)
        assert {each.send[-len(terminator or b"\n") :] for each in (*code.resync, *code.off)} == {terminator or b"\n"}
        assert not found.proven(code)
        assert found.make_safe(code)
        assert not found.on()


@pytest.mark.parametrize("manner", ["carriage returns", "words", "units", "echo", "much at once"])
@pytest.mark.parametrize("name", SCPI)
def test_faults_in_any_manner_give_no_wrong_state(name, manner):
    """Garbled, cut short or chattering: on is never read as off, nor 4 V as none."""
    chatter = {"kind": "chatty", "from": "1 s", "every": "13 ms", "text": "OFF\n"}
    for fault in ({"kind": "garbled", "share": "0.05", "from": "1 s"}, {"kind": "partial", "bytes": "5"}, chatter):
        with rig(SCPI[name], truth=MANNERS[manner], faults=[{"from": "1 s", **fault}]) as found:
            with suppress(HilError):
                found.role.configure(4.0, 0.7)
                found.role.enable()
            on = bool(found.on())
            found.clock.wait_until(max(found.clock.now_ns(), 1_000_000_000))
            for read, right in (
                (found.role.enabled, on),
                (lambda found=found: round(found.role.voltage().value), 4),
            ) * 4:
                with suppress(Garbled, NoReply):
                    assert not on or read() == right


def respelled(word):
    """Return how firmware may write a word: cases, blanks, the end of the line."""
    return st.tuples(
        st.sampled_from(["", " ", "  "]),
        st.sampled_from([word, word.lower(), word.title(), f"+{word}" if word.isdigit() else word]),
        st.sampled_from(["", " ", "   "]),
        st.sampled_from(["\n", "\r\n"]),
    ).map("".join)


@settings(max_examples=sweeps.examples(200), derandomize=True)
@given(st.sampled_from(["ON", "1"]).flatmap(respelled), st.sampled_from(["OFF", "0"]).flatmap(respelled), st.booleans())
def test_no_spelling_of_on_is_taken_for_off(on, off, echoes):
    """Neither by the driver nor by the guardian's expression; every spelling of off is off to both."""
    for name in set(SCPI) - {"siglent-spd3303x"}:
        with rig(SCPI[name]) as found:
            asked = found.code().proof[1]
        identification = "A,B,C,D;" if b"*IDN?;" in asked.send else ""
        head = (asked.send.decode().strip() + "\r\n" if echoes else "") + identification
        assert re.search(asked.expect, (head + off).encode(), re.DOTALL)
        assert not re.search(asked.expect, (head + on).encode(), re.DOTALL)
    assert as_switch(on.strip())
    assert not as_switch(off.strip())


@settings(max_examples=sweeps.examples(200), derandomize=True)
@given(st.text(alphabet="01+-OFN onf.eE\r\t;,\x00", max_size=8))
def test_what_the_guardian_takes_for_off_the_driver_takes_for_off(text):
    """Whatever comes: the expression is no wider than the parser."""
    with rig(SCPI["rigol-dp832"]) as found:
        asked = found.code().proof[1]
    if re.search(asked.expect, text.encode() + b"\n", re.DOTALL):
        assert as_switch(text.strip()) is False


@settings(max_examples=sweeps.examples(100), derandomize=True)
@given(st.integers(0, 0xFFFF), st.sampled_from(["0x{:x}", "0x{:X}", "0X{:04x}", "0x{:08x}"]))
def test_a_status_in_hexadecimal_is_off_where_its_bit_is(status, form):
    """The guardian's expression and the bits agree, for both outputs."""
    for channel in (1, 2):
        with rig(SCPI["siglent-spd3303x"]) as found:
            role = found.driver.role(Wire(role="supply", instance="a", instrument="device", channel=channel))
            asked = role.safe_bytes("off").proof[1]
        said = re.search(asked.expect, form.format(status).encode() + b"\n", re.DOTALL)
        assert bool(said) == (not status >> 3 + channel & 1)


@pytest.mark.parametrize("track", [1, 2])
def test_outputs_in_series_or_parallel_are_not_believed(track):
    """They give more than either was set to; off is off all the same."""
    with rig(SCPI["siglent-spd3303x"]) as found:
        found.line.write(f"OUTP:TRACK {track}\n".encode())
        found.clock.sleep(0.1)
        found.role.configure(4.0, 0.5)
        with pytest.raises(Garbled, match="in series or parallel"):
            found.role.enable()
        assert found.on()
        found.role.disable()
        assert not found.on()


@pytest.mark.parametrize(("model", "count"), [("HMP2020", 2), ("HMP4030", 3), ("HMP4040", 4)])
def test_a_model_has_the_channels_that_it_has(model, count):
    """The first question is who it is; a channel that the model lacks is refused before anything is set."""
    with rig(SCPI["rohde-schwarz-hmp"], truth={"model": model}) as found:
        assert [outlet.channel for outlet in found.driver.outlets()] == list(range(1, count + 1))
        last = found.driver.role(Wire(role="supply", instance="b", instrument="device", channel=4))
        if count < 4:
            with pytest.raises(Refused, match=f"{model} has no channel 4"):
                last.configure(1.0, 0.1)
        with pytest.raises(Refused, match="more than channel 3" if count > 2 else "has no channel 3"):
            found.role.configure(1.0, 10.5)
        assert not found.on()


def test_a_channel_selected_for_later_counts_as_on():
    """The master switch is off, and it would come on with the next channel."""
    with rig(SCPI["rohde-schwarz-hmp"]) as found:
        found.line.write(b"INST:NSEL 1;:OUTP:SEL ON\n")
        found.clock.sleep(0.1)
        assert not found.on()
        assert found.driver.outlets()[0] == Outlet(1, on=True)
        found.role.configure(1.0, 0.1)
        found.role.enable()
        assert found.on() == {"1", "3"}


def test_what_another_program_selects_changes_nothing():
    """Every line selects its own channel."""
    with rig(SCPI["rohde-schwarz-hmp"]) as found:
        found.role.configure(4.0, 0.5)
        found.line.write(b"INST:NSEL 1\n")
        found.role.enable()
        assert found.on() == {"3"}
        found.line.write(b"INST:NSEL 2\n")
        assert found.role.voltage().value == pytest.approx(4.0)
        assert found.make_safe(found.code())


@pytest.mark.parametrize(
    ("name", "setting", "level"),
    [
        ("keysight-e36100", "over_voltage", "4.3"),
        ("keysight-e3632a", "over_voltage", "4.3"),
        ("rohde-schwarz-hmp", "over_voltage", "4.3"),
        ("rohde-schwarz-nge100", "over_voltage", "4.3"),
        ("rohde-schwarz-hmp", "over_current", "at setting"),
    ],
)
def test_a_protection_that_tripped_keeps_the_output_off(name, setting, level):
    """Set below what the output gives it trips, and only a person clears it."""
    with rig(SCPI[name], truth={"output_voltage_offset": "0.5"}) as found:
        wire = SCPI[name].wire
        output = found.driver.role(
            Wire(role="supply", instance="coil", instrument="device", channel=wire.channel, settings={setting: level})
        )
        output.configure(4.2, 0.7 if setting == "over_voltage" else 0.2)
        for _ in range(2):
            with pytest.raises(Rejected, match=f"{setting.replace('_', '-')} protection of supply.coil has tripped"):
                output.enable()
        assert not found.on()


def test_a_siglent_has_no_protection_that_a_wire_could_set():
    """Nothing guards against a wrong setting, and it does not say that something does."""
    with rig(SCPI["siglent-spd3303x"]) as found:
        wire = Wire(role="supply", instance="a", instrument="device", channel=1, settings={"over_voltage": "4.25"})
        with pytest.raises(Refused, match="unknown key 'over_voltage'"):
            found.driver.role(wire)
