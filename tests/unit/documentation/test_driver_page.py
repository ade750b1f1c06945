"""The driver and the peer of the how-to work with each other."""

from __future__ import annotations

import math
import re
import runpy
import sys
from pathlib import Path

import pytest
from other_packages import install, uninstall

from hil.cli.main import main
from hil.instruments.driver import Clamps, Connection
from hil.instruments.registry import DRIVERS, ROLES
from hil.instruments.role import Argument, problem_with
from hil.instruments.roles import Magnetometer
from hil.model.bench import InstrumentSpec, Wire
from hil.model.errors import Refused
from hil.simulation.faults import read_faults
from hil.simulation.peers.model import Connections, PeerSetup
from hil.simulation.registry import FAULTS, PEERS, PLANTS
from hil.simulation.seeds import Seeds
from hil.simulation.truth import Truth

PAGE = Path(__file__).parents[3] / "docs/how-to/write-a-driver.md"


class Clock:
    """Stands still."""

    def now(self):
        """Return seconds since then."""
        return self.now_ns() / 1e9

    def now_ns(self):
        """Return the beginning."""
        return 0


class Bus:
    """Reaches one peer by what drivers call."""

    def __init__(self, peer):
        self.peer = peer

    def read_byte_data(self, address, register):
        """Return one register."""
        return self.read_i2c_block_data(address, register, 1)[0]

    def write_byte_data(self, address, register, value):
        """Write one register."""
        self.peer.write(address, bytes((register, value)))

    def read_i2c_block_data(self, address, register, count):
        """Return registers."""
        self.peer.write(address, bytes((register,)))
        return list(self.peer.read(address, count))


@pytest.fixture
def modules(tmp_path):
    """Return what the page's modules define."""
    found = []
    for number, code in enumerate(re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)):
        path = tmp_path / f"part_{number}.py"
        path.write_text(code, encoding="utf-8")
        found.append(runpy.run_path(str(path)))
    return found


def test_the_pages_driver_reads_the_pages_peer(modules):
    """It is identified, started, sampled and stopped, and goes on from its state."""
    theirs, simulated, *_ = modules
    instrument = InstrumentSpec(name="mag1", driver="acme-mag", bus="i2c", address=0x1C)
    truth = Truth({"field": ["20", "-5", "40"], "noise": "0"}, ())
    clock = Clock()
    nothing = Connections({}, {}, set(), ())
    setup = PeerSetup(instrument=instrument, truth=truth, connections=nothing)
    peer = simulated["MODEL"].build(setup)
    setup.finish()
    peer.attach(clock)
    connection = Connection(device="mag1", clock=clock, clamps=Clamps(), bus=Bus(peer), address=0x1C)
    driver = theirs["AcmeMag"](connection)
    assert str(driver.identify()) == "ACME-1"
    role = driver.role(Wire(role="magnetometer", instance="", instrument="mag1"))
    role.start()
    assert role.sample() == pytest.approx((20.0, -5.0, 40.0, 25.0))
    peer.restore(peer.state())
    assert role.sample() == pytest.approx((20.0, -5.0, 40.0, 25.0))
    role.stop()
    with pytest.raises(Refused, match="has not been started"):
        role.sample()
    for name in ("start", "stop", "sample"):
        assert getattr(type(role), name).effect == getattr(getattr(Magnetometer, name), "effect", "reads")
    with pytest.raises(Refused, match="does not fill the role supply"):
        driver.role(Wire(role="supply", instance="", instrument="mag1"))


def test_the_pages_role_plant_and_fault_are_what_they_should_be(modules):
    """The page's entry points name objects that are taken; the role says what it takes, the plant swings."""
    role, plant, _, faults = (
        each[name] for each, name in zip(modules[2:], ("COMPASS", "MODEL", "MODEL", "BadContact"), strict=True)
    )
    assert problem_with("compass", role) == ""
    assert role.operations["turn"].arguments["offset"] == Argument("offset", number=True, unit="deg")
    assert PLANTS._problem("magnet", plant) == ""
    assert FAULTS._problem("bad-contact", faults) == ""
    magnet = plant.build("magnet", 10_000_000, Truth({"swing": "10"}, ()))
    assert magnet.observe("heading") == pytest.approx(10.0)
    magnet.advance(3_000_000_000)
    assert magnet.observe("heading") == pytest.approx(10 * math.exp(-0.3) * math.cos(3.0), abs=1e-3)
    (always,) = read_faults([{"kind": "bad-contact", "share": "1"}], (), (faults,)).faults
    assert always.spoiled(b"abc", Seeds(0).stream("bus", "faults"), 5) == b"\xff\xff\xff"


def test_the_pages_heater_follows_its_supply_and_its_contact(modules):
    """By hand: 5 V at 10 ohm are 2.5 W, 5 K above the room at last; 0.1 A at most leaves 1 V; open, nothing flows."""
    model = modules[4]["MODEL"]
    assert PLANTS._problem("heater", model) == ""
    heater = model.build("heater", 10_000_000, Truth({}, ()))
    assert set(heater.ports) == {"supply"}
    heater.command(given=5.0, limit=1.0)
    heater.advance(200_000_000_000)
    assert heater.observe("current") == pytest.approx(0.5)
    assert heater.observe("plate") == pytest.approx(20.0 + 5.0 * (1.0 - math.exp(-1.0)))
    heater.command(limit=0.1)
    assert heater.observe("voltage") == pytest.approx(1.0)
    heater.command(contact=False)
    assert (heater.observe("voltage"), heater.observe("current")) == (5.0, 0.0)
    heater.command(contact=True)
    assert heater.observe("closings") == 1.0


def test_the_page_names_the_entry_points_of_its_parts():
    """Each group that is looked for is on the page."""
    page = PAGE.read_text(encoding="utf-8")
    for offers in (DRIVERS, ROLES, PEERS, PLANTS, FAULTS):
        assert f'[project.entry-points."{offers.group}"]' in page


@pytest.fixture
def acme(tmp_path):
    """Install the package that the page describes, made of what stands on it."""
    text = PAGE.read_text(encoding="utf-8")
    sources = tmp_path / "acme/src/acme_hil"
    sources.mkdir(parents=True)
    (sources / "__init__.py").touch()
    for name, code in re.findall(r"`src/acme_hil/(\w+\.py)`:\n\n```python\n(.*?)```", text, re.DOTALL):
        (sources / name).write_text(code, encoding="utf-8")
    project = tmp_path / "acme"
    (project / "pyproject.toml").write_text("\n".join(re.findall(r"```toml\n(.*?)```", text, re.DOTALL)), "utf-8")
    install(project, tmp_path / "site")
    yield text
    uninstall(project, tmp_path / "site")
    for name in [each for each in sys.modules if each.partition(".")[0] == "acme_hil"]:
        del sys.modules[name]  # a test of what this process has loaded may come next


def test_the_pages_bench_is_checked_as_it_says(acme, tmp_path, monkeypatch, capsys):
    """Followed to the letter: its bench file is whole, its commands print what stands there, its fault is seen."""
    section = acme.partition("## 5. ")[2]
    bench, peer = re.findall(r"```yaml\n(.*?)```", section, re.DOTALL)
    (tmp_path / "lab/fixtures/benches/desk").mkdir(parents=True)
    (tmp_path / "lab/hil.toml").touch()
    monkeypatch.chdir(tmp_path / "lab")
    faulty = re.sub(r"^ +mag1: \{truth.*\n", peer, bench, flags=re.MULTILINE)
    for text, said, ready in zip(
        (bench, faulty), re.findall(r"```console\n(.*?)```", section, re.DOTALL), (0, 1), strict=True
    ):
        Path("fixtures/benches/desk/bench.yaml").write_text(text, encoding="utf-8")
        command, _, expected = said.partition("\n")
        with pytest.raises(SystemExit) as left:
            main(command.removeprefix("$ hil ").split())
        assert (left.value.code, capsys.readouterr().out) == (ready, expected)
