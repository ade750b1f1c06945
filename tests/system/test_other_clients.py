"""The served bench read by PyVISA-py, which knows nothing of hil: what peers say is what other programs understand."""

from __future__ import annotations

from contextlib import closing
from threading import Event

import pytest
import pyvisa
from live_runs import seconds_until, served

from hil.bench.serving import ends_of

IDENTITIES = {
    "psu1": "RIGOL TECHNOLOGIES,DP832,",
    "load1": "RIGOL TECHNOLOGIES,DL3021,",
    "dmm1": "Keysight Technologies,34461A,",
    "scope1": "RIGOL TECHNOLOGIES,DS1",
}
CLOSE = bytes.fromhex("01 05 00 00 FF 00 8C 3A")
"""How the manual of the relay board closes its first contact; the board says the same."""

PAUSE = Event()
"""Never comes."""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """Serve the bench; give a session of PyVISA-py for each of its SCPI instruments."""
    with served(tmp_path_factory.mktemp("e"), bench="eps") as place:
        ends, _ = ends_of(place.folder, "eps")
        with closing(pyvisa.ResourceManager("@py")) as manager:
            relay = manager.open_resource(f"ASRL{ends['relay1']}::INSTR", timeout=5000)
            yield {**{name: session(manager, ends[name]) for name in IDENTITIES}, "relay1": relay}


def session(manager, url):
    """Open a socket as a VISA resource, with the line ends of SCPI."""
    host, port = url.removeprefix("socket://").rsplit(":", 1)
    return manager.open_resource(
        f"TCPIP::{host}::{port}::SOCKET", read_termination="\n", write_termination="\n", timeout=5000
    )


@pytest.mark.system
@pytest.mark.timeout(60)
def test_every_instrument_says_who_it_is(bench):
    """Maker and model as the manuals have them, and without an error."""
    for name, begins in IDENTITIES.items():
        assert bench[name].query("*IDN?").startswith(begins), name


@pytest.mark.system
@pytest.mark.timeout(60)
def test_a_rail_is_switched_on_and_seen_by_four_instruments(bench):
    """A supply feeds a board by a relay, a load draws from it, a meter reads, an oscilloscope sees the edge."""
    supply, load, meter, scope, relay = (bench[name] for name in ("psu1", "load1", "dmm1", "scope1", "relay1"))
    put(supply, ":SOUR1:VOLT 8", ":SOUR1:CURR 2", ":OUTP CH1,ON")
    put(scope, ":TIM:MAIN:SCAL 0.01", ":CHAN1:DISP ON", ":CHAN1:PROB 10", ":CHAN1:SCAL 2", ":CHAN1:OFFS -6")
    put(scope, ":TRIG:EDG:SOUR CHAN1", ":TRIG:EDG:SLOP POS", ":TRIG:EDG:LEV 4", ":SING")
    seconds_until(lambda: ask(scope, ":TRIG:STAT?") == "WAIT", 5.0, "the oscilloscope waits for its trigger")
    relay.write_raw(CLOSE)
    assert relay.read_bytes(len(CLOSE)) == CLOSE
    put(load, ":SOUR:FUNC CURR", ":SOUR:CURR:LEV:IMM 0.5", ":SOUR:INP:STAT ON")
    seconds_until(lambda: ask(scope, ":TRIG:STAT?") == "STOP", 5.0, "the oscilloscope has its capture")
    put(meter, "CONF:CURR:DC")
    drawn, held = (float(ask(load, f":MEAS:{each}?")) for each in ("CURR", "VOLT"))
    given, flows = (float(ask(supply, f":MEAS:{each}? CH1")) for each in ("VOLT", "CURR"))
    assert (drawn, held, given) == (
        pytest.approx(0.5, abs=0.01),
        pytest.approx(5.04, abs=0.03),
        pytest.approx(8, abs=0.05),
    )
    assert flows == pytest.approx(float(ask(meter, "READ?")), abs=0.01)
    assert 0.8 < drawn * held / (given * flows) < 1.0
    put(scope, ":WAV:SOUR CHAN1", ":WAV:MODE NORM", ":WAV:FORM BYTE", ":WAV:STAR 1", ":WAV:STOP 1200")
    *_, step, origin, reference = (float(each) for each in ask(scope, ":WAV:PRE?").split(","))
    raw = scope.query_binary_values(":WAV:DATA?", datatype="B", container=list)
    volts = [(each - origin - reference) * step for each in raw]
    assert (len(volts), volts[0], volts[-1]) == (1200, pytest.approx(0, abs=0.1), pytest.approx(8, abs=0.2))
    assert [ask(each, ":SYST:ERR?").lstrip("+") for each in (supply, load, meter, scope)] == ['0,"No error"'] * 4


def put(instrument, *commands):
    """Send commands with the pause that these instruments need: one that comes too early is lost."""
    for command in commands:
        instrument.write(command)
        PAUSE.wait(0.05)


def ask(instrument, question):
    """Return the answer, and leave the pause after it."""
    answer = instrument.query(question)
    PAUSE.wait(0.05)
    return answer
