"""A machine whose clocks a test moves while processes run on it: suspended, set to another time, started over."""

from __future__ import annotations

import shutil
import struct
import subprocess
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

import pytest
from workspaces import Workspace

__all__ = ["Machine", "machine"]

_Workspace = TypeVar("_Workspace", bound=Workspace)

_BETWEEN = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

static const volatile long long *moved; /* seconds: since boot, time of day */

__attribute__((constructor)) static void look(void)
{
    int file = open(getenv("MOVED_CLOCKS"), O_RDONLY);
    moved = mmap(0, 2 * sizeof *moved, PROT_READ, MAP_SHARED, file, 0);
    close(file);
}

int clock_gettime(clockid_t clock, struct timespec *told)
{
    int (*real)(clockid_t, struct timespec *) = dlsym(RTLD_NEXT, "clock_gettime");
    int result = real(clock, told);
    if (clock == CLOCK_BOOTTIME)
        told->tv_sec += moved[0];
    else if (clock == CLOCK_REALTIME)
        told->tv_sec += moved[1];
    return result;
}

static const char *instead(const char *path)
{
    const char *boot = getenv("MOVED_BOOT_ID");
    return boot && path && !strcmp(path, "/proc/sys/kernel/random/boot_id") ? boot : path;
}

#define OPEN(name)                                                       \
    int name(const char *path, int flags, ...)                           \
    {                                                                    \
        va_list rest;                                                    \
        va_start(rest, flags);                                           \
        mode_t mode = va_arg(rest, mode_t);                              \
        va_end(rest);                                                    \
        int (*real)(const char *, int, ...) = dlsym(RTLD_NEXT, #name);   \
        return real(instead(path), flags, mode);                         \
    }
OPEN(open)
OPEN(open64)
"""


@dataclass(frozen=True)
class Machine:
    """What processes are told of the clocks; none of theirs is replaced, the C library stands between.

    Attributes:
        folder: where that is kept.
    """

    folder: Path

    def of(self, workspace: _Workspace, *, boot_id: str = "") -> _Workspace:
        """Return a workspace whose commands run on this machine, since the boot of this id if one is given."""
        told = {"LD_PRELOAD": str(self.folder / "between.so"), "MOVED_CLOCKS": str(self._moved)}
        if boot_id:
            path = self.folder / "boot_id"
            path.write_text(f"{boot_id}\n", encoding="ascii")
            told["MOVED_BOOT_ID"] = str(path)
        return replace(workspace, environment={**workspace.environment, **told})

    def is_suspended(self, seconds: int) -> None:
        """Let it have been suspended: the clock that counts without suspends stays."""
        boot, day = self._read()
        self._write(boot + seconds, day + seconds)

    def is_set(self, seconds: int) -> None:
        """Let its time of day jump."""
        boot, day = self._read()
        self._write(boot, day + seconds)

    @property
    def _moved(self) -> Path:
        return self.folder / "moved"

    def _read(self) -> tuple[int, int]:
        boot, day = struct.unpack("qq", self._moved.read_bytes())
        return boot, day

    def _write(self, boot: int, day: int) -> None:
        with self._moved.open("r+b") as file:
            file.write(struct.pack("qq", boot, day))


def machine(folder: Path) -> Machine:
    """Return a machine whose clocks have not been moved; skip where there is no compiler."""
    if not shutil.which("cc"):
        pytest.skip("cc is missing: apt-get install gcc")
    source = folder / "between.c"
    source.write_text(_BETWEEN, encoding="ascii")
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", str(folder / "between.so"), str(source), "-ldl"], check=True)
    (folder / "moved").write_bytes(struct.pack("qq", 0, 0))
    return Machine(folder)
