"""Wall time for evidence, leases and terminals; never used by benches."""

from __future__ import annotations

import os
import sys
import time
from dataclasses import dataclass
from datetime import UTC, date, datetime, timedelta
from functools import cache
from pathlib import Path

__all__ = [
    "Clocks",
    "WallStamp",
    "boot_ns",
    "clocks",
    "compact_utc",
    "days_between",
    "epoch",
    "is_date",
    "moment_of",
    "monotonic",
    "pause",
    "put_stamp",
    "replaced",
    "seconds_of",
    "seconds_since",
    "stamp",
    "supervise",
    "supervisor_stamp",
    "utc_now",
]

_NANOSECONDS = 1e9
_STAMP = 128
_supervisor = -1
_BOOT_ID = Path("/proc/sys/kernel/random/boot_id")


class _Machine:
    """Access to this machine's clocks, as captured when this module was loaded.

    It is out of reach of tools that replace `time.time`, `datetime.datetime` and the like in all modules to freeze time
    for tests: a case can deceive itself about the time, but not the record of the run.
    """

    def __init__(self) -> None:
        self.read_ns = time.clock_gettime_ns
        self.sleep = time.sleep
        self.moment = datetime
        self.began = datetime(1970, 1, 1, tzinfo=UTC)
        self.after = timedelta
        self.as_loaded: dict[str, object] = {
            f"time.{name}": found for name in _OF_TIME if (found := getattr(time, name, None)) is not None
        }
        self.as_loaded |= {"datetime.datetime": datetime, "datetime.date": date}

    def now(self) -> datetime:
        """Return UTC."""
        return self.began + self.after(microseconds=self.read_ns(time.CLOCK_REALTIME) // 1000)


_OF_TIME = (
    "time",
    "time_ns",
    "monotonic",
    "monotonic_ns",
    "perf_counter",
    "perf_counter_ns",
    "clock_gettime",
    "clock_gettime_ns",
    "gmtime",
    "localtime",
    "strftime",
    "sleep",
)
_machine = _Machine()


def replaced() -> tuple[str, ...]:
    """Return the names of this process's clocks that were replaced, for example by a tool that freezes time."""
    modules = {"time": time, "datetime": sys.modules.get("datetime")}
    found = []
    for name, before in _machine.as_loaded.items():
        module, _, function = name.partition(".")
        if getattr(modules[module], function, None) is not before:
            found.append(name)
    return tuple(found)


@dataclass(frozen=True, slots=True)
class WallStamp:
    """A timestamp: UTC, seconds since boot (suspend included), and boot ID."""

    utc: str
    boot: float
    boot_id: str


@dataclass(frozen=True, slots=True)
class Clocks:
    """This machine's clocks, all in seconds: time of day, since boot, and since boot without suspends."""

    day: float
    boot: float
    awake: float


def clocks() -> Clocks:
    """Return the present readings of this machine's clocks."""
    day = _machine.read_ns(time.CLOCK_REALTIME) / _NANOSECONDS
    return Clocks(day=day, boot=_since_boot(), awake=monotonic())


def boot_ns() -> int:
    """Return the nanoseconds since this machine's boot, suspends included."""
    return _machine.read_ns(getattr(time, "CLOCK_BOOTTIME", time.CLOCK_MONOTONIC))


def stamp() -> WallStamp:
    """Return the present timestamp."""
    return WallStamp(utc=utc_now(), boot=round(_since_boot(), 6), boot_id=_boot_id())


def seconds_of(utc: str) -> float:
    """Convert an ISO 8601 time to seconds since 1970.

    Raises:
        ValueError: if it is invalid, or has no time zone.
    """
    moment = _machine.moment.fromisoformat(utc)
    if moment.tzinfo is None:
        raise ValueError(f"{utc!r} has no time zone")
    return moment.timestamp()


def supervise(descriptor: int) -> None:
    """Set the file that holds the supervising process's latest timestamp; -1 for none."""
    global _supervisor  # noqa: PLW0603 - there is one
    _supervisor = descriptor


def put_stamp(descriptor: int) -> None:
    """Overwrite a file with the present timestamp, for the supervised process."""
    now = stamp()
    os.pwrite(descriptor, f"{now.utc} {now.boot:.6f} {now.boot_id}".ljust(_STAMP).encode(), 0)


def supervisor_stamp() -> WallStamp | None:
    """Return the latest timestamp of the supervising process, None if there is none."""
    if _supervisor < 0:
        return None
    try:
        utc, boot, boot_id = os.pread(_supervisor, _STAMP, 0).decode("ascii").split()
        return WallStamp(utc=utc, boot=float(boot), boot_id=boot_id)
    except (OSError, ValueError):  # partly written, or nothing yet
        return None


def utc_now() -> str:
    """Return the wall's UTC as ISO 8601 with microseconds and `Z`."""
    return _machine.now().isoformat(timespec="microseconds").replace("+00:00", "Z")


def seconds_since(utc: str) -> float:
    """Return the seconds since an ISO 8601 time, by the time of day."""
    return round((_machine.now() - _machine.moment.fromisoformat(utc)).total_seconds(), 3)


def compact_utc() -> str:
    """Return the wall's UTC for folder names: `20261121T053012Z`."""
    return _machine.now().strftime("%Y%m%dT%H%M%SZ")


def moment_of(utc: str) -> datetime:
    """Parse an ISO 8601 time to UTC.

    Raises:
        ValueError: if it is invalid.
    """
    return _machine.moment.fromisoformat(utc).astimezone(UTC)


def epoch() -> datetime:
    """Return a fixed time, for file formats that require one in files whose bytes must not depend on time."""
    return _machine.moment(1980, 1, 1, tzinfo=UTC)


def is_date(text: str) -> bool:
    """Return whether a text is an existing ISO 8601 date, unlike `2027-02-31`."""
    try:
        _machine.moment.fromisoformat(f"{text}T00:00:00+00:00")
    except ValueError:
        return False
    return True


def days_between(first: str, last: str) -> int:
    """Return the days between two ISO 8601 dates or times in UTC; negative if the second is earlier."""
    return (_machine.moment.fromisoformat(last[:10]) - _machine.moment.fromisoformat(first[:10])).days


def monotonic() -> float:
    """Return seconds on a monotonic clock, for durations experienced by a person."""
    return _machine.read_ns(time.CLOCK_MONOTONIC) / _NANOSECONDS


def pause(seconds: float) -> None:
    """Wait in wall time; only for terminals and retries outside benches."""
    _machine.sleep(seconds)


def _since_boot() -> float:
    return boot_ns() / _NANOSECONDS


@cache  # a process does not outlive its boot
def _boot_id() -> str:
    try:
        return _BOOT_ID.read_text(encoding="ascii").strip()
    except OSError:
        return "unknown"
