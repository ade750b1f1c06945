"""Every fault of every instrument, at arm, in a case and in the safe-off: never called safe with an output on."""

from __future__ import annotations

from dataclasses import replace

import pytest
import sweeps
from adcs_bench import adcs, bound, with_peer
from serial import SerialException

from hil.bench.readiness import energised_gates, unpowered_gates
from hil.bench.safe_off import make_safe
from hil.model.errors import HilError

NANO = 1_000_000_000

LINE = {
    "dead": {"kind": "dead"},
    "late": {"kind": "late", "by": "700 ms"},
    "a little late": {"kind": "late", "by": "300 ms"},
    "garbled": {"kind": "garbled"},
    "sometimes garbled": {"kind": "garbled", "share": "0.03"},
    "partial": {"kind": "partial", "bytes": "3"},
    "chatty": {"kind": "chatty", "every": "7 ms", "text": "0\n"},
    "chatty like a reading": {"kind": "chatty", "every": "3 ms", "text": "+0.00000000E+00\n"},
    "chatty in frames": {"kind": "chatty", "every": "5 ms", "text": "\x01\x01\x01"},
}
OF = {
    "psu1": {
        **LINE,
        "refuses off, and says so": {"kind": "refuse-off", "says": "on"},
        "refuses off, and says off": {"kind": "refuse-off", "says": "off"},
        "no numbers": {"kind": "not-a-number"},
        "drops its connection": {},
    },
    "relay1": {**LINE, "drops its connection": {}},
    "mag1": {"dead": LINE["dead"], "garbled": LINE["garbled"], "stuck": {"kind": "stuck"}},
}
BOTH = {
    "refuses off among chatter": [{"kind": "refuse-off", "says": "on"}, {**LINE["chatty"], "every": "11 ms"}],
    "refuses off, lies, and chatters": [{"kind": "refuse-off", "says": "off"}, LINE["chatty like a reading"]],
    "refuses off and is garbled": [{"kind": "refuse-off", "says": "on"}, LINE["sometimes garbled"]],
}
FAULTS = [
    *((device, name, [fault] if fault else []) for device, faults in OF.items() for name, fault in faults.items()),
    *(("psu1", name, faults) for name, faults in BOTH.items()),
]
OF_RIGOL = {name: [fault] for name, fault in OF["psu1"].items() if name != "no numbers"} | BOTH
MOMENTS = {"arm": 0.0, "case": 10.0, "safe-off": 20.0, "within the safe-off": 20.013}


class Dropped:
    """The far end of a port that is gone from an instant on."""

    def __init__(self, end, clock, start_s):
        self.__dict__.update(end=end, clock=clock, start_s=start_s)

    def __getattr__(self, name):
        if name in {"exchange", "read", "write", "waiting", "discard"} and self.clock.now() >= self.start_s:
            raise SerialException("the device is gone")
        return getattr(self.end, name)

    def __setattr__(self, name, value):
        setattr(self.end, name, value)


def with_rigol():
    """Return the bench with a supply whose questions are asked one by one."""
    spec = adcs()
    instruments = tuple(
        replace(
            one,
            driver="rigol-dp832",
            identity=replace(one.identity, manufacturer="RIGOL TECHNOLOGIES", model="DP832", serial="DP8C000000001"),
        )
        if one.name == "psu1"
        else one
        for one in spec.instruments
    )
    return with_peer(replace(spec, instruments=instruments), "psu1", truth={})


def off(bench):
    """Return whether everything is without power, by the world's truth."""
    coil = bench.world.plants["coil"]
    contacts = coil.inputs["contact_a"] or coil.inputs["contact_b"]
    return coil.observe("voltage") == 0.0 and coil.observe("sensor_power.voltage") == 0.0 and not contacts


def in_a_case(bench):
    """Drive everything, as a case does, and keep what its readings were; a fault ends it."""
    readings = {}
    try:
        bench.roles["supply.sensor"].configure(3.3, 0.02)
        bench.roles["supply.sensor"].enable()
        bench.roles["relays"].close("a")
        bench.roles["relays"].close("b")
        bench.roles["supply.coil"].configure(5.0, 0.016)
        bench.roles["supply.coil"].enable()
        bench.clock.wait_until(max(bench.clock.now_ns(), 15 * NANO))
        readings = {
            "volts": bench.roles["supply.sensor"].voltage().value,
            "amperes": bench.roles["supply.coil"].current().value,
            "contacts": bench.roles["relays"].closed(),
        }
    except HilError:
        return {}
    return readings


def must_be_safe(spec, device, name, faults, moment):
    """Arm, drive and make safe while the faults hold, and compare what is said with the world's truth."""
    start = MOMENTS[moment]
    rows = tuple({**fault, "from": f"{start} s"} for fault in faults)
    with bound(with_peer(spec, device, faults=rows)) as bench:
        if not faults:
            port = next(port for port in bench.ports if port.device == device)
            port._end = Dropped(port._end, bench.clock, start)
        bench.world.plants["coil"].command(board="z_plus")
        armed = all(gate.ok for gates in (unpowered_gates, energised_gates) for gate in gates(bench, None))
        if armed:
            assert off(bench)
            bench.clock.wait_until(max(bench.clock.now_ns(), 10 * NANO))
            found = in_a_case(bench)
            if found and name != "no numbers":
                assert found["contacts"] == ("a", "b")
                assert found["volts"] == pytest.approx(3.3, abs=0.05)
                assert found["amperes"] == pytest.approx(0.016, rel=0.05)
        bench.clock.wait_until(max(bench.clock.now_ns(), 20 * NANO))
        began = bench.clock.now()
        results = []
        if make_safe(bench.spec.safe_off, bench.roles, bench.clock, results.append):
            bench.clock.sleep(0.05)
            assert off(bench), results
        assert len(results) == 3
        assert bench.clock.now() - began < 40.0


def in_turn(faults):
    """Return every fault at every moment; in a sample every fault at one, and every moment in its turn."""
    whole = [(*fault, moment) for fault in faults for moment in MOMENTS]
    turns = [*MOMENTS] * len(faults)
    return sweeps.chosen([(*fault, turns[place - 1]) for place, fault in enumerate(faults)], whole)


@pytest.mark.parametrize(
    ("device", "name", "faults", "moment"), in_turn(FAULTS), ids=lambda part: part if isinstance(part, str) else ""
)
def test_what_is_called_safe_is_off(device, name, faults, moment):
    """Armed means tried and off; a reading is right or a fault; safe means that the world has no voltage."""
    must_be_safe(adcs(), device, name, faults, moment)


@pytest.mark.parametrize(("name", "moment"), in_turn([(name,) for name in OF_RIGOL]))
def test_what_a_rigol_calls_safe_is_off(name, moment):
    """The same with a supply whose replies are closed by its identification, and which needs pauses."""
    must_be_safe(with_rigol(), "psu1", name, [fault for fault in OF_RIGOL[name] if fault], moment)
