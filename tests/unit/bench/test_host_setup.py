"""What the computer at a bench is given: udev rules, a polkit rule, a unit of systemd, and a folder."""

from __future__ import annotations

import json
import os
import re
import shutil
import stat
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from hil.bench.file.reading import load_bench
from hil.bench.host_setup import KINDS, Host, setup_text
from hil.guardian import latch
from hil.model.bench import OnboardPort
from hil.model.errors import Refused

ROOT = Path(__file__).parents[3]
HOST = Host(group="dialout", workspace=Path("/home/ada/bench 100%"), program=Path("/bin/true"))
BENCHES = {name: load_bench(ROOT / "fixtures" / "benches", name, ROOT) for name in ("adcs", "battery")}
DEVICES = {
    (bench.name, instrument.name): instrument.usb
    for bench in BENCHES.values()
    for instrument in bench.instruments
    if instrument.usb is not None
}

# udev(7): what can be compared, and what can be assigned.
COMPARED = {"ACTION", "KERNEL", "KERNELS", "SUBSYSTEM", "SUBSYSTEMS", "ENV", "ATTR", "ATTRS"}
ASSIGNED = {"SYMLINK", "GROUP", "MODE", "ENV", "ATTR", "LABEL", "GOTO"}
TOKEN = re.compile(r'(?P<key>[A-Z]+)(?:\{(?P<part>[^}"]+)\})?(?P<how>==|!=|\+=|:=|=)"(?P<value>[^"]*)"')


def rules(text):
    """Return every rule of a file as the list of its tokens; a line that udev would not take is an error."""
    found = []
    for line in text.splitlines():
        if not line or line.startswith("#"):
            continue
        parts = [TOKEN.fullmatch(part) for part in re.split(r",\s+", line)]
        assert all(parts), f"no rule: {line}"
        found.append([tuple(part.groups()) for part in parts])
    return found


OF = {name: rules(setup_text("udev", bench, HOST)) for name, bench in BENCHES.items()}
"""The rules of every bench."""

ALL = [rule for each in OF.values() for rule in each]


def values(key, part=None):
    """Return every value that is given to a key."""
    return [token[3] for rule in ALL for token in rule if token[:2] == (key, part)]


def rule_of(link, given=None):
    """Return the rule of a port by its link, as a mapping."""
    (found,) = [rule for rule in given or ALL if ("SYMLINK", None, "+=", link) in rule]
    return {(key, part): value for key, part, _, value in found}


def test_every_token_is_udevs():
    """What is compared can be compared, what is assigned can be assigned, and devices are named in a match only."""
    for rule in ALL:
        for key, part, how, _ in rule:
            if (key, part) == ("IMPORT", "builtin"):
                continue
            assert key in (COMPARED if how in {"==", "!="} else ASSIGNED), rule
            assert how != "+=" or key == "SYMLINK", rule
            assert (key in {"ENV", "ATTR", "ATTRS"}) == (part is not None), rule


def test_jumps_go_forward_to_labels_that_are_there():
    """Udev skips to a label after the jump; one that is not there would be ignored with its rule."""
    for bench, its in OF.items():
        labels = {rule[0][3]: place for place, rule in enumerate(its) if rule[0][0] == "LABEL"}
        jumps = [(token[3], place) for place, rule in enumerate(its) for token in rule if token[0] == "GOTO"]
        assert {name for name, _ in jumps} == set(labels)
        assert all(labels[name] > place for name, place in jumps)
        assert all(name.startswith(f"hil_{bench}_") for name in labels)  # labels of other files are other labels


def test_only_the_benches_devices_are_named():
    """Every serial number is one of a bench file's, and each is there for the device and for its port."""
    serials = sorted(usb.serial for usb in DEVICES.values() if usb.serial)
    assert sorted(values("ATTR", "serial")) == serials
    assert sorted(values("ATTRS", "serial")) == serials
    assert sorted(values("SYMLINK")) == sorted(f"hil/{bench}/{name}" for bench, name in DEVICES)


@pytest.mark.parametrize(("bench", "name"), DEVICES)
def test_a_port_is_told_as_its_bench_file_tells_it(bench, name):
    """By the same serial number, or the same place; its group may open it, and no modem manager does."""
    usb, rule = DEVICES[bench, name], rule_of(f"hil/{bench}/{name}")
    if usb.serial:
        assert rule["ATTRS", "serial"] == usb.serial
    else:
        port = rule["ENV", ".ID_PORT"]
        assert rule["ENV", "ID_PATH"] + (f"-port{port}" if port else "") == usb.path
    assert (rule["GROUP", None], rule["MODE", None]) == ("dialout", "0660")
    assert rule["ENV", "ID_MM_PORT_IGNORE"] == "1"


def test_no_device_is_probed_or_put_to_sleep():
    """Each device rule keeps modem managers away and the device awake; places cover all devices without a number."""
    devices = [
        {(key, part): value for key, part, _, value in rule}
        for rule in ALL
        if ("ATTR", "power/control") in {token[:2] for token in rule}
    ]
    assert {(rule["ENV", "ID_MM_DEVICE_IGNORE"], rule["ATTR", "power/control"]) for rule in devices} == {("1", "on")}
    places = {rule["ENV", "ID_PATH"] for rule in devices if ("ENV", "ID_PATH") in rule}
    # The name of a port begins with the name of its device; after it come configuration and interface.
    assert {usb.path.rpartition(":")[0] for usb in DEVICES.values() if usb.path} == places


@pytest.mark.parametrize(
    "line", ['SUBSYSTEM="tty, GROUP="dialout"', "SUBSYSTEM==tty", 'GROUP "dialout"', 'SYMLINK+="a" MODE="0660"']
)
def test_what_is_no_rule_is_found(line):
    """The reading above is no formality."""
    with pytest.raises(AssertionError, match="no rule"):
        rules(line)


def with_instrument(**changes):
    """Return the rules of a bench whose temperature controller is at another port."""
    bench = BENCHES["battery"]
    changed = tuple(replace(item, **changes) if item.name == "tec1" else item for item in bench.instruments)
    return rules(setup_text("udev", replace(bench, instruments=changed), HOST))


def test_a_usb_instrument_of_visa_is_told_by_its_serial_number():
    """Its device file is the kernel's, and the rule names it as those of serial devices."""
    given = with_instrument(port="USB0::0x1AB1::0x0E11::DP8C231402017::INSTR", usb=None)
    rule = rule_of("hil/battery/tec1", given)
    assert (rule["SUBSYSTEM", None], rule["KERNEL", None]) == ("usbmisc", "usbtmc*")
    assert (rule["ATTRS", "serial"], rule["GROUP", None]) == ("DP8C231402017", "dialout")


def test_a_uart_on_board_is_told_by_its_hardware():
    """And by its address where a card has several."""
    given = with_instrument(port="/dev/ttyS4", usb=None, onboard=OnboardPort(device="0000:02:00.0", at="0xe008"))
    found = [rule for rule in given if ("SYMLINK", None, "+=", "hil/battery/tec1") in rule]
    assert all(("KERNELS", None, "==", "0000:02:00.0") in rule for rule in found)
    told = {token for rule in found for token in rule if token[0] == "ATTR"}
    assert told == {("ATTR", "port", "==", "0xE008"), ("ATTR", "iomem_base", "==", "0xE008")}


def test_the_group_may_use_the_buses():
    """Those of the host; one that an instrument serves has no device file."""
    bench = replace(BENCHES["adcs"], buses=(replace(BENCHES["adcs"].buses[0], port="/dev/i2c-7", instrument=""),))
    assert 'SUBSYSTEM=="i2c-dev", KERNEL=="i2c-7", GROUP="i2c", MODE="0660"' in setup_text(
        "udev", bench, replace(HOST, group="i2c")
    )


@pytest.mark.parametrize("serial", ['A"', "A*", "A, B", "A\n"])
def test_what_udev_would_read_otherwise_is_refused(serial):
    """A quote would end the text, a star would match every device."""
    with pytest.raises(Refused, match="is not allowed in a udev rule"):
        with_instrument(port=f"USB0::1::2::{serial}::INSTR", usb=None)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_no_group_is_refused(kind):
    """It stands in rules and in a program."""
    with pytest.raises(Refused, match="is not a group"):
        setup_text(kind, BENCHES["adcs"], replace(HOST, group='x"; y'))


def permitted(action, group):
    """Return what the polkit rule says of an action of a member of one group."""
    program = f"""
    var rule; var polkit = {{addRule: (each) => {{ rule = each; }}, Result: {{YES: "yes"}}}};
    {setup_text("polkit", BENCHES["adcs"], HOST)}
    console.log(rule({{id: {json.dumps(action)}}}, {{isInGroup: (name) => name === {json.dumps(group)}}}));
    """
    return subprocess.run(["node", "-e", program], capture_output=True, text=True, check=True).stdout.strip()


@pytest.mark.skipif(not shutil.which("node"), reason="the rule is JavaScript")
@pytest.mark.parametrize(
    ("action", "group", "said"),
    [
        ("org.freedesktop.login1.inhibit-block-sleep", "dialout", "yes"),
        ("org.freedesktop.login1.inhibit-block-shutdown", "dialout", "yes"),
        ("org.freedesktop.login1.inhibit-block-sleep", "users", "undefined"),
        ("org.freedesktop.login1.power-off", "dialout", "undefined"),
    ],
)
def test_the_group_may_hold_off_sleep_and_nothing_else(action, group, said):
    """Both are needed, and no other action of logind is."""
    assert permitted(action, group) == said


def test_the_unit_is_one_of_systemd(tmp_path):
    """It finds nothing to complain about, and the guardian outlives the run."""
    text = setup_text("systemd", BENCHES["battery"], HOST)
    if shutil.which("systemd-analyze"):
        unit = tmp_path / "hil-battery.service"
        unit.write_text(text.replace("/home/ada/bench 100%%", str(tmp_path)), encoding="utf-8")
        checked = subprocess.run(["systemd-analyze", "verify", unit], capture_output=True, text=True, check=False)
        assert (checked.returncode, checked.stderr) == (0, "")
    lines = text.splitlines()
    assert {"KillMode=process", "SendSIGKILL=no", "Restart=no"} <= set(lines)
    assert "WorkingDirectory=/home/ada/bench 100%%" in lines
    stop_s = int(next(line.removeprefix("TimeoutStopSec=") for line in lines if line.startswith("TimeoutStopSec=")))
    assert stop_s >= sum(step.within_s for step in BENCHES["battery"].safe_off)


@pytest.mark.skipif(
    not shutil.which("systemd-tmpfiles") or os.geteuid() != 0, reason="root's systemd-tmpfiles makes it"
)
def test_the_folder_of_latches_is_made_for_every_user(tmp_path):
    """As the guardian looks for it: anybody may add a file, nobody may remove another's."""
    file = tmp_path / "hil.conf"
    file.write_text(setup_text("tmpfiles", BENCHES["adcs"], HOST), encoding="utf-8")
    subprocess.run(["systemd-tmpfiles", "--create", f"--root={tmp_path}", file], check=True, capture_output=True)
    made = tmp_path / latch.PLACES[0].relative_to("/")
    assert stat.S_IMODE(made.stat().st_mode) == 0o1777


@pytest.mark.system
def test_the_command_prints_it():
    """With its own program in the unit, and nothing else on standard output."""
    hil = Path(sys.executable).with_name("hil")
    found = subprocess.run(
        [hil, "bench", "setup", "adcs", "--print", "udev"], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert found.stdout == setup_text("udev", BENCHES["adcs"], HOST)
