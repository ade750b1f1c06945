"""Host checks: what on the bench computer stands in the way of runs on hardware, and the commands that fix it."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from hil.guardian.latch import PLACES
from hil.model.bench import BenchSpec
from hil.wire.opening import PortKind, kind_of

__all__ = ["CHECKS", "Check", "Computer", "examine"]

_LEAST_FREE = 2_000_000_000  # bytes: a week of recordings, and the reserve of a run
_RTC_OFF_S = 60.0
_SERIAL = ("ttyUSB*", "ttyACM*", "ttyAMA*", "ttyS[0-9]*")


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """Result of one check of the host.

    Attributes:
        name: what was checked.
        ok: whether it is as it should be; None if nothing needs it, or it cannot be determined.
        detail: what was found.
        todo: the commands that put it right, joined by ` && `; empty if it is right.
    """

    name: str
    ok: bool | None
    detail: str
    todo: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Computer:
    """The host as the checks see it; nothing else is looked at.

    Attributes:
        root: the root of its file system.
        user: the name of the user.
        groups: the ids of this process's groups.
        now: seconds since 1970.
        reports: where runs go.
        free: how many bytes are free there.
        may_open: whether this user may read and write a file.
        used_by: names the programs that have a port open.
        inhibitor: whether the workspace has a command of its own that inhibits sleep.
        benches: the benches of the workspace.
    """

    root: Path
    user: str
    groups: frozenset[int]
    now: float
    reports: Path
    free: int
    may_open: Callable[[Path], bool] = lambda path: os.access(path, os.R_OK | os.W_OK)
    used_by: Callable[[Path], Iterable[str]] = lambda _: ()
    inhibitor: bool = False
    benches: Sequence[BenchSpec] = field(default=())

    def at(self, path: str) -> Path:
        """Return a file of the host."""
        return self.root / path.lstrip("/")

    def text(self, path: str) -> str:
        """Return the text of a file, empty where it cannot be read."""
        try:
            return self.at(path).read_text(errors="replace").strip()
        except OSError:
            return ""

    def devices(self, *patterns: str) -> list[Path]:
        """Return what is in /dev under one of these names, sorted."""
        return sorted(path for pattern in patterns for path in self.at("/dev").glob(pattern))

    def named(self, path: Path) -> str:
        """Return the path of a file on the host."""
        return f"/{path.relative_to(self.root)}"


def examine(computer: Computer) -> Iterator[Check]:
    """Yield every check of the host, in a fixed order."""
    for check in CHECKS:
        yield from check(computer)


def _groups(computer: Computer) -> Iterator[Check]:
    """Check that the user is in the groups that own serial ports and I2C buses."""
    members = {name: (int(gid), users.split(",")) for name, _, gid, users in _entries(computer.text("/etc/group"))}
    buses = any(bus.port.startswith("/dev/") for bench in computer.benches for bus in bench.buses)
    for name, needed in (
        ("dialout", bool(computer.devices(*_SERIAL)) or _has_kind(computer, PortKind.SERIAL)),
        ("i2c", bool(computer.devices("i2c-*")) or buses),
    ):
        gid, users = members.get(name, (-1, []))
        if not needed:
            yield Check(name=f"group {name}", ok=None, detail="no port needs it")
        elif computer.user == "root":
            yield Check(name=f"group {name}", ok=None, detail="root may open every port; a dedicated user is safer")
        elif gid in computer.groups:
            yield Check(name=f"group {name}", ok=True, detail=f"{computer.user} is in it")
        elif computer.user in users:
            yield Check(
                name=f"group {name}",
                ok=False,
                detail=f"{computer.user} is in it, and this session began before",
                todo=f"log out and in again, or: newgrp {name}",
            )
        else:
            add = f"sudo usermod -aG {name} {computer.user}    # then log out and in again"
            todo = add if gid >= 0 else f"sudo groupadd --system {name} && {add}"
            yield Check(name=f"group {name}", ok=False, detail=f"{computer.user} is not in it", todo=todo)


def _entries(text: str) -> Iterator[list[str]]:
    return (parts for line in text.splitlines() if len(parts := line.split(":")) == 4)


def _has_kind(computer: Computer, *kinds: PortKind) -> bool:
    return any(kind_of(item.port) in kinds for bench in computer.benches for item in bench.instruments)


def _ports(computer: Computer) -> Iterator[Check]:
    """Check the serial ports, buses and USB instruments present: may they be opened, and who has them open?"""
    found = computer.devices("ttyUSB*", "ttyACM*", "i2c-*", "usbtmc*")
    closed = [computer.named(path) for path in found if not computer.may_open(path)]
    used = [
        f"{computer.named(path)} is in use by {', '.join(users)}"
        for path in found
        if not path.name.startswith("i2c-") and (users := list(computer.used_by(path)))
    ]
    if not found:
        yield Check(name="ports", ok=None, detail="no USB serial port, I2C bus or USB instrument found")
    elif closed:
        todo = "install the udev rules of its bench: hil bench setup NAME --print udev"
        yield Check(name="ports", ok=False, detail=f"cannot be opened: {', '.join(closed)}", todo=todo)
    elif used:
        todo = "end that program before a run: a port serves one program at a time"
        yield Check(name="ports", ok=False, detail="; ".join(used), todo=todo)
    else:
        yield Check(name="ports", ok=True, detail=", ".join(map(computer.named, found)))


def _modules(computer: Computer) -> Iterator[Check]:
    """Check for the kernel modules that a bench's ports need."""
    buses = any(bus.port.startswith("/dev/i2c-") for bench in computer.benches for bus in bench.buses)
    for module, there, needed in (
        ("i2c-dev", "i2c_dev", buses),
        ("usbtmc", "usbtmc", _has_kind(computer, PortKind.USBTMC)),
    ):
        if needed:
            loaded = computer.at(f"/sys/module/{there}").exists()
            todo = (
                ""
                if loaded
                else f"sudo modprobe {module} && echo {module} | sudo tee /etc/modules-load.d/{module}.conf"
            )
            detail = "loaded" if loaded else "not loaded, and a bench needs it"
            yield Check(name=f"module {module}", ok=loaded, detail=detail, todo=todo)


def _udev(computer: Computer) -> Iterator[Check]:
    """Check for the udev rules of every bench with ports on this computer, and for the names that they create."""
    for bench in computer.benches:
        local = [item for item in bench.instruments if item.port.startswith("/dev/") or item.usb is not None]
        if not local and not any(bus.port.startswith("/dev/") for bus in bench.buses):
            continue
        file = f"/etc/udev/rules.d/70-hil-{bench.name}.rules"
        if not computer.at(file).exists():
            todo = f"hil bench setup {bench.name} --print udev | sudo tee {file}"
            todo += " && sudo udevadm control --reload && sudo udevadm trigger"
            yield Check(name=f"udev {bench.name}", ok=False, detail=f"{file} is not there", todo=todo)
            continue
        named = {item.name: item.port for item in local if item.port.startswith("/dev/")}
        gone = [name for name, port in named.items() if not os.path.lexists(computer.at(port))]
        detail = f"not plugged in: {', '.join(gone)}" if gone else f"its rules are there, and {len(named)} ports"
        yield Check(name=f"udev {bench.name}", ok=None if gone else True, detail=detail)


def _sleep(computer: Computer) -> Iterator[Check]:
    """Check that a run can inhibit sleep, and that no lid or desktop can suspend the computer in spite of it."""
    logind = computer.at("/run/systemd/system").exists() and computer.at("/run/dbus/system_bus_socket").exists()
    if computer.inhibitor or logind:
        detail = "the workspace's own inhibitor" if computer.inhibitor else "logind inhibits it during a run"
        yield Check(name="sleep", ok=True, detail=detail)
    else:
        yield Check(
            name="sleep",
            ok=False,
            detail="there is no logind: nothing can inhibit it, so no hardware bench can be armed",
            todo='give a command of your own in hil.toml: [hardware] inhibitor = ["PROGRAM"]',
        )
    if any(computer.at("/proc/acpi/button/lid").glob("*")):
        ignored = "HandleLidSwitch=ignore" in _logind(computer)
        file = "/etc/systemd/logind.conf.d/hil.conf"
        todo = (
            f"printf '[Login]\\nHandleLidSwitch=ignore\\n' | sudo tee {file} && sudo systemctl restart systemd-logind"
        )
        detail = "closing it does nothing" if ignored else "closing it may suspend the computer during a run"
        yield Check(name="lid", ok=ignored, detail=detail, todo="" if ignored else todo)
    supplies = sorted(computer.at("/sys/class/power_supply").glob("*"))
    mains = [path for path in supplies if computer.text(f"{computer.named(path)}/type") == "Mains"]
    if mains:
        online = any(computer.text(f"{computer.named(path)}/online") == "1" for path in mains)
        todo = "" if online else "plug in the power supply of the computer"
        yield Check(name="power", ok=online, detail="mains" if online else "battery", todo=todo)


def _logind(computer: Computer) -> str:
    files = [computer.at("/etc/systemd/logind.conf"), *sorted(computer.at("/etc/systemd/logind.conf.d").glob("*.conf"))]
    lines = (line.strip() for path in files for line in computer.text(computer.named(path)).splitlines())
    return "\n".join(line for line in lines if not line.startswith("#"))


def _clock(computer: Computer) -> Iterator[Check]:
    """Check that a time server keeps the clock right, and a battery-backed clock keeps it through a power cut."""
    servers = {"systemd-timesyncd": "systemd/timesync/synchronized", "chrony": "chrony/chronyd.pid", "ntpd": "ntpd.pid"}
    running = next((name for name, file in servers.items() if computer.at(f"/run/{file}").exists()), "")
    yield Check(
        name="clock",
        ok=bool(running),
        detail=f"synchronised by {running}"
        if running
        else "not synchronised to a time server: dates in evidence may be wrong",
        todo="" if running else "sudo timedatectl set-ntp true",
    )
    rtc = computer.text("/sys/class/rtc/rtc0/since_epoch")
    if not rtc.isdigit():
        detail = "there is none: after a power cut the clock is wrong until a time server answers"
        yield Check(name="hardware clock", ok=None, detail=detail)
        return
    off = abs(int(rtc) - computer.now)
    ok = off <= _RTC_OFF_S
    detail = "agrees" if ok else f"{off:.0f} s off the system clock"
    yield Check(name="hardware clock", ok=ok, detail=detail, todo="" if ok else "sudo hwclock --systohc --utc")


def _disk(computer: Computer) -> Iterator[Check]:
    """Check that there is space for runs."""
    ok = computer.free >= _LEAST_FREE
    detail = f"{computer.free / 1e9:.1f} GB are free at {computer.reports}"
    todo = "" if ok else "free some space, or name another folder in hil.toml: reports = ..."
    yield Check(name="disk", ok=ok, detail=detail, todo=todo)


def _latches(computer: Computer) -> Iterator[Check]:
    """Check for the folder in which latched benches are noted for every user, across reboots."""
    place = PLACES[0]
    if computer.at(str(place)).is_dir():
        yield Check(name="latches", ok=True, detail=f"{place} is there")
        return
    bench = computer.benches[0].name if computer.benches else "NAME"
    todo = f"hil bench setup {bench} --print tmpfiles | sudo tee /etc/tmpfiles.d/hil.conf"
    todo += " && sudo systemd-tmpfiles --create"
    detail = f"{place} is missing; {PLACES[1]} is used, which the system may clean up"
    yield Check(name="latches", ok=False, detail=detail, todo=todo)


CHECKS: tuple[Callable[[Computer], Iterator[Check]], ...] = (
    _groups,
    _ports,
    _modules,
    _udev,
    _sleep,
    _clock,
    _disk,
    _latches,
)
"""Every check, in reporting order."""
