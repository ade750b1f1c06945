"""Every output that can do harm is guarded, cut off by one that is, or the bench is not armed."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import pytest

from hil.executive.ending.stop import StopFlags
from hil.executive.watching.coverage import harmless, plan_of
from hil.executive.watching.machine import Guarding
from hil.instruments.roles import SUPPLY
from hil.instruments.safing import must_be_state
from hil.model.bench import BenchHead, InstrumentSpec, SafeStep, Wire
from hil.model.cutting import CutPath
from hil.model.errors import Refused
from hil.model.identity import Source
from hil.model.safing import Exchange, SafeBytes

ASKED = Exchange(send=b"OUTP?\n", expect=rb"0\n")
BYTES = SafeBytes(off=(Exchange(send=b"OUTP OFF\n"),), proof=(ASKED,))


class Foreign:
    """A supply of a third party whose driver knows nothing of a guardian."""


class Guardable:
    """A supply whose driver gives bytes, or refuses to."""

    def __init__(self, code=BYTES):
        self.code = code

    def safe_bytes(self, state, proof=None):
        """Return them."""
        must_be_state(SUPPLY, "supply", state)
        if self.code is None:
            raise Refused("no byte stops it", "cut it off")
        return self.code


def wire(name, device="psu"):
    """Return a wire of that dotted name."""
    role, _, instance = name.partition(".")
    return Wire(role=role, instance=instance, instrument=device)


def bench(roles, *, safe_off=None, cut_paths=(), ports=("psu", "relay1")):
    """Return a bench with these role instances; all are made safe unless others are named."""
    states = {"supply": "off", "relays": "released", "gyroscope": "asleep"}
    made_safe = roles if safe_off is None else safe_off
    wires = [wire(name, "relay1" if name.startswith("relays") else "psu") for name in roles]
    instruments = (
        InstrumentSpec(name="psu", driver="acme-psu"),
        InstrumentSpec(name="relay1", driver="waveshare-relay"),
    )
    spec = SimpleNamespace(
        name="b",
        head=BenchHead(name="b", title="B"),
        wiring=tuple(wires),
        instruments=instruments,
        safe_off=tuple(SafeStep(output=name, state=states[name.partition(".")[0]], within_s=2.0) for name in made_safe),
        rest=(),
        hold=(),
        cut_paths=tuple(cut_paths),
        wire=lambda name: next(each for each in wires if each.name == name),
        instrument=lambda name: next(each for each in instruments if each.name == name),
    )
    return SimpleNamespace(
        spec=spec,
        roles=roles,
        drivers={name: object() for name in ("psu", "relay1")},
        descriptors=dict.fromkeys(ports, 0),
        where=dict.fromkeys(("psu", "relay1"), "/dev/ttyUSB0"),
        source=Source.HARDWARE,
    )


class Relays(Guardable):
    """Relays whose driver gives bytes."""

    def safe_bytes(self, state, proof=None):
        """Return them."""
        return self.code


CUT = CutPath(output="supply.foreign", by="relays", state="released", within_s=1.0)


def plan(found):
    """Return the plan of a bench."""
    return plan_of(found, Path("/run"), ["psu"])


@pytest.mark.parametrize(
    ("role", "why"),
    [
        (Foreign(), "it gives no safe_bytes"),
        (Guardable(None), "it gives no safe_bytes: no byte stops it"),
        (Guardable(SafeBytes(off=(), proof=(ASKED,))), "it gives safe_bytes without a command or a proof"),
        (Guardable(SafeBytes(off=(ASKED,), proof=())), "it gives safe_bytes without a command or a proof"),
        (Guardable(SafeBytes(off=(ASKED,), proof=(Exchange(send=b"?"),))), "it gives safe_bytes without a command or"),
    ],
)
def test_an_output_without_bytes_is_refused_or_cut_off(role, why):
    """The refusal names output, driver and what to do; a cut path through a guarded output will do."""
    roles = {"supply.foreign": role, "relays": Relays()}
    with pytest.raises(Refused) as refused:
        plan(bench(roles))
    assert f"the guardian cannot make supply.foreign safe: {why}" in str(refused.value)
    assert "driver acme-psu of psu" in str(refused.value)
    assert "`safe_bytes`" in refused.value.hint
    assert "`by`" in refused.value.hint
    covered = plan(bench(roles, cut_paths=[CUT]))
    assert covered.names == ("relays", "supply.foreign")
    assert [(each.output, each.cut_by) for each in covered.cut] == [("supply.foreign", ("relays",))]


def test_what_cuts_off_must_be_guarded_itself():
    """Two outputs without bytes do not vouch for each other, and hardware is nothing that the guardian can prove."""
    roles = {"supply.foreign": Foreign(), "relays": Foreign()}
    hardware = CutPath(output="supply.foreign", hardware="a fuse", within_s=1.0)
    with pytest.raises(Refused, match=r"supply.foreign safe.*; the guardian cannot make relays safe"):
        plan(bench(roles, cut_paths=[CUT, hardware]))


def test_an_output_that_no_line_of_the_safe_off_names_is_not_left_out():
    """Nobody would switch it off: neither the run nor the guardian."""
    with pytest.raises(Refused, match=r"supply.foreign safe: it is missing from safe_off \(driver acme-psu of psu\)"):
        plan(bench({"supply.foreign": Guardable(), "relays": Relays()}, safe_off=["relays"]))


def test_an_output_behind_a_bridge_is_out_of_the_guardians_reach():
    """It has bytes, and no port that could be passed on."""
    with pytest.raises(Refused, match="it has no port that the guardian could use"):
        plan(bench({"supply.foreign": Guardable(), "relays": Relays()}, ports=["relay1"]))


def test_what_does_no_harm_needs_no_guard_and_is_named():
    """A sensor drives nothing but itself."""
    found = bench({"supply.a": Guardable(), "gyroscope": Foreign()}, safe_off=["supply.a"])
    assert plan(found).names == ("supply.a",)
    assert harmless(found.spec, ("supply.a",)) == ("gyroscope",)


def test_a_sensor_that_the_safe_off_names_is_not_the_guardians():
    """It gives no bytes, and needs none; where its driver gives some, it is guarded like any output."""
    found = bench({"supply.a": Guardable(), "gyroscope": Foreign()})
    assert (plan(found).names, plan(found).cut) == (("supply.a",), ())
    assert harmless(found.spec, plan(found).names) == ("gyroscope",)
    given = bench({"gyroscope": Relays()})
    assert plan(given).names == ("gyroscope",)
    assert harmless(given.spec, plan(given).names) == ()


def test_a_bench_that_is_not_covered_is_not_armed(tmp_path):
    """The gate does not open, no guardian is started, and nothing is driven."""
    found = bench({"supply.foreign": Foreign()})
    guard = Guarding(found, SimpleNamespace(), StopFlags(), folder=tmp_path, leases=["psu"], locks=[])
    (gate,) = guard.begin(SimpleNamespace(fresh_until_ns=None))
    assert not gate.ok
    assert "the guardian cannot make supply.foreign safe" in gate.detail
    assert "safe_bytes" in gate.detail
