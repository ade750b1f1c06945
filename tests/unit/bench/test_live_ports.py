"""Real ports are opened only where every one of them is the device that the bench file names."""

from __future__ import annotations

import os
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from unittest.mock import Mock

import pytest

from hil.bench.file.reading import load_bench
from hil.bench.live import Opened, Reach, bind_live, reach_of_hardware, require_boards
from hil.bench.port_identity import WrongPort, port_gates
from hil.model.bench import UsbPort
from hil.model.errors import NoReply, Refused
from hil.model.identity import Source
from hil.wire.live_stream import LiveStream
from hil.wire.transcript import Transcript

ROOT = Path(__file__).parents[3]
FILE = load_bench(ROOT / "fixtures" / "benches", "battery", ROOT)
# Links of /dev/serial/by-path cannot be made here: what is told by its place has a number in these tests.
SPEC = replace(
    FILE,
    instruments=tuple(
        replace(item, usb=UsbPort(serial="KORAD")) if item.usb and item.usb.path else item for item in FILE.instruments
    ),
)
SERIALS = {item.port: item.usb.serial for item in SPEC.instruments if item.usb}


@dataclass
class Listed:
    """A port as pyserial lists it."""

    device: str
    serial_number: str | None
    product: str = "a board"
    location: str | None = None


@pytest.fixture
def opened(monkeypatch):
    """Return which ports were opened; none can be."""
    names = []

    def refuse(name, *_, **__):
        names.append(name)
        raise NoReply("opened", name)

    monkeypatch.setattr("hil.wire.live_stream.LiveStream", refuse)
    return names


def bind(monkeypatch, changes, **options):
    """Bind the battery bench on hardware, with these boards in place of its own."""
    boards = [Listed(port, serial) for port, serial in {**SERIALS, **changes}.items()]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: boards)
    reach = reach_of_hardware(SPEC)
    return bind_live(SPEC, reach, "2026-01-01T00:00:00Z", Transcript(None), Opened(SPEC, reach, **options))


@pytest.mark.parametrize("port", sorted(SERIALS))
def test_no_port_is_opened_beside_another_board(monkeypatch, opened, port):
    """One board that is not its own keeps all ports closed: a first byte may start something there."""
    with pytest.raises(Refused, match="a board, serial 1234, expected serial"):
        bind(monkeypatch, {port: "1234"})
    assert opened == []


def test_the_right_boards_are_opened(monkeypatch, opened):
    """What keeps them closed above is nothing but the other board."""
    with pytest.raises(NoReply):
        bind(monkeypatch, {})
    assert opened == ["psu1"]


def test_by_force_the_other_ports_are_opened(monkeypatch):
    """Another board's port stays closed, and one that is gone is no reason not to reach the rest."""
    opened = {}

    def stream(name, *_, alone):
        if name == "psu1":
            raise NoReply("psu1", "is gone")
        opened[name] = alone
        return Mock()

    monkeypatch.setattr("hil.wire.live_stream.LiveStream", stream)
    other = next(item.port for item in SPEC.instruments if item.name == "tec1")
    with closing(bind(monkeypatch, {other: "1234"}, by_force=True)) as bench:
        assert opened == {"cycler1": False, "psu2": False}
        assert set(bench.descriptors) == set(opened)
        with pytest.raises(Refused, match="port of tec1.*expected serial"):
            bench.roles["thermal"].standby()
        with pytest.raises(NoReply, match="is gone"):
            bench.roles["supply.charge"].disable()


def test_a_port_that_another_process_holds_is_opened_by_force_only():
    """Whoever hangs with a port open does not keep it from whoever makes its bench safe."""
    ours, theirs = os.openpty()
    name = os.ttyname(theirs)
    with closing(LiveStream("hung", name)._serial):
        with pytest.raises(NoReply, match="cannot be opened"):
            LiveStream("psu2", name)
        with closing(LiveStream("psu2", name, alone=False)._serial) as second:
            second.write(b"OUT0")
            assert os.read(ours, 4) == b"OUT0"
    os.close(ours)
    os.close(theirs)


def test_every_port_that_is_not_there_is_named(monkeypatch):
    """Who plugs the boards in does it once."""
    monkeypatch.setattr("hil.bench.live.port_gates", lambda spec: port_gates(spec, list))
    with pytest.raises(WrongPort) as refused:
        bind_live(SPEC, reach_of_hardware(SPEC), "2026-01-01T00:00:00Z", Transcript(None))
    assert [gate.name for gate in refused.value.gates] == [
        f"port of {item.name}" for item in SPEC.instruments if item.usb
    ]


@pytest.mark.parametrize(
    "url", ["spy:///dev/null?file={}", "loop://?{}", "alt:///dev/null?{}", "SPY:///dev/null?file={}"]
)
def test_a_stream_of_another_scheme_is_never_opened(tmp_path, url):
    """Whoever asks for it: `spy://` would write a file on the way to a device that nobody compared."""
    written = tmp_path / "written"
    with pytest.raises(Refused, match="is never opened"):
        LiveStream("psu1", url.format(written))
    assert not written.exists()


def test_a_bus_that_is_not_there_is_told_before_anything_is_opened(tmp_path):
    """There is no folder of a run then; a device file that is there is opened and closed, and nothing is sent."""
    there = tmp_path / "i2c-1"
    there.touch()
    reach = Reach(source=Source.HARDWARE, ports={}, buses={"flight": str(there), "jig": "/dev/i2c-99"})
    with pytest.raises(WrongPort) as told:
        require_boards(replace(SPEC, instruments=()), reach)
    assert [gate.name for gate in told.value.gates] == ["bus jig"]
    assert "/dev/i2c-99 cannot be opened: " in str(told.value)
    require_boards(replace(SPEC, instruments=()), replace(reach, buses={"flight": str(there)}))
