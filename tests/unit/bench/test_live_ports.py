"""Real ports are opened only where every one of them is the device that the bench file names."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import pytest

from hil.bench.file.reading import load_bench
from hil.bench.live import bind_live, reach_of_hardware
from hil.model.bench import UsbPort
from hil.model.errors import NoReply, Refused
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

    def refuse(name, *_):
        names.append(name)
        raise NoReply("opened", name)

    monkeypatch.setattr("hil.wire.live_stream.LiveStream", refuse)
    return names


def bind(monkeypatch, changes):
    """Bind the battery bench on hardware, with these boards in place of its own."""
    boards = [Listed(port, serial) for port, serial in {**SERIALS, **changes}.items()]
    monkeypatch.setattr("serial.tools.list_ports.comports", lambda: boards)
    bind_live(SPEC, reach_of_hardware(SPEC), "2026-01-01T00:00:00Z", Transcript(None))


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
