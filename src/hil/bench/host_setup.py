"""Host setup: the udev, polkit, systemd and tmpfiles texts that an administrator installs, from the bench file."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from hil.guardian.latch import PLACES
from hil.model.bench import BenchSpec, InstrumentSpec, UsbPort
from hil.model.errors import Refused
from hil.wire.opening import PortKind, kind_of

__all__ = ["KINDS", "Host", "setup_text"]

_PORT = re.compile(r"(?P<path>.+?)(?:-port(?P<port>\d+))?")
_VISA_USB = re.compile(r"^USB\d*::(?P<vendor>[^:]+)::(?P<product>[^:]+)::(?P<serial>[^:]+)", re.IGNORECASE)
_SAFE = re.compile(r"[\w.:@+-]+", re.ASCII)
_SPARE_S = 60


@dataclass(frozen=True, slots=True, kw_only=True)
class Host:
    """The computer.

    Attributes:
        group: who may use the bench.
        workspace: the workspace's folder.
        program: the `hil` that is to run.
    """

    group: str
    workspace: Path
    program: Path


def setup_text(kind: str, spec: BenchSpec, host: Host) -> str:
    """Return one of the texts of `KINDS` for a bench.

    Raises:
        Refused: if a value of the bench file cannot be written in it.
    """
    if not _SAFE.fullmatch(host.group):
        raise Refused(f"'{host.group}' is not a group", "name one such as dialout")
    return "\n".join(KINDS[kind](spec, host)) + "\n"


def _udev(spec: BenchSpec, host: Host) -> Iterator[str]:
    """Yield rules that name the bench's devices, let the group open them, and leave them alone otherwise."""
    file, label = f"/etc/udev/rules.d/70-hil-{spec.name}.rules", f"hil_{spec.name.replace('-', '_')}"
    yield f"# {file}: devices of bench {spec.name}, from its bench file."
    yield f"# hil bench setup {spec.name} --print udev | sudo tee {file}"
    yield "# sudo udevadm control --reload && sudo udevadm trigger"
    yield f'ACTION=="remove", GOTO="{label}_end"'
    yield from _buses_and_uarts(spec, host)
    usb = [item for item in spec.instruments if _usb_of(item) is not None]
    if usb:
        yield f'SUBSYSTEM=="usb", ENV{{DEVTYPE}}=="usb_device", GOTO="{label}_device"'
        yield f'SUBSYSTEMS=="usb", GOTO="{label}_port"'
    yield f'GOTO="{label}_end"'
    if usb:
        yield ""
        yield "# The device: ignored by modem managers, and not suspended between readings."
        yield f'LABEL="{label}_device"'
        yield 'IMPORT{builtin}="path_id"'
        alone = ', ENV{ID_MM_DEVICE_IGNORE}="1", ATTR{power/control}="on"'
        yield from sorted({_device(item) + alone for item in usb})
        yield f'GOTO="{label}_end"'
        yield ""
        yield f"# The port: a persistent name, for the group {host.group}."
        yield f'LABEL="{label}_port"'
        yield from (f'{_port(item)}{_given(spec, item, host)}, ENV{{ID_MM_PORT_IGNORE}}="1"' for item in usb)
        yield ""
    yield f'LABEL="{label}_end"'


def _buses_and_uarts(spec: BenchSpec, host: Host) -> Iterator[str]:
    for bus in spec.buses:
        if bus.port.startswith("/dev/"):
            yield f'SUBSYSTEM=="i2c-dev", KERNEL=="{_text(Path(bus.port).name)}", GROUP="{host.group}", MODE="0660"'
    for item in spec.instruments:
        if item.onboard is not None:
            found = f'SUBSYSTEM=="tty", KERNELS=="{_text(item.onboard.device)}"'
            at = f"0x{int(item.onboard.at, 16):X}" if item.onboard.at else ""  # as the kernel writes it
            for each in [f', ATTR{{{key}}}=="{at}"' for key in ("port", "iomem_base")] if at else [""]:
                yield f"{found}{each}{_given(spec, item, host)}"


def _usb_of(item: InstrumentSpec) -> UsbPort | None:
    """Return the USB device behind an instrument's port, None if there is none."""
    if named := _VISA_USB.match(item.port):
        return UsbPort(serial=named["serial"])
    return item.usb


def _device(item: InstrumentSpec) -> str:
    usb = _usb_of(item) or UsbPort()
    # The name of a port begins with the name of its device; after it come configuration and interface.
    return f'ATTR{{serial}}=="{_text(usb.serial)}"' if usb.serial else f'ENV{{ID_PATH}}=="{_text(_path(usb)[0])}"'


def _port(item: InstrumentSpec) -> str:
    usb = _usb_of(item) or UsbPort()
    kind = 'SUBSYSTEM=="usbmisc", KERNEL=="usbtmc*"' if kind_of(item.port) is PortKind.USBTMC else 'SUBSYSTEM=="tty"'
    if usb.serial:
        return f'{kind}, ATTRS{{serial}}=="{_text(usb.serial)}"'
    _, path, port = _path(usb)
    return f'{kind}, ENV{{ID_PATH}}=="{_text(path)}", ENV{{.ID_PORT}}=="{port}"'


def _path(usb: UsbPort) -> tuple[str, str, str]:
    """Return device, interface and number of a name in /dev/serial/by-path, such as `pci-0000:00:14.0-usb-0:4:1.0`."""
    match = _PORT.fullmatch(usb.path)
    path = match["path"] if match else usb.path
    return path.rpartition(":")[0], path, (match["port"] or "") if match else ""


def _given(spec: BenchSpec, item: InstrumentSpec, host: Host) -> str:
    return f', SYMLINK+="hil/{spec.name}/{item.name}", GROUP="{host.group}", MODE="0660"'


def _text(value: str) -> str:
    """Return a text for a rule, in which some characters cannot be written."""
    if not _SAFE.fullmatch(value):
        raise Refused(f"'{value}' is not allowed in a udev rule", "identify the device by another property")
    return value


def _polkit(spec: BenchSpec, host: Host) -> Iterator[str]:
    """Yield a rule that lets the group inhibit sleep and shutdown, also from remote sessions."""
    file = "/etc/polkit-1/rules.d/50-hil.rules"
    yield f"// {file}: a run on hardware arms only if it can inhibit sleep and shutdown."
    yield f"// hil bench setup {spec.name} --print polkit | sudo tee {file}"
    yield "polkit.addRule(function(action, subject) {"
    yield '    if ((action.id == "org.freedesktop.login1.inhibit-block-sleep" ||'
    yield '         action.id == "org.freedesktop.login1.inhibit-block-shutdown") &&'
    yield f'        subject.isInGroup("{host.group}")) {{'
    yield "        return polkit.Result.YES;"
    yield "    }"
    yield "});"


def _systemd(spec: BenchSpec, host: Host) -> Iterator[str]:
    """Yield a user unit, which keeps running after logout if the user lingers."""
    longest_s = sum(step.within_s for step in spec.safe_off) + max(
        (each.seconds for each in spec.watch_after), default=0
    )
    unit = f"hil-{spec.name}"
    yield f"# ~/.config/systemd/user/{unit}.service: a run on bench {spec.name} that survives logout."
    yield f"# hil bench setup {spec.name} --print systemd > ~/.config/systemd/user/{unit}.service"
    yield "# loginctl enable-linger"
    yield f"# echo 'HIL_ARGUMENTS=run PLAN --bench {spec.name} --dut SERIAL --operator NAME' > ~/.config/{unit}.env"
    yield f"# systemctl --user daemon-reload && systemctl --user start {unit}"
    yield "# Watch it with: hil status latest; answer it with: hil answer latest; stop it with: hil stop latest"
    yield "[Unit]"
    yield f"Description=hil: a run on bench {spec.name}"
    yield ""
    yield "[Service]"
    yield "Type=exec"
    yield f"WorkingDirectory={_unit_text(host.workspace)}"
    yield f"EnvironmentFile=%h/.config/{unit}.env"
    yield f'ExecStart="{_unit_text(host.program)}" $HIL_ARGUMENTS'
    yield "# The guardian has to outlive the run that it guards: only the run is told to stop, and nothing is killed."
    yield "KillMode=process"
    yield "SendSIGKILL=no"
    yield f"TimeoutStopSec={longest_s + _SPARE_S:.0f}"
    yield "Restart=no"


def _unit_text(path: Path) -> str:
    """Return a path escaped for a unit, in which `%` begins a specifier and a backslash an escape."""
    text = str(path)
    if not text.isprintable() or set(text) & set('"\\$'):
        raise Refused(f"'{text}' is not allowed in a systemd unit", "move the workspace, or its environment")
    return text.replace("%", "%%")


def _tmpfiles(spec: BenchSpec, host: Host) -> Iterator[str]:
    """Yield lines for the folder of latches, in which nothing ages."""
    del host
    file = "/etc/tmpfiles.d/hil.conf"
    yield f"# {file}: the folder in which latched benches are recorded, for every user of this computer."
    yield f"# hil bench setup {spec.name} --print tmpfiles | sudo tee {file}"
    yield f"# sudo systemd-tmpfiles --create {file}"
    yield f"d {PLACES[0].parent} 0755 root root -"
    yield f"d {PLACES[0]} 1777 root root -"


KINDS: dict[str, Callable[[BenchSpec, Host], Iterator[str]]] = {
    "udev": _udev,
    "polkit": _polkit,
    "systemd": _systemd,
    "tmpfiles": _tmpfiles,
}
"""The texts that can be printed."""
