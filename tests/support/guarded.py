"""Instruments that a test holds the far ends of, guard plans for them, and an executive in a process of its own."""

from __future__ import annotations

import json
import os
import queue
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from contextlib import ExitStack, suppress
from pathlib import Path

from hil.guardian.plan_codec import written_plan
from hil.model.safing import Exchange, GuardedOutput, GuardedPort, GuardPlan, SafeBytes

__all__ = [
    "DistantInstrument",
    "Executive",
    "Instrument",
    "NetworkInstrument",
    "code",
    "lines_of",
    "output_of",
    "plan_of",
    "until",
]

_PROGRAM = Path(__file__).with_name("guarded_executive.py")
_LONGEST_S = 20.0


def code(channel: int = 1, within_s: float = 0.2) -> SafeBytes:
    """Return how one channel of an instrument of this module is made safe."""
    return SafeBytes(
        resync=(Exchange(send=b"\n"), Exchange(send=b"SYNC\n", expect=rb"synced\n", within_s=within_s)),
        off=(Exchange(send=b"OFF %d\n" % channel, expect=rb"done %d\n" % channel, within_s=within_s),),
        proof=(
            Exchange(send=b"ON? %d\n" % channel, expect=rb"on %d no\n" % channel, within_s=within_s),
            Exchange(
                send=b"CURR? %d\n" % channel,
                expect=rb"current %d ([-0-9.]+)\n" % channel,
                within_s=within_s,
                between=(-0.05, 0.05),
            ),
        ),
        owed_s=within_s,
        who=Exchange(send=b"WHO?\n", expect=rb"i am [^\n]+\n", within_s=within_s),
    )


def output_of(name: str, device: str, channel: int = 1, **more) -> GuardedOutput:
    """Return an output of such an instrument."""
    return GuardedOutput(
        output=name,
        state="off",
        device=device,
        within_s=more.pop("within_s", 1.0),
        code=code(channel, more.pop("reply_s", 0.2)),
        **more,
    )


def plan_of(folder: Path, *outputs: GuardedOutput, urls: dict[str, str] | None = None, **more) -> GuardPlan:
    """Return a plan whose latch and journal lie in a folder."""
    urls = urls or {}
    devices = dict.fromkeys(output.device for output in outputs)
    return GuardPlan(
        bench="bench",
        run=str(folder),
        ports=tuple(GuardedPort(device=device, url=urls.get(device, ""), baud=115_200) for device in devices),
        outputs=outputs,
        latches=(str(folder / "latches" / "one.latch"),),
        journal=str(folder / "guardian.jsonl"),
        **more,
    )


def lines_of(plan: GuardPlan) -> list[dict]:
    """Return what the guardian wrote down."""
    path = Path(plan.journal)
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


class Instrument:
    """Several outputs behind a pseudo-terminal, answered by a thread. All of them are on at first.

    Attributes:
        on: the channels that are on.
        heard: every command with the instant at which it came.
        dead: it reads and says nothing.
        refuses: it says that an output is off and leaves it on.
        chatter: what it says by itself before every reply.
        name: what it says that it is.
    """

    name = b"psu 1"

    def __init__(self, channels: int = 1) -> None:
        self.on = set(range(1, channels + 1))
        self.heard: list[tuple[float, bytes]] = []
        self.dead = False
        self.refuses = False
        self.chatter = b""
        self.changed = threading.Condition()
        self._buffer = b""
        self._ended, self._end = os.pipe()
        self.url = self._open()
        self._thread = threading.Thread(target=self._serve, daemon=True)
        self._thread.start()

    def _open(self) -> str:
        self._far, self.near = os.openpty()
        tty.setraw(self.near)
        return os.ttyname(self.near)

    def close(self) -> None:
        """Be gone, as a pulled plug is."""
        if self._end >= 0:
            os.close(self._end)
            self._end = -1
            self._thread.join(_LONGEST_S)
            os.close(self._ended)
            self._close()

    def _close(self) -> None:
        os.close(self._far)
        os.close(self.near)

    def said(self, command: bytes) -> list[float]:
        """Return when a command came."""
        return [at for at, each in self.heard if each == command]

    def wait(self, holds, seconds: float = _LONGEST_S) -> None:
        """Wait until something holds of this instrument."""
        with self.changed:
            assert self.changed.wait_for(holds, seconds), self.heard

    def _serve(self) -> None:
        while True:
            ready, _, _ = select.select([self._ended, *self._sources()], [], [])
            if self._ended in ready:
                return
            self._take(self._read())

    def _sources(self) -> list[int]:
        return [self._far]

    def _read(self) -> bytes:
        return os.read(self._far, 4096)

    def _write(self, data: bytes) -> None:
        os.write(self._far, data)

    def _take(self, data: bytes) -> None:
        *lines, self._buffer = (self._buffer + data).split(b"\n")
        with self.changed:
            for line in lines:
                self.heard.append((time.monotonic(), line))
                if not self.dead:
                    self._write(self.chatter + self._reply(line))
            self.changed.notify_all()

    def _reply(self, line: bytes) -> bytes:
        word, _, number = line.partition(b" ")
        if word in {b"WHO?", b"SYNC"}:
            return b"i am %b\n" % self.name if word == b"WHO?" else b"synced\n"
        if word == b"OFF":
            if not self.refuses:
                self.on.discard(int(number))
            return b"done %b\n" % number
        if word == b"ON":
            self.on.add(int(number))
            return b""
        if word == b"ON?":
            return b"on %b %b\n" % (number, b"yes" if int(number) in self.on else b"no")
        if word == b"CURR?":
            return b"current %b %b\n" % (number, b"1.25" if int(number) in self.on else b"0.003")
        return b"what?\n" if line else b""


class DistantInstrument(Instrument):
    """The same at the end of a long line: every reply comes later, in order.

    Attributes:
        latency_s: by how much.
    """

    def _open(self) -> str:
        self.latency_s = 0.0
        self._coming: queue.SimpleQueue[tuple[float, bytes] | None] = queue.SimpleQueue()
        self._carrier = threading.Thread(target=self._carry, daemon=True)
        url = super()._open()
        self._carrier.start()
        return url

    def _write(self, data: bytes) -> None:
        if data:
            self._coming.put((time.monotonic() + self.latency_s, data))

    def _carry(self) -> None:
        while (found := self._coming.get()) is not None:
            due, data = found
            time.sleep(max(due - time.monotonic(), 0.0))
            os.write(self._far, data)

    def _close(self) -> None:
        self._coming.put(None)
        self._carrier.join(_LONGEST_S)
        super()._close()


class NetworkInstrument(Instrument):
    """The same behind a TCP port with one client at a time.

    Attributes:
        clients: how many have connected so far.
    """

    port = 0

    def _open(self) -> str:
        self.clients = 0
        self._client: socket.socket | None = None
        self._listener = socket.create_server(("127.0.0.1", self.port))
        return f"socket://127.0.0.1:{self._listener.getsockname()[1]}"

    def hang_up(self) -> None:
        """Close the connection, and accept the next one."""
        with self.changed:
            client, self._client = self._client, None
            client.shutdown(socket.SHUT_RDWR)
            client.close()

    def _sources(self) -> list[int]:
        return [(self._client or self._listener).fileno()]

    def _read(self) -> bytes:
        with self.changed:
            if self._client is None:
                self._client, _ = self._listener.accept()
                self.clients += 1
                self.changed.notify_all()
            data = self._client.recv(4096)
            if not data:
                self._client.close()
                self._client = None
            return data

    def _write(self, data: bytes) -> None:
        if self._client:
            self._client.sendall(data)

    def _close(self) -> None:
        self._listener.close()
        if self._client:
            self._client.close()


class Executive:
    """A process that has a guardian, and does what it is told in lines."""

    def __init__(self, plan: GuardPlan, urls: dict[str, str], stack: ExitStack) -> None:
        self.process = subprocess.Popen(
            [sys.executable, str(_PROGRAM), written_plan(plan).decode(), json.dumps(urls)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
        )
        stack.callback(self._end)
        self.guardian = self.ask("start")["pid"]
        self.watched = os.pidfd_open(self.guardian)
        stack.callback(os.close, self.watched)
        stack.callback(self._end_guardian)

    def tell(self, word: str, **told) -> None:
        """Tell it to do something."""
        self.process.stdin.write(json.dumps({"do": word, **told}).encode() + b"\n")
        self.process.stdin.flush()

    def ask(self, word: str, **told) -> dict:
        """Tell it to do something, and return what it says."""
        self.tell(word, **told)
        return self.hear()

    def hear(self) -> dict:
        """Return the next thing that it says."""
        poll = select.poll()
        poll.register(self.process.stdout, select.POLLIN)
        assert poll.poll(_LONGEST_S * 1000), "it says nothing"
        return json.loads(self.process.stdout.readline())

    def arm(self) -> None:
        """Have it watched, and beat by itself."""
        assert self.ask("watch") == {"ok": True}
        assert self.ask("beats") == {"ok": True}

    def wait_for_guardian(self) -> None:
        """Wait until the guardian has ended."""
        assert until(self.watched), "the guardian does not end"

    def wait_for_words(self) -> str:
        """Return what the guardian says on standard error once it has acted and written everything down."""
        came = b""
        while b"hil guardian: " not in came or not came.endswith(b"\n"):
            assert until(self.process.stderr.fileno()), came
            came += os.read(self.process.stderr.fileno(), 4096)
        return came.decode()

    def wait(self) -> int:
        """Wait until it has ended; return its exit code."""
        return self.process.wait(_LONGEST_S)

    def _end_guardian(self) -> None:
        with suppress(ProcessLookupError):
            signal.pidfd_send_signal(self.watched, signal.SIGKILL)
        assert until(self.watched)

    def _end(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        with suppress(BrokenPipeError):
            self.process.stdin.close()
        self.process.stdout.close()
        self.process.stderr.close()
        self.process.wait(_LONGEST_S)


def until(descriptor: int, seconds: float = _LONGEST_S) -> bool:
    """Wait until a descriptor has something to say."""
    poll = select.poll()
    poll.register(descriptor, select.POLLIN)
    return bool(poll.poll(seconds * 1000))
