"""An executive for tests of the guardian: a program that does what lines on its standard input say."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import sys
import time
import tty
from dataclasses import asdict

from hil.guardian.client import Guardian
from hil.guardian.plan_codec import read_plan
from hil.model.errors import HilError

BETWEEN_BEATS_S = 0.05


def opened(url: str) -> int:
    """Open a terminal or a connection, without waiting, as pyserial does."""
    if url.startswith("socket://"):
        host, _, port = url.removeprefix("socket://").partition(":")
        connected = socket.create_connection((host, int(port)))
        connected.setblocking(False)
        return connected.detach()
    descriptor = os.open(url, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    tty.setraw(descriptor)
    return descriptor


class Executive:
    """Does things by their names.

    Attributes:
        ports: open descriptors by device.
        beating: whether a beat is sent now and then.
    """

    def __init__(self, plan: str, urls: str) -> None:
        self.plan = read_plan(plan.encode())
        self.ports = {device: opened(url) for device, url in json.loads(urls).items()}
        self.beating = False
        self.fresh_s = 10.0
        self.guardian: Guardian

    def start(self) -> dict:
        """Start the guardian."""
        self.guardian = Guardian.start(self.plan, self.ports)
        return {"pid": self.guardian.pid}

    def watch(self) -> dict:
        """Have it watch."""
        self.guardian.watch()
        return {"ok": True}

    def beats(self, fresh_s: float = 10.0) -> dict:
        """Beat from now on; with `fresh_s` below zero with something stale."""
        self.beating, self.fresh_s = True, fresh_s
        self.beat()
        return {"ok": True}

    def silence(self) -> dict:
        """Beat no more."""
        self.beating = False
        return {"ok": True}

    def drill(self) -> dict:
        """Drill."""
        return {"results": [asdict(each) for each in self.guardian.drill()]}

    def disarm(self) -> dict:
        """Disarm."""
        return {"results": [asdict(each) for each in self.guardian.disarm()]}

    def close(self) -> dict:
        """Close."""
        self.beating = False
        self.guardian.close()
        return {"ok": True}

    def write(self, device: str, text: str) -> dict:
        """Write to a port."""
        os.write(self.ports[device], text.encode())
        return {"ok": True}

    def fork(self) -> dict:
        """Leave a child that keeps everything open, and outlives this process until its own pipe is read."""
        child = os.fork()
        if not child:
            os.setsid()
            signal.pause()
        return {"child": child}

    def shut(self, device: str) -> dict:
        """Close a connection for everybody who shares it."""
        shared = socket.socket(fileno=os.dup(self.ports[device]))
        shared.shutdown(socket.SHUT_RDWR)
        return {"ok": True}

    def fail(self) -> dict:
        """Raise what nobody catches."""
        raise LookupError("an exception that nobody foresaw")

    def beat(self) -> None:
        """Beat once, and tell how long that took where it fails."""
        began = time.monotonic()
        try:
            self.guardian.beat(time.clock_gettime(time.CLOCK_BOOTTIME) + self.fresh_s)
        except HilError as error:
            self.beating = False
            say({"lost": str(error), "seconds": time.monotonic() - began})

    def run(self) -> None:
        """Do what the lines say until they end."""
        while True:
            ready, _, _ = select.select([0], [], [], BETWEEN_BEATS_S if self.beating else None)
            if not ready:
                self.beat()
                continue
            line = b""
            while not line.endswith(b"\n"):
                if not (character := os.read(0, 1)):
                    return
                line += character
            told = json.loads(line)
            try:
                say(getattr(self, told.pop("do"))(**told))
            except HilError as error:
                say({"error": str(error)})


def say(told: dict) -> None:
    """Say one line."""
    os.write(1, json.dumps(told).encode() + b"\n")


if __name__ == "__main__":
    Executive(*sys.argv[1:]).run()
