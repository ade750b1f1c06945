"""Cut paths, the watch after a run and USB identities in a bench file: what must be said of them, and where."""

from __future__ import annotations

import pytest
from changed_benches import FILE, found, laid, loaded, place

from hil.bench.connections import cut_path_shortfall, hazardous_wires, paths_of
from hil.bench.file.reading import load_bench
from hil.model.errors import ConfigurationError

CHARGE = "{output: supply.charge, by: cycler, state: stopped, within: 10 s}"
CHARGE_BEAT = "{output: supply.charge, watchdog: cycler, within: 360 s}"
COOLERS = "{output: thermal, by: supply.tec"
TEMPERATURE = "{output: thermal, quantity: temperature, unit: degC, toward:"
CURRENT = "- {output: cycler, quantity: current, unit: A, min:"

BATTERY = [
    (
        {CHARGE: CHARGE.replace("supply.charge", "supply.charg")},
        "{output: supply.charg,",
        "did you mean 'supply.charge'?",
    ),
    ({CHARGE: CHARGE.replace("cycler", "cyclor")}, "{output: supply.charge, by", "did you mean 'cycler'?"),
    (
        {CHARGE: CHARGE.replace("stopped", "idle")},
        "{output: supply.charge, by",
        "cut path of supply.charge: safe_off brings cycler to 'stopped', not to 'idle'",
    ),
    (
        {CHARGE: CHARGE.replace(" state: stopped,", "")},
        "{output: supply.charge, by",
        "write 'state: stopped', the safe state of cycler",
    ),
    (
        {CHARGE: CHARGE.replace("within", "hardware: fuse, within")},
        "{output: supply.charge, by",
        "it needs one of by, an output whose safe state cuts it off, watchdog",
    ),
    (
        {CHARGE: CHARGE.replace(" by: cycler, state: stopped,", "")},
        "{output: supply.charge, within",
        "it needs one of by",
    ),
    (
        {CHARGE_BEAT: CHARGE_BEAT.replace("within", "state: stopped, within")},
        "{output: supply.charge, watchdog",
        "only 'by' has a state; leave it out",
    ),
    (
        {CHARGE_BEAT: CHARGE_BEAT.replace("cycler", "cyclor")},
        "{output: supply.charge, watchdog",
        "unknown output 'cyclor'",
    ),
    ({CHARGE: CHARGE.replace("10 s", "0 ms")}, "0 ms}", "cut_paths: 'within' must be longer than 0 s"),
    ({CHARGE: CHARGE.replace("within", "witin")}, "witin", "unknown key 'witin', did you mean 'within'?"),
    (
        {CHARGE: CHARGE.replace("by: cycler, state: stopped", 'by: supply.apparatus, state: "off"')},
        "{output: supply.charge, by",
        "supply.apparatus is on the same port, and is lost with it",
    ),
    (
        {CHARGE: CHARGE.replace("by: cycler, state: stopped", 'by: supply.charge, state: "off"')},
        "{output: supply.charge, by",
        "an output does not cut itself off",
    ),
    ({CHARGE: f"{CHARGE}\n- {CHARGE}"}, f"{CHARGE}\n- {CHARGE_BEAT}", "cycler stopped is given twice"),
    (
        {f"- {CHARGE}\n": "", f"- {CHARGE_BEAT}\n": ""},
        "{role: supply, instance: charge",
        "supply.charge has only one path, its own port, and this bench charges a battery: give it a line in cut_paths",
    ),
    (
        {"charges: cycler,": "charges: cycler, hazardous: false,"},
        "{role: supply, instance: charge",
        "supply.charge charges a battery, which is hazardous",
    ),
    ({"charges: cycler,": "charges: cycler, hazardous: no,"}, "no,", "write true or false, or write it in quotes"),
    (
        {
            f"- {CHARGE}\n": "",
            f"- {CHARGE_BEAT}\n": f"- {CHARGE.replace('by: cycler, state: stopped', 'by: cyclor')}\n",
        },
        "{output: supply.charge, by",
        "unknown output 'cyclor'",
    ),
    ({TEMPERATURE: TEMPERATURE.replace("thermal", "termal")}, "{output: termal", "did you mean 'thermal'?"),
    (
        {TEMPERATURE: TEMPERATURE.replace("temperature", "angle")},
        "{output: thermal, quantity: angle",
        "thermal has no angle",
    ),
    ({'tolerance: "4", ': ""}, TEMPERATURE, "what goes toward a value needs 'tolerance'"),
    ({'tolerance: "4"': 'tolerance: "0"'}, '"0", within', "watch_after: 'tolerance' must be above 0"),
    (
        {'tolerance: "4", within: 180 s': 'tolerance: "4", within: 0 ms'},
        "0 ms}",
        "watch_after: 'within' must be longer than 0 s",
    ),
    ({'toward: "24.5"': 'toward: "24.5", min: "1"'}, '"1", tolerance', "what goes toward a value takes no 'min'"),
    ({'max: "0.02", for: 60 s': 'max: "0.02"'}, CURRENT, "what stays between bounds needs 'for'"),
    ({'max: "0.02", for: 60 s': 'max: "0.02", for: 0 ms'}, "0 ms}", "watch_after: 'for' must be longer than 0 s"),
    ({'max: "0.02", for: 60 s': 'max: "-0.2", for: 60 s'}, CURRENT, "min -0.02 is above max -0.2"),
    (
        {'max: "0.02", for: 60 s}': f'max: "0.02", for: 60 s}}\n{CURRENT} "0", max: "0", for: 1 s}}'},
        f'{CURRENT} "0"',
        "watch_after of cycler: its current is watched twice",
    ),
    (
        {"{serial: A50285BK}": "{serial: A50285BK, path: x}"},
        "{serial: A50285BK",
        "tec1: usb needs either a serial or a path",
    ),
    ({"{serial: A50285BK}": "{}"}, "{}", "tec1: usb needs either a serial or a path"),
    ({"{serial: A50285BK}": "{seriell: A50285BK}"}, "seriell", "unknown key 'seriell', did you mean 'serial'?"),
    (
        {"{serial: A50285BK}": '{path: "pci-0000:00:14.0-usb-0:4:1.0"}'},
        '{path: "pci-0000:00:14.0-usb-0:4:1.0"}\n    baud: "9600"',
        "psu2 and tec1 are both plugged in at 'pci-0000:00:14.0-usb-0:4:1.0'",
    ),
    (
        {"port: TCPIP::192.168.10.22::5555::SOCKET": "port: TCPIP::192.168.10.22::5555::SOCKET\n    usb: {serial: D}"},
        "{serial: D}",
        "psu1: only a serial device of this computer has a USB identity",
    ),
]

ADCS = [
    (
        {"- {output: thermal, hardware: thermal cut-out opens the cooler's feed at 70 degC, within: 300 s}\n": ""},
        "{role: thermal",
        "thermal has no cut path: say in cut_paths what opens it when its own port is gone, or mark the wire",
    ),
    (
        {"{role: gyroscope, instrument: gyro1,": "{role: gyroscope, instrument: gyro1, hazardous: false,"},
        "{role: gyroscope",
        "gyroscope: only what drives something can be marked as not hazardous",
    ),
]


@pytest.mark.parametrize(
    ("bench", "changes", "at", "message"),
    [*(("battery", *each) for each in BATTERY), *(("adcs", *each) for each in ADCS)],
)
def test_every_mistake_is_told_where_it_is(tmp_path, bench, changes, at, message):
    """One thing changed in a committed bench is told at its place, with what to write instead."""
    text, told = found(tmp_path, changes, bench)
    assert any(line.startswith(place(text, at, bench)) and message in line for line in told), told


@pytest.mark.parametrize("bench", ["adcs", "battery"])
def test_the_committed_benches_are_clean(tmp_path, bench):
    """Neither has anything wrong."""
    assert found(tmp_path, {}, bench)[1] == []


def test_what_is_independent_counts(tmp_path):
    """Two paths through one port are one path, and so are two that are the same words."""
    spec = loaded(tmp_path, {})
    assert list(paths_of(spec, "supply.charge")) == ["cycler1", "watchdog of cycler"]
    assert list(paths_of(spec, "cycler")) == ["psu1", "watchdog of cycler"]
    assert cut_path_shortfall(spec, 2) == []
    assert cut_path_shortfall(spec, 3)[0] == (
        "supply.charge needs 3 cut paths in addition to its own port, it has 2: cycler stopped and watchdog of cycler"
    )


def test_two_paths_through_one_port_are_one(tmp_path):
    """Two outputs of one supply that cut the coolers off are gone together."""
    short = loaded(
        tmp_path / "second",
        {
            f'- {COOLERS}, state: "off", within: 3 s}}\n': (
                '- {output: thermal, by: supply.charge, state: "off", within: 3 s}\n'
                '- {output: thermal, by: supply.apparatus, state: "off", within: 3 s}\n'
            ),
            "- {output: thermal, hardware: thermal cut-out opens the coolers' feed at 70 degC, within: 300 s}\n": "",
        },
    )
    assert cut_path_shortfall(short, 1) == []
    assert cut_path_shortfall(short, 2) == [
        "thermal needs 2 cut paths in addition to its own port, it has 1: supply.charge off"
    ]


def test_the_attitude_bench_is_not_for_nobody(tmp_path):
    """Each of its outputs that can do harm has one cut path; the two small supplies are not among them."""
    spec = loaded(tmp_path, {}, "adcs")
    assert [wire.name for wire in hazardous_wires(spec)] == ["relays", "thermal", "rotation_table"]
    assert cut_path_shortfall(spec, 1) == []
    assert [line.split(" ")[0] for line in cut_path_shortfall(spec, 2)] == ["relays", "thermal", "rotation_table"]


def test_a_bench_that_only_answers_from_its_record_needs_no_cut_path(tmp_path):
    """What was driven before there were cut paths is replayed all the same; it cannot be driven any more."""
    text = laid(tmp_path, {})
    file = tmp_path / FILE.format("battery")
    begin = text.index("cut_paths:")
    file.write_text(text[:begin] + text[text.index("\nwatch_after:", begin) :], encoding="utf-8")
    with pytest.raises(ConfigurationError, match="supply.charge has only one path"):
        load_bench(tmp_path / "fixtures/benches", "battery", tmp_path)
    assert load_bench(tmp_path / "fixtures/benches", "battery", tmp_path, driven=False).cut_paths == ()
