"""The open ends of a served bench: pseudo-terminals, TCP ports, the control socket, and the folder."""

from __future__ import annotations

import json
import os
import socket

import pytest
from served import NetworkClient, SerialClient, bench_of, serving

from hil.bench.lease import Lease
from hil.model.errors import Refused
from hil.simulation.served.folder import CONTROL, ServedFolder, ask
from hil.wire.keys import keys_of, keys_of_served

RELAYS = bytes.fromhex("01 01 00 00 00 08 3D CC")


@pytest.fixture
def folder(tmp_path):
    """Return where a bench is served."""
    return tmp_path / "ends"


def told(server, client, document):
    """Ask one thing at the control socket."""
    client.write(json.dumps(document).encode() + b"\n")
    return json.loads(client.until(server, b"\n"))


def test_instruments_are_opened_by_link_and_by_port(folder):
    """A serial instrument answers at its link, one on a network at its port."""
    with serving(folder) as server:
        supply = NetworkClient(server.ends["psu1"].url)
        relays = SerialClient(folder / "relay1")
        supply.write(b"*IDN?\n")
        assert supply.until(server, b"\n").startswith(b"Keysight")
        relays.write(RELAYS)
        assert relays.until(server, b"\x01\x01\x01\x00\x51\x88") == b"\x01\x01\x01\x00\x51\x88"
        supply.close()
        relays.close()


def test_a_served_bench_is_one_also_for_who_reaches_it_through_loopback(folder, tmp_path):
    """A run by its folder and one by the port of an instrument exclude each other; nothing of it stays afterwards."""
    with serving(folder) as server:
        by_port = keys_of(server.ends["psu1"].url.replace("127.0.0.1", "localhost"))
        for first, second in ((keys_of_served(folder), by_port), (by_port, keys_of_served(folder))):
            held = Lease(first, "a run of one", tmp_path / "leases")
            with pytest.raises(Refused, match="served bench .* is held by a run of one"):
                Lease(second, "a run of another", tmp_path / "leases")
            held.release()
        url = server.ends["psu1"].url
    assert not set(keys_of(url)) & set(keys_of_served(folder))


def test_a_terminal_is_raw_also_for_a_client_that_sets_nothing(folder):
    """No byte is translated or echoed, for the first client and for those after it."""
    with serving(folder) as server:
        for _ in range(2):
            plain = os.open(folder / "relay1", os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            os.write(plain, RELAYS)
            came = b""
            for _ in range(200):
                server.turn()
                try:
                    came += os.read(plain, 100)
                except BlockingIOError:
                    continue
            assert came == b"\x01\x01\x01\x00\x51\x88"
            os.close(plain)
            closed(server, "relay1")


def closed(server, device):
    """Let the server notice that a client has gone."""
    for _ in range(200):
        server.turn()
        if not server.ends[device].line.is_open:
            return
    raise AssertionError(device)


def test_opening_a_port_after_a_closing_is_noticed(folder):
    """A tester that is reset by DTR starts over whenever its port is opened, and only then."""
    with serving(folder, "battery") as server:
        control = NetworkClient(folder / CONTROL)
        for _ in range(2):
            client = SerialClient(folder / "cycler1")
            assert client.until(server, b"\n").startswith(b"START ARDUINO")
            for _ in range(100):
                server.turn()
            assert told(server, control, {"state": "lines.cycler1.open"}) == {"state": True}
            assert b"START" not in client.fetch()
            client.close()
            closed(server, "cycler1")
        control.close()


def test_what_one_client_did_not_read_is_not_for_the_next(folder):
    """A client that goes away takes its unread bytes along."""
    with serving(folder) as server:
        first = SerialClient(folder / "table1")
        first.write(b"VE?\r\n")
        for _ in range(200):
            server.turn()
        first.close()
        closed(server, "table1")
        second = SerialClient(folder / "table1")
        for _ in range(100):
            server.turn()
        assert second.fetch() == b""
        second.close()


def test_a_client_that_writes_and_closes_at_once_is_heard(folder):
    """What was written before a closing reaches the instrument."""
    with serving(folder) as server:
        client = SerialClient(folder / "relay1")
        client.write(bytes.fromhex("01 05 00 00 FF 00 8C 3A"))
        client.close()
        control = NetworkClient(folder / CONTROL)
        for _ in range(300):
            server.turn()
        assert told(server, control, {"state": "peers.relay1.coils.0"}) == {"state": True}
        control.close()


def test_a_second_client_of_a_network_port_is_hung_up_on(folder):
    """The first one keeps its connection; after it has gone the next one is taken."""
    with serving(folder) as server:
        first, second = (NetworkClient(server.ends["psu1"].url) for _ in range(2))
        first.write(b"*IDN?\n")
        assert first.until(server, b"\n")
        with pytest.raises(AssertionError):
            second.write(b"*IDN?\n")
            second.until(server, b"\n", turns=50)
        first.close()
        closed(server, "psu1")
        third = NetworkClient(server.ends["psu1"].url)
        third.write(b"*IDN?\n")
        assert third.until(server, b"\n").startswith(b"Keysight")
        second.close()
        third.close()


def test_a_flood_waits_in_the_operating_system(folder):
    """A client that writes without end is taken from at the line's speed, and others are answered meanwhile."""
    with serving(folder) as server:
        flood, relays = NetworkClient(server.ends["psu1"].url), SerialClient(folder / "relay1")
        began = server.ends["psu1"].line
        sent = 0
        for _ in range(300):
            sent += flood.write(b"*IDN?;" * 1000)
            server.turn()
        assert sent > 200_000
        assert began.is_open
        relays.write(RELAYS)
        assert relays.until(server, b"\x01\x01\x01\x00\x51\x88")
        flood.close()
        relays.close()


def test_what_a_client_does_not_fetch_overflows(folder):
    """A server that cannot get rid of its bytes drops and counts them, and goes on."""
    with serving(folder) as server:
        lazy, control = SerialClient(folder / "obc1"), NetworkClient(folder / CONTROL)
        line = server.ends["obc1"].line
        for _ in range(2000):
            server.turn()
            line.send(b"x" * 256)
            if line.lost:
                break
        assert told(server, control, {"state": "lines.obc1.lost"})["state"] > 0
        assert len(lazy.fetch()) > 1000
        lazy.close()
        control.close()


def test_the_control_socket_tells_injects_and_stops(folder):
    """Time, ends, state, faults and the end, each with one line."""
    with serving(folder, speed=20.0) as server:
        control = NetworkClient(folder / CONTROL)
        time = told(server, control, {"time": None})["time"]
        assert time["speed"] == 20.0
        assert time["utc"].startswith("2026-01-01T08:00:")
        assert told(server, control, {"ends": None})["ends"]["relay1"] == str(folder / "relay1")
        assert told(server, control, {"fault": {"device": "relay1", "kind": "welded", "contact": "1"}}) == {
            "fault": True
        }
        assert told(server, control, {"stop": True}) == {"stop": True}
        server.run()
        control.close()
    assert not folder.exists()


def test_the_control_socket_connects_what_a_person_would(folder):
    """The plant that the bench file maps to the question gets it, or loses what it has; also after a fault came."""
    with serving(folder) as server:
        control = NetworkClient(folder / CONTROL)
        told(server, control, {"fault": {"device": "relay1", "kind": "welded", "contact": "1"}})
        for thing, there in (("x_plus", "x_plus"), ("none", ""), ("y_minus", "y_minus")):
            asked = {"connect": {"name": "outer-board", "thing": thing}}
            assert told(server, control, asked) == {"connect": True}
            assert told(server, control, {"state": "plants.coil.board"}) == {"state": there}
        control.close()


def test_an_end_that_is_unplugged_hangs_up_and_comes_back(folder):
    """A client sees the hang-up, nobody can open it until it is plugged again, and the instrument goes on as it was."""
    with serving(folder) as server:
        control = NetworkClient(folder / CONTROL)
        supply, relays = NetworkClient(server.ends["psu1"].url), SerialClient(folder / "relay1")
        relays.write(bytes.fromhex("01 05 00 00 FF 00 8C 3A"))
        assert relays.until(server, b"\x8c\x3a")
        for name in ("psu1", "relay1", "relay1"):
            assert told(server, control, {"unplug": name}) == {"unplug": True}
        with pytest.raises(OSError, match="Input/output error"):
            os.write(relays.descriptor, b"x")
        assert supply.socket.recv(10) == b""
        with pytest.raises(ConnectionRefusedError):
            NetworkClient(server.ends["psu1"].url)
        assert not (folder / "relay1").is_symlink()
        relays.close()
        supply.close()
        for name in ("psu1", "relay1", "relay1"):
            assert told(server, control, {"plug": name}) == {"plug": True}
        supply, relays = NetworkClient(server.ends["psu1"].url), SerialClient(folder / "relay1")
        supply.write(b"*IDN?\n")
        assert supply.until(server, b"\n").startswith(b"Keysight")
        relays.write(RELAYS)
        assert relays.until(server, b"\x01\x01\x01\x01\x90\x48")
        assert "error" in told(server, control, {"plug": "relay9"})
        for client in (supply, relays, control):
            client.close()


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (b"nonsense\n", "not a JSON document"),
        (b"[" * 50_000 + b"\n", "not a JSON document"),
        (b"\xff\xfe\n", "not a JSON document"),
        (b"[]\n", "not a JSON object"),
        (b"{}\n", "one key"),
        (b'{"stat": ""}\n', "did you mean 'state'"),
        (b'{"state": 3}\n', "by a path"),
        (b'{"state": "plants.x"}\n', "there is no 'x'"),
        (b'{"fault": "dead"}\n', "names its device"),
        (b'{"unplug": "relay"}\n', "did you mean 'relay1'"),
        (b'{"connect": "x_plus"}\n', "the name of its question"),
        (b'{"connect": {"name": "outer-board", "thing": "w_plus"}}\n', "has no 'w_plus'"),
        (b'{"connect": {"name": "inner-board", "thing": "x_plus"}}\n', "does not know what 'inner-board' is"),
        (b'{"plug": ["psu1"]}\n', "no end"),
        (b'{"fault": {"device": "psu1", "kind": ["dead"]}}\n', "unknown fault"),
    ],
)
def test_what_cannot_be_answered_is_an_error_and_no_end(folder, line, message):
    """A wrong document gets an answer that says so, with what to do, and the next one is answered as ever."""
    with serving(folder) as server:
        control = NetworkClient(folder / CONTROL)
        while line:
            line = line[control.write(line) :]
            server.turn()
        answer = json.loads(control.until(server, b"\n"))
        assert message in answer["error"]
        assert answer["hint"]
        assert "time" in told(server, control, {"time": None})
        control.close()


def test_a_line_without_end_is_hung_up_on(folder):
    """A client that never ends its line is not listened to for ever."""
    with serving(folder) as server:
        endless, control = NetworkClient(folder / CONTROL), NetworkClient(folder / CONTROL)
        with pytest.raises((BrokenPipeError, ConnectionResetError)):
            for _ in range(2000):
                endless.write(b"x" * 4096)
                server.turn()
        assert "time" in told(server, control, {"time": None})
        endless.close()
        control.close()


def test_a_client_that_does_not_fetch_its_answers_stops_nobody(folder):
    """Whoever asks and asks and never reads waits alone."""
    with serving(folder) as server:
        lazy, control = NetworkClient(folder / CONTROL), NetworkClient(folder / CONTROL)
        for _ in range(200):
            lazy.write(b'{"state": ""}\n' * 20)
            server.turn()
        assert "time" in told(server, control, {"time": None})
        lazy.close()
        for _ in range(50):
            server.turn()
        assert "time" in told(server, control, {"time": None})
        control.close()


def test_a_folder_is_served_by_one_server(folder):
    """A second server is refused, also for another bench, and the first one goes on."""
    with serving(folder) as server:
        with pytest.raises(Refused, match="another server"):
            serving(folder, "battery")
        relays = SerialClient(folder / "relay1")
        relays.write(RELAYS)
        assert relays.until(server, b"\x01\x01\x01\x00\x51\x88")
        relays.close()
    with serving(folder):
        pass


def test_what_a_killed_server_left_is_in_nobodys_way(folder):
    """Dangling links and a dead socket are replaced, and a folder that was there stays."""
    folder.mkdir()
    (folder / "relay1").symlink_to("/dev/pts/99999")
    with socket.socket(socket.AF_UNIX) as dead:
        dead.bind(str(folder / CONTROL))
    with serving(folder) as server:
        assert (folder / "relay1").readlink() != "/dev/pts/99999"
        control = NetworkClient(folder / CONTROL)
        assert "time" in told(server, control, {"time": None})
        control.close()
    assert list(folder.iterdir()) == []


@pytest.mark.parametrize("name", ["relay1", CONTROL])
def test_a_file_in_the_way_is_left_alone(folder, name):
    """What is neither a link nor a socket belongs to somebody; nothing is replaced."""
    folder.mkdir()
    (folder / name).write_text("mine", encoding="utf-8")
    with pytest.raises(Refused, match="in the way"):
        serving(folder)
    assert [(path.name, path.read_text(encoding="utf-8")) for path in folder.iterdir()] == [(name, "mine")]


def test_folders_that_cannot_be_used_are_refused(tmp_path):
    """A file, a name too long for a socket, and a port that is in use say what to do instead."""
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(Refused, match="cannot be used"):
        serving(tmp_path / "file")
    with pytest.raises(Refused, match="too long"):
        serving(tmp_path / ("x" * 120))
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(Refused, match=f"port {port} is not available"):
            serving(tmp_path / "ends", first_port=port)
    assert not (tmp_path / "ends").exists()


def test_no_instrument_can_take_the_sockets_name(folder):
    """A serial instrument with the name of the socket would replace it."""
    with pytest.raises(Refused, match="named as the socket"):
        ServedFolder(folder, ("psu1", CONTROL))


@pytest.mark.parametrize(
    ("left", "why"),
    [
        ("nothing", "the folder does not exist; its server has ended, or you meant another folder"),
        ("folder", "its server has ended, or has not begun"),
        ("file", "Not a directory"),
        ("socket", "its server was killed"),
    ],
)
def test_asking_where_nobody_serves_any_more_says_where_what_and_what_to_do(folder, left, why):
    """A server takes its folder along as it ends, and leaves its socket if it is killed."""
    if left == "file":
        folder.touch()
    elif left != "nothing":
        folder.mkdir()
    if left == "socket":
        with socket.socket(socket.AF_UNIX) as killed:
            killed.bind(str(folder / CONTROL))
    with pytest.raises(Refused) as refused:
        ask(folder, {"time": None}, bench="adcs")
    assert str(refused.value).startswith(f"no served bench answers in {folder}: {why}")
    assert refused.value.hint == (
        f"start it again with: hil simulate adcs --folder {folder}; hil status shows how far a run on it got"
    )


def test_network_instruments_listen_from_the_first_port_on(folder):
    """A bench file for foreign clients can name the port."""
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    with serving(folder, first_port=port) as server:
        assert server.ends["psu1"].url == f"socket://127.0.0.1:{port}"


def test_a_bench_of_the_workspace_is_what_is_served():
    """Both benches have a twin, and a line for every instrument that is no device on a bus."""
    assert set(bench_of("adcs").lines) == {"psu1", "relay1", "obc1", "tec1", "table1"}
    assert set(bench_of("battery").lines) == {"psu1", "cycler1", "tec1", "psu2"}
