"""The computer at a bench: every check, on files of a host that is made up."""

from __future__ import annotations

from dataclasses import replace

import pytest
from workspaces import ROOT

from hil.bench.file.reading import load_bench
from hil.bench.host_checks import Computer, examine
from hil.guardian.latch import PLACES
from hil.model.bench import Bus

GOOD = {
    "etc/group": "root:x:0:\ndialout:x:20:ada\ni2c:x:998:ada\n",
    "dev/ttyUSB0": "",
    "dev/i2c-1": "",
    "run/systemd/system/x": "",
    "run/dbus/system_bus_socket": "",
    "run/systemd/timesync/synchronized": "",
    "proc/acpi/button/lid/LID0/state": "open",
    "etc/systemd/logind.conf.d/hil.conf": "[Login]\nHandleLidSwitch=ignore\n",
    "sys/class/power_supply/AC/type": "Mains\n",
    "sys/class/power_supply/AC/online": "1\n",
    "sys/class/rtc/rtc0/since_epoch": "1000000\n",
    f"{str(PLACES[0])[1:]}/x.latch": "",
}


@pytest.fixture
def host(tmp_path):
    """Return a function that makes a host of files, and returns its checks by their names."""

    def make(changed=(), without=(), benches=(), **facts):
        files = {name: text for name, text in {**GOOD, **dict(changed)}.items() if not name.startswith(tuple(without))}
        for name, text in files.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_text(text)
        usual = {"groups": frozenset({20, 998}), "now": 1_000_003.0, "free": 10**10, "may_open": lambda _: True}
        computer = Computer(
            root=tmp_path, user="ada", reports=tmp_path / "reports", benches=benches, **{**usual, **facts}
        )
        return {each.name: each for each in examine(computer)}

    return make


def test_a_host_that_is_fit_has_nothing_to_do(host):
    """Everything is ok, and nothing is to be typed."""
    found = host()
    assert {each.ok for each in found.values()} == {True}
    assert not any(each.todo for each in found.values())


NOT_OK = {
    "no member": ({"changed": {"etc/group": "dialout:x:20:\ni2c:x:998:"}, "groups": frozenset()},
                  "group dialout", "sudo usermod -aG dialout ada"),
    "an old session": ({"groups": frozenset({998})}, "group dialout", "newgrp dialout"),
    "no group for buses": ({"changed": {"etc/group": "dialout:x:20:ada"}, "groups": frozenset({20})},
                           "group i2c", "sudo groupadd --system i2c"),
    "a closed port": ({"may_open": lambda path: path.name != "ttyUSB0"}, "ports", "--print udev"),
    "a port that is in use": ({"used_by": lambda path: ["minicom (process 7)"] if path.name == "ttyUSB0" else []},
                              "ports", "end that program"),
    "no logind": ({"without": ("run/dbus",)}, "sleep", "inhibitor"),
    "a lid": ({"without": ("etc/systemd/logind",)}, "lid", "HandleLidSwitch=ignore"),
    "a lid in a comment": ({"changed": {"etc/systemd/logind.conf.d/hil.conf": "#HandleLidSwitch=ignore"}},
                           "lid", "sudo tee"),
    "a battery": ({"changed": {"sys/class/power_supply/AC/online": "0"}}, "power", "plug in"),
    "no time server": ({"without": ("run/systemd/timesync",)}, "clock", "sudo timedatectl set-ntp true"),
    "a hardware clock that is off": ({"now": 1_000_100.0}, "hardware clock", "sudo hwclock --systohc --utc"),
    "a full disk": ({"free": 10**9}, "disk", "free some space"),
    "no folder of latches": ({"without": (str(PLACES[0])[1:],)}, "latches", "--print tmpfiles"),
}  # fmt: skip


@pytest.mark.parametrize("name", NOT_OK)
def test_what_is_wrong_says_what_to_type(host, name):
    """One thing is wrong, that one alone is told, and with a line that can be typed."""
    facts, check, todo = NOT_OK[name]
    found = host(**facts)
    wrong = {each.name for each in found.values() if each.ok is False}
    assert check in wrong
    assert wrong <= {check, "group i2c"}
    assert todo in found[check].todo


def test_who_has_a_port_open_is_told(host):
    """A run on hardware would be refused; the program is named beside its port."""
    found = host(used_by=lambda path: ["minicom (process 7)"] if path.name == "ttyUSB0" else [])
    assert found["ports"].detail == "/dev/ttyUSB0 is in use by minicom (process 7)"


def test_what_nothing_needs_is_not_asked_for(host):
    """Without ports no group is needed; a computer without a clock of its own is not at fault."""
    found = host(without=("dev", "sys/class/rtc"), groups=frozenset())
    assert [found[name].ok for name in ("group dialout", "group i2c", "ports", "hardware clock")] == [None] * 4


def test_a_workspace_that_holds_off_sleep_itself_needs_no_logind(host):
    """As on a computer without systemd."""
    assert host(without=("run",), inhibitor=True)["sleep"].ok


def test_a_bench_with_local_ports_needs_its_rules_and_names(host):
    """First the rules are told, then what is not plugged in, then nothing."""
    battery = load_bench(ROOT / "fixtures/benches", "battery", ROOT, driven=False)
    ports = {item.name: item.port for item in battery.instruments if item.port.startswith("/dev/")}
    assert ports, "the bench of the test has ports of this kind"
    rules = "etc/udev/rules.d/70-hil-battery.rules"
    found = host(benches=(battery,))["udev battery"]
    assert (found.ok, found.todo.startswith(f"hil bench setup battery --print udev | sudo tee /{rules} ")) == (
        False,
        True,
    )
    found = host({rules: ""}, benches=(battery,))["udev battery"]
    assert (found.ok, found.detail) == (None, f"not plugged in: {', '.join(ports)}")
    assert host({port[1:]: "" for port in ports.values()}, benches=(battery,))["udev battery"].ok


def test_a_module_that_a_port_needs_is_named(host):
    """An I2C bus of the host needs i2c-dev, and a USB instrument usbtmc."""
    bench = load_bench(ROOT / "fixtures/benches", "battery", ROOT, driven=False)
    item = replace(bench.instruments[0], port="USB0::0x1AB1::0x0E11::DP8C1::INSTR")
    wired = replace(bench, instruments=(item,), buses=(Bus(name="i2c", port="/dev/i2c-1"),))
    found = host(benches=(wired,))
    assert [found[f"module {name}"].ok for name in ("i2c-dev", "usbtmc")] == [False, False]
    assert "sudo modprobe usbtmc" in found["module usbtmc"].todo
    found = host({"sys/module/usbtmc/x": "", "sys/module/i2c_dev/x": ""}, benches=(wired,))
    assert [found[f"module {name}"].ok for name in ("i2c-dev", "usbtmc")] == [True, True]
