"""The udev rules for the benches' serial devices name those devices, and udev can read them."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from hil.bench.file.reading import load_bench

ROOT = Path(__file__).parents[3]
RULES = ROOT / "fixtures" / "udev" / "70-hil.rules"
BENCHES = [load_bench(ROOT / "fixtures" / "benches", name, ROOT) for name in ("adcs", "battery")]
DEVICES = {
    (bench.name, instrument.name): instrument.usb
    for bench in BENCHES
    for instrument in bench.instruments
    if instrument.usb is not None
}

# udev(7): what can be compared, and what can be assigned.
COMPARED = {"ACTION", "SUBSYSTEM", "SUBSYSTEMS", "ENV", "ATTR", "ATTRS"}
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


ALL = rules(RULES.read_text(encoding="utf-8"))


def values(key, part=None):
    """Return every value that is given to a key."""
    return [token[3] for rule in ALL for token in rule if token[:2] == (key, part)]


def rule_of(link):
    """Return the rule of a port by its link, as a mapping."""
    (found,) = [rule for rule in ALL if ("SYMLINK", None, "+=", link) in rule]
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
    """Udev skips to a label behind the jump; one that is not there would be ignored with its rule."""
    labels = {rule[0][3]: place for place, rule in enumerate(ALL) if rule[0][0] == "LABEL"}
    jumps = [(token[3], place) for place, rule in enumerate(ALL) for token in rule if token[0] == "GOTO"]
    assert {name for name, _ in jumps} == set(labels)
    assert all(labels[name] > place for name, place in jumps)


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
    # The name of a port begins with the name of its device; behind it come configuration and interface.
    assert {usb.path.rpartition(":")[0] for usb in DEVICES.values() if usb.path} == places


@pytest.mark.parametrize(
    "line", ['SUBSYSTEM="tty, GROUP="dialout"', "SUBSYSTEM==tty", 'GROUP "dialout"', 'SYMLINK+="a" MODE="0660"']
)
def test_what_is_no_rule_is_found(line):
    """The reading above is no formality."""
    with pytest.raises(AssertionError, match="no rule"):
        rules(line)
