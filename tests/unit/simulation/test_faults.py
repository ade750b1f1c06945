"""Kinds of faults: each with its own parameters, those of a link from any package."""

from __future__ import annotations

from dataclasses import dataclass

import pytest

from hil.simulation.faults import Dead, Fault, Faults, Garbled, LinkFault, Partial, Saturated, read_faults
from hil.simulation.peers.faulty import FaultyBusPeer
from hil.simulation.peers.supply_output import RefuseOff
from hil.simulation.registry import FAULTS, PEERS, fault_kinds
from hil.simulation.seeds import Seeds
from hil.simulation.truth import TruthError


@dataclass(frozen=True, slots=True, kw_only=True)
class Low(LinkFault):
    """The data line is held low."""

    name = "low"
    links = frozenset({"bus"})

    def spoiled(self, data, noise, now_ns):
        """Return zeros."""
        return bytes(len(data))


class Ones:
    """A device that gives ones."""

    addresses = (8,)

    def attach(self, clock):
        """Need no clock."""

    def read(self, address, count):
        """Return ones."""
        return b"\xff" * count


class Clock:
    """Stands where it is put."""

    at = 0

    def now_ns(self):
        """Return where."""
        return self.at


def test_a_fault_has_the_parameters_of_its_kind():
    """The keys of a bench file, its durations in ns, and defaults."""
    rows = [{"kind": "refuse-off", "channel": "2", "from": "1.5 s", "until": "2 s"}, {"kind": "saturated"}]
    refused, saturated = read_faults(rows, (), (RefuseOff, Saturated)).faults
    assert refused == RefuseOff(kind="refuse-off", channel=2, start_ns=1_500_000_000, end_ns=2_000_000_000)
    assert saturated == Saturated(kind="saturated")
    assert (saturated.added, saturated.holds(0), refused.holds(0)) == (5000.0, True, False)


def test_a_part_asks_for_its_own_fault():
    """One of channel 0 hits all; the first one that holds is given."""
    faults = Faults((RefuseOff(channel=2, end_ns=5), RefuseOff(channel=0, start_ns=3, says="off")))
    assert faults.now(RefuseOff, 0, 2).says == "on"
    assert faults.now(RefuseOff, 0, 1) is None
    assert faults.now(RefuseOff, 4, 1).says == "off"
    assert faults.now(RefuseOff, 4).channel == 2
    assert faults.of(Dead) == ()


@pytest.mark.parametrize(
    ("row", "path", "message"),
    [
        ({}, ("faults", 0), "key 'kind' is missing"),
        ({"kind": "garbld"}, ("faults", 0, "kind"), "unknown fault 'garbld', did you mean 'garbled'"),
        ({"kind": "garbled", "shar": "1"}, ("faults", 0, "shar"), "unknown key 'shar', did you mean 'share'"),
        ({"kind": "garbled", "share": "1.1"}, ("faults", 0, "share"), "must be at most 1"),
        ({"kind": "garbled", "until": "101 d 2"}, ("faults", 0, "until"), "must be a duration"),
        ({"kind": "garbled", "until": "40000 d"}, ("faults", 0, "until"), "must be at most a century"),
        ({"kind": "partial", "share": "1"}, ("faults", 0, "share"), "unknown key 'share'"),
    ],
)
def test_what_is_wrong_is_told_at_its_place(row, path, message):
    """A parameter of another kind is unknown."""
    with pytest.raises(TruthError, match=message) as caught:
        read_faults([row], ("faults",), (Garbled, Partial))
    assert caught.value.path == path


def test_a_kind_of_another_package_hits_any_device_of_its_link():
    """The wrapper asks the fault itself; it knows no kind by name."""
    clock = Clock()
    peer = FaultyBusPeer(Ones(), Faults((Low(start_ns=1, end_ns=2),)), Seeds(0).stream("one", "faults"))
    peer.attach(clock)
    assert peer.read(8, 3) == b"\xff\xff\xff"
    clock.at = 1
    assert peer.read(8, 3) == b"\0\0\0"


def test_each_link_has_its_kinds():
    """Ours are entry points like everybody's."""
    assert {"chatty", "dead", "garbled", "late", "partial"} <= set(FAULTS)
    assert {kind.name for kind in fault_kinds(PEERS["lis3mdl"])} >= {"dead", "garbled", "identity", "stuck"}
    assert "chatty" not in {kind.name for kind in fault_kinds(PEERS["lis3mdl"])}


@pytest.mark.parametrize(
    ("name", "found", "problem"),
    [
        ("low", Low, ""),
        ("high", Low, "calls itself 'low'"),
        ("one", 3, "is 3, not a LinkFault"),
        ("saturated", Saturated, "is <class 'hil.simulation.faults.Saturated'>, not a LinkFault"),
        ("", LinkFault, "hits devices on no link: name some in 'links'"),
        ("", Fault, "is <class 'hil.simulation.faults.Fault'>, not a LinkFault"),
    ],
)
def test_what_is_no_link_fault_is_told(name, found, problem):
    """An entry point that names something else is refused in these words."""
    assert FAULTS._problem(name, found) == problem
