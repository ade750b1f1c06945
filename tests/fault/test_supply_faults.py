"""Every fault of supplies without a frame, at every moment: never called off while on, never a wrong reading."""

from __future__ import annotations

from contextlib import suppress

import pytest
import sweeps
from facing import facing

from hil.instruments.korad_ka3005p import KoradKa3005p
from hil.instruments.rigol_dp832 import RigolDp832
from hil.instruments.rohde_schwarz_hmp import RohdeSchwarzHmp
from hil.instruments.siglent_spd3303x import SiglentSpd3303x
from hil.model.bench import Wire
from hil.model.errors import HilError
from hil.simulation.peers import korad_ka3005p, rigol_dp832, rohde_schwarz_hmp, siglent_spd3303x

NANO = 1_000_000_000
SUPPLIES = {
    "rigol": (rigol_dp832.MODEL, RigolDp832, 0),
    "korad": (korad_ka3005p.MODEL, KoradKa3005p, 9600),
    "rohde-schwarz": (rohde_schwarz_hmp.HMP, RohdeSchwarzHmp, 0),
    "siglent": (siglent_spd3303x.MODEL, SiglentSpd3303x, 0),
}
FAULTS = {
    "dead": [{"kind": "dead"}],
    "late": [{"kind": "late", "by": "700 ms"}],
    "a little late": [{"kind": "late", "by": "300 ms"}],
    "garbled": [{"kind": "garbled"}],
    "sometimes garbled": [{"kind": "garbled", "share": "0.03"}],
    "partial": [{"kind": "partial", "bytes": "3"}],
    "chatty": [{"kind": "chatty", "every": "7 ms", "text": "OFF\n"}],
    "chatty at times": [{"kind": "chatty", "every": "190 ms", "text": "0"}],
    "chatty like a status": [{"kind": "chatty", "every": "31 ms", "text": "0x4\n"}],
    "chatty in lines": [{"kind": "chatty", "every": "130 ms", "text": "0.0000\n"}],
    "refuses off": [{"kind": "refuse-off", "says": "on"}],
    "refuses off among chatter": [
        {"kind": "refuse-off", "says": "on"},
        {"kind": "chatty", "every": "110 ms", "text": "\x11"},
    ],
    "refuses off and is late": [{"kind": "refuse-off", "says": "on"}, {"kind": "late", "by": "600 ms"}],
    "stray byte": [{"kind": "stray-byte"}],
}
CASES = [(supply, name) for supply in SUPPLIES for name in FAULTS if name != "stray byte" or supply == "korad"]
LYING = [{"kind": "refuse-off", "says": "off"}]
MOMENTS = {"arm": 0.0, "case": 4.0, "safe-off": 8.0, "within the safe-off": 8.02}


def wired(driver):
    """Return the output of channel 1."""
    return driver.role(Wire(role="supply", instance="charge", instrument="device", channel=1))


def facing_supply(name, faults):
    """Return a driver facing a supply with 10 ohms at its output."""
    model, driver, baud = SUPPLIES[name]
    truth = {"voltage_noise": "0", "current_noise": "0", "load": "10"}
    return facing(model, driver=driver, truth=truth, faults=faults, baud=baud)


@pytest.mark.parametrize(
    ("supply", "name", "moment"), sweeps.sample([(*case, moment) for case in CASES for moment in MOMENTS], 81)
)
def test_what_is_called_off_is_off(supply, name, moment):
    """Whatever goes wrong and when: disabled means that the current is gone, a reading is right or a fault."""
    faults = [{**fault, "from": f"{MOMENTS[moment]} s", "until": "40 s"} for fault in FAULTS[name]]
    with facing_supply(supply, faults) as (driver, clock):
        output = wired(driver)
        on = False
        with suppress(HilError):
            output.configure(4.0, 0.7)
            output.enable()
            on = True
        clock.wait_until(max(clock.now_ns(), 4 * NANO))
        for read, true in ((output.voltage, 4.0), (output.current, 0.4)) * 2:
            with suppress(HilError):
                value = read().value
                assert not on or value == pytest.approx(true)
        clock.wait_until(max(clock.now_ns(), 8 * NANO))
        called_off = False
        with suppress(HilError):
            output.disable()
            called_off = True
        clock.wait_until(max(clock.now_ns(), 50 * NANO))
        with suppress(HilError):
            output.voltage()
        assert not called_off or output.voltage().value == 0.0


@pytest.mark.parametrize("supply", SUPPLIES)
def test_an_output_that_lies_shows_its_current(supply):
    """Its word is not the proof; the safe-off's proof is a measured current."""
    with facing_supply(supply, LYING) as (driver, _):
        output = wired(driver)
        output.configure(4.0, 0.7)
        output.enable()
        output.disable()
        assert output.current().value == pytest.approx(0.4)
