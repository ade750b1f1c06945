"""The bench file: read strictly, with a place for everything that is wrong."""

from __future__ import annotations

import re

import pytest
from adcs_bench import ADCS, changed, found

from hil.bench.binding import check_twin, simulated_twin
from hil.bench.file.reading import bench_names, load_bench
from hil.model.errors import ConfigurationError, Refused

FILE = "fixtures/benches/adcs/bench.yaml"


def place(text: str, snippet: str) -> str:
    """Return file, line and column of a snippet."""
    before = text[: text.index(snippet)]
    return f"{FILE}:{before.count(chr(10)) + 1}:{len(before) - (before.rfind(chr(10)) + 1) + 1}"


def test_committed_bench_is_clean():
    """The bench of this workspace has nothing wrong, its twin neither."""
    spec = load_bench(ADCS.parent, "adcs", ADCS.parents[2], twin=check_twin)
    assert [wire.name for wire in spec.wiring] == ["supply.coil", "supply.sensor", "relays", "magnetometer"]
    assert spec.wire("relays").contacts == {"a": 1, "b": 2}
    assert spec.instrument("mag1").address == 0x1C
    assert spec.safe_off[0].proof.maximum == 0.001
    assert spec.envelope[0].debounce == 2


@pytest.mark.parametrize("dut", ["true", "false"])
def test_nothing_is_judged_by_itself(tmp_path, dut):
    """A reference is no device under test: it would agree with itself, and nobody asks for its certificate."""
    text = changed(
        tmp_path,
        ("role: magnetometer, instrument: mag1", "role: magnetometer, instance: reference, instrument: mag1"),
        ("identity: {model: LIS3MDL}", f"identity: {{model: LIS3MDL}}\n    dut: {dut}"),
    )
    said = "magnetometer.reference is on mag1, which is under test: wire a reference that is not"
    assert found(tmp_path) == ([f"{place(text, 'mag1, settings')}: {said}"] if dut == "true" else [])


PSU = "port: TCPIP::192.168.10.21::5025::SOCKET"
PSU_IDENTITY = "    identity: {manufacturer: Keysight Technologies, model: E36312A, serial: MY59002391}\n"
CHANGES = [
    # What no reader asked for, what is missing, what has the wrong form.
    (("max_age: 5 s", "max_aeg: 5 s"), "max_aeg", "unknown key 'max_aeg', did you mean 'max_age'?"),
    (("max_age: 5 s", "max_aeg: 5 s"), "{id: coil-current", "envelope: key 'max_age' is missing"),
    (("place: Attitude", "plaice: Attitude"), "plaice", "unknown key 'plaice', did you mean 'place'?"),
    (("  title: Magnetorquer", "  subtitle: M"), "name: adcs", "bench: key 'title' is missing"),
    (("within: 2 s", "within: 2"), "2,", "safe_off: 'within' must be a duration"),
    (
        ('settings: {over_voltage: "8"}', "settings: [over]"),
        "[over]",
        "wiring: 'settings' must be a mapping, found a list",
    ),
    (('over_voltage: "8"', "over_voltage: 8"), "8}", "settings: 'over_voltage' must be text, found `8`"),
    (
        ("instance: coil,", "instance: coil-1,"),
        "coil-1",
        "wiring: 'instance' must be lower-case letters, digits and '_'",
    ),
    (('debounce: "2"', 'debounce: "0"'), '"0"}\n- {id: sensor', "'debounce' must be at least 1"),
    (('due: "2027-09-30"', 'due: "2027-13-30"'), '"2027-13-30"', "'due' must be a date such as 2027-09-30, found"),
    (('due: "2027-09-30"', 'due: "2027-02-31"'), '"2027-02-31"', "calibration: the date 2027-02-31 does not exist"),
    (('baud: "9600"', 'baud: "-9600"'), '"-9600"', "'baud' must be at least 0"),
    (
        ('connects: {"1": coil.c', 'faults: {kind: dead}\n      connects: {"1": coil.c'),
        "{kind: dead}",
        "must be a list, found a mapping",
    ),
    (("certificates/mag1.txt", "certificates/mag2.txt"), "certificates/mag2", "no certificate 'certificates/mag2.txt'"),
    (("certificates/mag1.txt", "../adcs.txt"), "../adcs.txt", "no certificate '../adcs.txt' in the bench's folder"),
    (("name: adcs", "name: adsc"), "adsc", "the bench is named 'adsc', but its folder is 'adcs'"),
    # What no reader asked for, at a port: other schemes of pyserial, another form, nobody who is expected there.
    *(
        ((PSU, f"port: {url}"), url, f"'{url.partition(':')[0]}://' is never opened")
        for url in ("alt:///dev/ttyS0", "loop://", "spy:///dev/null?file=X", "hwgrep://.*", "cp2110://0")
    ),
    ((PSU, "port: sockte://a:1"), "sockte://a:1", "is never opened, did you mean 'socket'?"),
    ((PSU, "port: ../x"), "../x", "psu1: '../x' is no serial device below /dev; write a device below /dev, socket://"),
    ((PSU, "port: /dev/../tmp/x"), "/dev/../tmp/x", "is no serial device below /dev"),
    ((PSU, "port: ASRLalt:///dev/ttyS0::INSTR"), "ASRLalt", "'alt://' is never opened"),
    *(
        ((PSU, f"port: {url}"), url, f"'{url}' does not look like {url.partition(':')[0]}://HOST:PORT")
        for url in ("socket://10.0.0.1", "socket://10.0.0.1:1?logging=debug", "rfc2217://u@h:1")
    ),
    ((PSU_IDENTITY, ""), "TCPIP", "psu1 is on a network, where anything may answer: give it an identity with model"),
    ((PSU_IDENTITY, "    identity: {manufacturer: Keysight}\n"), "TCPIP", "psu1 is on a network"),
    # Instruments.
    (("driver: lis3mdl", "driver: lis3mld"), "lis3mld", "unknown driver 'lis3mld', did you mean 'lis3mdl'?"),
    (("    bus: i2c1\n", "    port: /dev/x\n    bus: i2c1\n"), "mag1:\n", "mag1 needs either a port or a bus"),
    (("    bus: i2c1\n", ""), "mag1:\n", "mag1 needs either a port or a bus with an address"),
    (("bus: i2c1", "bus: i2c2"), "mag1:\n", "unknown bus 'i2c2', did you mean 'i2c1'?"),
    (('address: "1"', 'address: "-1"'), '"-1"\n    identity', "instruments relay1: 'address' must be at least 0"),
    (('address: "1"', 'address: "248"'), "relay1:\n", "relay1: 248 is not a station's address (1 to 247)"),
    (('"0x1C"', '"0x7C"'), "mag1:\n", "mag1: 0x7C is not a 7-bit I2C address (0x08 to 0x77)"),
    (("powered_by: supply.sensor", "powered_by: supply.senser"), "mag1:\n", "did you mean 'supply.sensor'?"),
    (("powered_by: supply.sensor", "powered_by: relays"), "mag1:\n", "mag1 is fed by relays, which needs a reduced"),
    (
        ("  mag1:\n", '  mag2: {driver: lis3mdl, bus: i2c1, address: "0x1C"}\n  mag1:\n'),
        '"0x1C"}',
        "mag1 and mag2 are both at bus i2c1, address 0x1C: strap mag1 to 0x1E by SA1 or strap mag2 to 0x1E by SA1",
    ),
    (
        ("  mag1:\n", '  mag2: {driver: lis3mdl, bus: i2c1, address: "0x1C"}\n  mag1:\n'),
        '"0x1C"\n',
        "mag1 and mag2 are both at bus i2c1, address 0x1C: strap mag1",
    ),
    (
        (
            "  mag1:\n",
            (
                '  tmp1: {driver: lis3mdl, bus: i2c1, address: "0x1E"}\n'
                '  mag2: {driver: lis3mdl, bus: i2c1, address: "0x1C"}\n  mag1:\n'
            ),
        ),
        '"0x1C"}',
        "mag1 and mag2 are both at bus i2c1, address 0x1C: put one of them on another bus",
    ),
    (
        ("  mag1:\n", '  imu1: {driver: lsm9ds1, bus: i2c1, address: "0x6A"}\n  mag1:\n'),
        "imu1: {driver",
        "mag1 and imu1 are both at bus i2c1, address 0x1C: strap mag1 to 0x1E by SA1 or strap imu1 to 0x1E by SDO_M",
    ),
    (
        (
            "  mag1:\n",
            (
                '  imu1: {driver: icm20948, bus: i2c1, address: "0x69"}\n'
                '  imu2: {driver: bmi088, bus: i2c1, address: "0x18", second_address: "0x69"}\n  mag1:\n'
            ),
        ),
        '"0x69"}\n  mag1',
        "imu2 and imu1 are both at bus i2c1, address 0x69: strap imu2 to 0x68 by SDO2 or strap imu1 to 0x68 by AD0",
    ),
    (
        ("  mag1:\n", '  imu1: {driver: bmi088, bus: i2c1, address: "0x68"}\n  mag1:\n'),
        '"0x68"}',
        "imu1: bmi088 answers at 0x18 or 0x19, as SDO1 is strapped, not at 0x68",
    ),
    (('"0x1C"', '"0x1D"'), '"0x1D"', "mag1: lis3mdl answers at 0x1C or 0x1E, as SA1 is strapped, not at 0x1D"),
    (
        ('address: "0x1C"', 'address: "0x1C"\n    second_address: "0x1E"'),
        '"0x1E"',
        "mag1: an instrument of lis3mdl has one address: leave it out",
    ),
    (
        ("/dev/serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0", "socket://192.168.10.21:5025"),
        "relay1:\n",
        "relay1 and psu1 are both at port socket://192.168.10.21:5025",
    ),
    (
        ("buses:\n", "buses:\n  i2c0: {port: /dev/i2c-1}\n"),
        "i2c1: {",
        "i2c1 and i2c0 are both the bus at /dev/i2c-1",
    ),
    (("  relay1:\n", "  relay/1:\n"), "relay/1", "the name 'relay/1' must be letters, digits"),
    (('quantity: voltage, unit: V, max: "25"', 'quantity: volts, unit: V, max: "25"'), "{channel", "'volts'"),
    (('absolute: "0.005"', 'absolute: "-0.005"'), '"-0.005"', "ranges: 'absolute' must be at least 0"),
    (('relative: "0.01"', 'relative: "0.01", k: "-0"'), '"-0"', "ranges: 'k' must be above 0"),
    (
        ('from: "-400"', 'from: "500"'),
        "{quantity: field",
        "mag1: the range begins at 500 uT and ends below, at 400; exchange from and to",
    ),
    # Wiring.
    (("role: magnetometer", "role: magnetometre"), "magnetometre", "did you mean 'magnetometer'?"),
    (("instrument: relay1", "instrument: relay2"), "{role: relays", "unknown instrument 'relay2', did you mean"),
    (("instance: sensor", "instance: coil"), '{role: supply, instance: coil, instrument: psu1, channel: "3"', "twice"),
    (("instance: sensor, ", ""), "{role: supply, instrument", "role 'supply' has several instances, so each needs"),
    (
        ('channel: "3",\n', 'channel: "2",\n'),
        "{role: supply, instance: sensor",
        "supply.sensor and supply.coil are both on channel 2 of psu1",
    ),
    (('b: "2"}', 'b: "1"}'), "{role: relays", "relays: two of its contacts have the same number"),
    (
        ("- {role: magnetometer", '- {role: relays, instance: x, instrument: relay1, contacts: {c: "2"}}\n- {role: m'),
        "{role: relays, instance: x",
        "relays.x and relays both have contact 2 of relay1",
    ),
    (('{voltage: "0.5"', '{voltage: "6.5"'), "{role: supply", "reduced voltage 6.5 V is outside its clamp 0 to 6 V"),
    (('{voltage: "0.5"', '{voltage: "0"'), '"0", current', "reduced: 'voltage' must be above 0"),
    (('lowest_current: "0.0015"', 'lowest_current: "1"'), "{role: supply", "lowest_current 1 is above highest"),
    (
        (
            "settings: {range",
            'reduced: {voltage: "1", current: "1", lowest_current: "0", highest_current: "1"},\n   settings: {range',
        ),
        "{role: magnetometer",
        "magnetometer: only a supply has a reduced level",
    ),
    # Clamps.
    (
        ("output: supply.coil, quantity: v", "output: supply.coal, quantity: v"),
        "{output: supply.coal",
        "'supply.coil'?",
    ),
    (
        ('quantity: voltage, unit: V, min: "0"', 'quantity: voltag, unit: V, min: "0"'),
        "{output: supply.coil, quantity: voltag,",
        "unknown quantity 'voltag', did you mean 'voltage'?",
    ),
    (
        ('unit: V, min: "0", max: "6"', 'unit: mV, min: "0", max: "6"'),
        "{output: supply.coil, quantity: voltage, unit: mV",
        "voltage is given in V here, not in 'mV'",
    ),
    (('max: "6"', 'max: "26"'), "{output: supply.coil, quantity: voltage", "a clamp at 26 V exceeds the rating 25 V"),
    (('min: "0", max: "6"', 'min: "7", max: "6"'), "{output: supply.coil, quantity: voltage", "min 7 is above max 6"),
    (
        ("{output: supply.coil, quantity: v", "{output: relays, quantity: v"),
        "{output: relays, q",
        "relays has no voltage: the role relays has no quantities for clamps, envelope and proofs; name another output",
    ),
    # Envelope.
    (('max: "0.03", ', ""), "{id: coil-current", "coil-current: a limit needs min, max or both"),
    (('max: "0.03"', 'min: "1", max: "0.03"'), "{id: coil-current", "coil-current: min 1 is above max 0.03"),
    (
        ("max_age: 5 s", "max_age: 1.9 s"),
        "{id: coil-current",
        "coil-current: max_age must be at least twice the period",
    ),
    (("period: 1 s", "period: 0 s"), "0 s, max_age", "envelope: 'period' must be at least 0.001 s, found `0 s`"),
    (('debounce: "2"', 'debounce: "99999999999"'), '"99999999999"', "envelope: 'debounce' must be at most 1000"),
    (
        ("id: sensor-voltage", "id: coil-current"),
        "{id: coil-current, output: supply.sensor",
        "two limits called 'coil-c",
    ),
    (
        ("id: sensor-voltage, output: supply.sensor", "id: x, output: magnetometer"),
        "{id: x",
        "magnetometer has no voltage: the role magnetometer has temperature",
    ),
    (
        ("id: sensor-voltage, output: supply.sensor, quantity: voltage", "id: x, output: relays, quantity: plate"),
        "{id: x",
        "relays has no plate: the role relays has no quantities",
    ),
    # Safe-off and rest.
    (("state: released", "state: relesed"), "{output: relays", "unknown state 'relesed', did you mean 'released'?"),
    (
        ("output: relays, state: released, within: 2 s}\n- {output: supply.sensor", "output: supply.sensor"),
        "{role: relays",
        "relays is missing from safe_off",
    ),
    (
        ('2 s,\n   proof: {output: supply.coil, quantity: current, unit: A, min: "-0.001", max: "0.001"}}', "2 s}"),
        "{role: supply, instance: coil",
        "supply.coil: its line in safe_off needs a proof",
    ),
    (("proof: {output: supply.coil", "proof: {output: relays"), "{output: supply.coil, state", "relays has no current"),
    (('min: "-0.001"', 'min: "0.002"'), "{output: supply.coil, state", "proof of supply.coil: min 0.002 is above"),
    (
        ("state: released, within: 2 s", "state: released, within: 0 s"),
        "0 s}\n- {output: supply.s",
        "safe_off: 'within' must be longer than 0 s",
    ),
    # The simulated twin.
    (("    relay1:\n      connects", "    relay2:\n      connects"), "relay1:\n    driver", "relay1 has no peer"),
    (("    relay1:\n      connects", "    relay2:\n      connects"), "relay2:\n", "unknown instrument 'relay2'"),
    (("2026-01-01T08", "2026-02-30T08"), '"2026-02-30', "the epoch 2026-02-30T08:00:00Z does not exist"),
    (("2026-01-01T08", "2026-01-01T28"), '"2026-01-01T28', "simulated: 'epoch' must be an instant in UTC such as 2026"),
]


@pytest.mark.parametrize(
    ("change", "at", "message"), CHANGES, ids=[f"{at[:12]}-{text[:40]}" for _, at, text in CHANGES]
)
def test_every_mistake_is_told_where_it_is(tmp_path, change, at, message):
    """One thing changed in the real file is one finding at its place, with what to write instead."""
    text = changed(tmp_path, change)
    wrong = found(tmp_path)
    assert any(line.startswith(f"{place(text, at)}: ") and message in line for line in wrong), wrong


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("closed: [a], conducts: false", "closed: [c], conducts: false"), "relays has no contact 'c'"),
        (
            ("{relays: relays, closed: [b]", "{relays: relay, closed: [b]"),
            "unknown relays 'relay', did you mean 'relays'?",
        ),
        (('lowest_current: "0.0015"', 'lowest_current: "-0.0005"'), "with positions, lowest_current must be above 0"),
    ],
)
def test_positions_must_be_ones_that_arm_can_try(tmp_path, change, message):
    """Contacts and relays must exist, and a current must be asked for."""
    changed(tmp_path, change)
    assert any(f"supply.coil: {message}" in line for line in found(tmp_path)), found(tmp_path)


@pytest.mark.parametrize(
    ("limit", "messages"),
    [
        ("quantity: rail, unit: V", []),
        ('quantity: flags, unit: "1"', []),
        (
            "quantity: rial, unit: V",
            ["data_acquisition has no rial: its wire names rail, plate, flags"],
        ),
        ("quantity: plate, unit: K", ["plate is given in degC here, not in 'K'"]),
        ("quantity: slope, of: plate, over: 60 s, unit: K/min", []),
        ('quantity: unchanged, of: rail, band: "0", unit: h', []),
        (
            "quantity: slope, of: plat, over: 60 s, unit: K/min",
            ["seen: data_acquisition has no plat: its wire names rail, plate, flags"],
        ),
        (
            "quantity: slope, of: plate, over: 60 s, unit: V/s",
            ["slope of plate is given in K/s, K/min or K/h here, not in 'V/s', did you mean 'K/s'?"],
        ),
        (
            'quantity: charge, while: charging, threshold: "1", since: arm, unit: A.h',
            ["seen: no input of data_acquisition is known to be a current: limit a slope, or the time unchanged"],
        ),
        (
            "quantity: rail, against: supply.coil, unit: V",
            ["seen: an input of data_acquisition cannot be held against another output: give each a limit of its own"],
        ),
    ],
)
def test_a_limit_names_an_input_of_the_wire(tmp_path, limit, messages):
    """Names and units of its inputs stand in its settings, and in no role."""
    daq = '  daq1: {driver: keysight-34970a, port: "TCPIP::192.168.10.41::5025::SOCKET", identity: {model: 34970A}}\n'
    inputs = '{"101": rail V 10, "102": plate degC K, "301": flags 1}'
    wire = f"- {{role: data_acquisition, instrument: daq1, settings: {inputs}}}\n"
    changed(
        tmp_path,
        ("instruments:\n", f"instruments:\n{daq}"),
        ("wiring:\n", f"wiring:\n{wire}"),
        (
            "envelope:\n",
            f'envelope:\n- {{id: seen, output: data_acquisition, {limit}, max: "5", period: 1 s, max_age: 5 s}}\n',
        ),
        ("  peers:\n", "  peers:\n    daq1: {}\n"),
    )
    assert [line.split(": ", 1)[1] for line in found(tmp_path)] == messages


def test_rating_of_the_whole_instrument_holds_for_every_channel(tmp_path):
    """A rating without a channel is held against the clamps of all its outputs; one of another channel is not."""
    changed(
        tmp_path, ('{channel: "2", quantity: voltage, unit: V, max: "25"}', '{quantity: voltage, unit: V, max: "5"}')
    )
    assert [line.split(": ", 1)[1] for line in found(tmp_path)] == [
        "supply.coil: a clamp at 6 V exceeds the rating 5 V"
    ]
    changed(
        tmp_path, ('{channel: "2", quantity: voltage, unit: V, max: "25"}', '{quantity: voltage, unit: V, max: "3"}')
    )
    assert len(found(tmp_path)) == 2
    changed(tmp_path, ('{channel: "2", quantity: v', '{channel: "1", quantity: v'), ('V, max: "25"', 'V, max: "3"'))
    assert found(tmp_path) == []


def test_certificate_elsewhere_is_none(tmp_path):
    """A file outside the bench's folder would not be in a package."""
    changed(tmp_path, ("certificates/mag1.txt", "../mag1.txt"))
    (tmp_path / "fixtures" / "benches" / "mag1.txt").write_text("a certificate", encoding="utf-8")
    assert [line.split(": ", 1)[1] for line in found(tmp_path)] == [
        "there is no certificate '../mag1.txt' in the bench's folder"
    ]


def test_all_findings_come_at_once_and_sorted(tmp_path):
    """Mistakes in five sections are five findings in the order of the file."""
    text = changed(
        tmp_path,
        ("place: Attitude", "plaice: Attitude"),
        ("driver: lis3mdl", "driver: lis3mld"),
        ('max: "6"', 'max: "26"'),
        ("max_age: 5 s", "max_age: 1 s"),
        ("state: released", "state: relesed"),
    )
    snippets = ["plaice", "lis3mld", "{output: supply.coil, quantity: voltage", "{id: coil-c", "{output: relays"]
    assert [line.split(": ")[0] for line in found(tmp_path)] == [place(text, snippet) for snippet in snippets]


@pytest.mark.parametrize(
    ("change", "count"),
    [
        (("    driver: lis3mdl\n", ""), 1),
        (("role: magnetometer, ", ""), 1),
        (("    bus: i2c1\n", ""), 1),
        (('  epoch: "2026-01-01T08:00:00Z"\n', ""), 1),
        (('unit: V, max: "25"', 'max: "25"'), 1),
    ],
)
def test_what_is_missing_is_told_once(tmp_path, change, count):
    """A key that is not there is one finding, and nothing that only follows from it."""
    changed(tmp_path, change)
    assert len(found(tmp_path)) == count


def test_two_instruments_without_a_port_do_not_clash(tmp_path):
    """Two that lack their port are told so; they are not at the same place."""
    changed(tmp_path, ("    port: TCPIP::192.168.10.21::5025::SOCKET\n", ""), ("    bus: i2c1\n", ""))
    assert [line.split(": ", 1)[1] for line in found(tmp_path)] == [
        f"{name} needs either a port or a bus with an address" for name in ("psu1", "mag1")
    ]


def test_two_ways_to_write_one_port_clash(tmp_path):
    """They are one instrument, and would be driven twice."""
    relays = ("/dev/serial/by-id/usb-FTDI_FT232R_A50285BI-if00-port0", "socket://localhost:5025")
    changed(tmp_path, ("TCPIP::192.168.10.21::5025::SOCKET", "TCPIP::127.0.0.1::5025::SOCKET"), relays)
    assert any(line.endswith("relay1 and psu1 are both at port socket://localhost:5025") for line in found(tmp_path))


def test_other_schema_is_refused(tmp_path):
    """A file of another version is not read on."""
    changed(tmp_path, ("hil/bench/1", "hil/bench/2"))
    assert len(found(tmp_path)) == 1
    assert "reads schema 'hil/bench/1', not 'hil/bench/2'" in found(tmp_path)[0]


def test_unknown_bench_names_the_nearest(tmp_path):
    """A bench that does not exist is refused with the one that was meant, and all there are."""
    changed(tmp_path)
    benches = tmp_path / "fixtures" / "benches"
    with pytest.raises(Refused, match="no bench 'adsc' in fixtures/benches, did you mean 'adcs'.*benches are: adcs"):
        load_bench(benches, "adsc", tmp_path)
    assert bench_names(benches) == ("adcs",)
    assert bench_names(tmp_path) == ()


@pytest.mark.parametrize(
    ("change", "at", "message"),
    [
        (('turns: "60"', 'turms: "60"'), '"60"\n', "unknown key 'turms', did you mean 'turns'?"),
        (
            ('resistance: "97.9"', 'resistance: "-1"'),
            '"-1"}\n          x_m',
            "'resistance' must be above 0, found \"-1\"",
        ),
        (("serial: MY59002391\n        ch", "sreial: X\n        ch"), "X\n", "unknown key 'sreial', did you mean"),
        (("coil.contact_b", "coil.contakt_b"), "coil.contakt_b", "did you mean 'contact_b'?"),
        (("grid: 10 ms", "grid: 0 s"), "0 s\n      truth", "'grid' must be at least 1 ns"),
        (("model: coil-and-earth-field", "model: coil"), "coil\n      grid", "unknown plant model 'coil'"),
        (("coil.outward", "coil.outwards"), "coil.outwards", "outward"),
        (('over_voltage: "8"', 'over_voltage: "8 A"'), '"8 A"', "'over_voltage' must be a number in V"),
        (("rate: 80 Hz", "rate: 81 Hz"), "81 Hz", "'rate' must be one of"),
        (
            ('instrument: psu1, channel: "3"', 'instrument: mag1, channel: "3"'),
            "{role: supply, instance: sensor",
            "the driver lis3mdl does not fill the role supply",
        ),
    ],
)
def test_what_only_the_twin_understands_has_a_place_too(tmp_path, change, at, message):
    """Truths, terminals, persons and settings of wires are told at their place in the same file."""
    text = changed(tmp_path, change)
    with pytest.raises(ConfigurationError) as caught:
        load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    wrong = [str(finding) for finding in caught.value.findings]
    assert any(line.startswith(f"{place(text, at)}: ") and message in line for line in wrong), wrong


def test_all_mistakes_of_the_twin_come_at_once(tmp_path):
    """Wrong truths of a plant and of a peer are two findings."""
    changed(tmp_path, ('turns: "60"', 'turms: "60"'), ('gain: ["0.002"', 'gian: ["0.002"'))
    with pytest.raises(ConfigurationError) as caught:
        load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    assert len(caught.value.findings) >= 2
    assert list(caught.value.findings) == sorted(caught.value.findings)


def test_bench_without_twin_is_refused(tmp_path):
    """A bench for hardware only can be read, but not simulated."""
    text = changed(tmp_path)
    changed(tmp_path, (text[text.index("simulated:") :], ""))
    spec = load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    assert spec.simulated is None
    with pytest.raises(Refused, match="no simulated twin; add a 'simulated' section"):
        simulated_twin(spec)


def test_only_the_cause_is_told_where_a_plant_cannot_be_built(tmp_path):
    """Peers and the person name the plant; that it could not be built is the plant's own mistake, told once."""
    changed(tmp_path, ('turns: "60"', 'turn: "60"'))
    with pytest.raises(ConfigurationError) as error:
        load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    messages = [finding.message for finding in error.value.findings]
    assert messages == ["truth: key 'turns' is missing", "unknown key 'turn', did you mean 'turns'?"]


def test_a_plant_that_is_nowhere_is_told_by_everybody_who_names_it(tmp_path):
    """Where there is no such plant, every place that names it has to be changed."""
    changed(tmp_path, ("  plants:\n    coil:", "  plants:\n    coyl:"))
    with pytest.raises(ConfigurationError) as error:
        load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    messages = {finding.message for finding in error.value.findings}
    assert messages == {"unknown plant 'coil', did you mean 'coyl'?"}
    assert len(error.value.findings) > 3


def loop(path):
    """Make the path a link to itself."""
    path.unlink()
    path.symlink_to(path)


def folder(path):
    """Make the path a folder."""
    path.unlink()
    path.mkdir()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (loop, "the certificate 'certificates/mag1.txt' cannot be read: "),
        (folder, "the certificate 'certificates/mag1.txt' is no file"),
    ],
)
def test_certificate_that_is_no_file_is_told(tmp_path, spoil, message):
    """A loop of links and a folder are findings, not tracebacks."""
    changed(tmp_path)
    spoil(tmp_path / "fixtures/benches/adcs/certificates/mag1.txt")
    (line,) = found(tmp_path)
    assert message in line
    assert re.match(r"fixtures/benches/adcs/bench.yaml:\d+:\d+: ", line)


def test_certificate_whose_name_holds_a_zero_is_told(tmp_path):
    """What no file system can hold is a finding."""
    changed(tmp_path, ("certificate: certificates/mag1.txt", r'certificate: "certificates/\0mag1.txt"'))
    assert any("cannot be read" in line for line in found(tmp_path))


def test_certificate_of_any_kind_of_content_is_taken(tmp_path):
    """It is hashed and kept, never read as text."""
    changed(tmp_path)
    (tmp_path / "fixtures/benches/adcs/certificates/mag1.txt").write_bytes(b"\x00\xff%PDF\xfe")
    assert found(tmp_path) == []


@pytest.mark.parametrize("spoil", [loop, folder], ids=["loop", "folder"])
def test_bench_file_that_is_no_file_is_told(tmp_path, spoil):
    """A loop of links or a folder in place of the bench file ends in a sentence."""
    changed(tmp_path)
    spoil(tmp_path / "fixtures/benches/adcs/bench.yaml")
    try:
        (line,) = found(tmp_path)
    except Refused as refused:
        line = str(refused)
    assert re.search("cannot be read|is not a file|there is no bench 'adcs'", line)


@pytest.mark.parametrize(
    "change",
    [
        ('max: "25"', f'max: "{"9" * 1_000_000}"'),
        ('max: "25"', 'max: "1e999999999"'),
        ("period: 1 s", f'period: "{"9" * 1_000_000} s"'),
        ('seed: "20260101"', f'seed: "{"1" * 1_000_000}"'),
        ("driver: lis3mdl", f"driver: {'l' * 1_000_000}"),
        ("unit: V, from", f"unit: {'V' * 1_000_000}, from"),
        ("instance: coil", f"instance: {'a' * 1_000_000}"),
    ],
    ids=lambda change: change[0],
)
def test_endless_values_are_short_findings(tmp_path, change):
    """Whatever stands in the file, a person can read what is said of it."""
    changed(tmp_path, change)
    lines = found(tmp_path)
    assert all(len(line) < 700 for line in lines)
    assert lines or change[0] == "unit: V, from"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('min: "0", max: "6"', 'min: "0", max: "x"'), "clamps: 'max' must be a decimal number in quotes, found \"x\""),
        (
            (
                'channel: "2", quantity: voltage, unit: V, max: "25"',
                'channel: "2", quantity: voltage, unit: V, max: 25',
            ),
            "ratings: 'max'",
        ),
        (("wiring:\n", "wiring: 5\nxwiring:\n"), "bench: 'wiring' must be a list, found `5`"),
        (
            ('hazardous: false,\n   note: "red', 'hazardus: false,\n   note: "red'),
            "unknown key 'hazardus', did you mean",
        ),
        (("instance: coil,", "instanse: coil,"), "unknown key 'instanse', did you mean 'instance'?"),
        (("role: supply, instance: coil", "instance: coil"), "wiring: key 'role' is missing"),
        (('seed: "', 'seed: !odd "'), "the tag !odd is not allowed, remove it"),
        (('due: "2027-09-30"', "due: .nan"), "`.nan` is not a finite number, give a value, or leave the key out"),
        (
            ("  psu1:\n    driver: keysight-e36300", "  psu1: 5\n  psu2:\n    driver: keysight-e36300"),
            "must be a mapping",
        ),
        (("safe_off:\n", "safe_off: none\nxsafe:\n"), "'safe_off' must be a list"),
        (("safe_off:\n", "safe_of:\n"), "key 'safe_off' is missing"),
        (
            ("role: supply, instance: coil", "role: suply, instance: coil"),
            "unknown role 'suply', did you mean 'supply'?",
        ),
        (("driver: keysight-e36300", "driver: keysight-e3630"), "unknown driver 'keysight-e3630', did you mean"),
    ],
)
def test_nothing_is_told_that_only_follows(tmp_path, change, message):
    """What relies on a part that could not be read waits until it can be: one mistake is told once."""
    changed(tmp_path, change)
    with pytest.raises(ConfigurationError) as caught:
        load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
    messages = [finding.message for finding in caught.value.findings]
    assert any(message in each for each in messages), messages
    assert [each for each in messages if message not in each and not each.startswith("unknown key ")] == []


def test_mistakes_of_bench_and_twin_are_told_together(tmp_path):
    """A truth, a terminal and a fault of one peer, a clamp, and the setting of a wire, whichever of them is wrong."""
    changes = (
        ('voltage_offset: "0.0006"', 'voltage_offset: "q"'),
        ('"2": coil.supply', '"2": coil.suply'),
        ('"3": coil.sensor_power}', '"3": coil.sensor_power}\n      faults: [{kind: ded}]'),
    )
    twin = ["'voltage_offset' must be", "no supply port 'suply', did you mean 'supply'", "unknown fault 'ded'"]
    for more, said in (
        (("range: 4 gauss", "range: 5 gauss"), "'range' must be one of"),
        (('min: "0", max: "6"', 'min: "7", max: "6"'), "supply.coil: min 7 is above max 6"),
        (('turns: "60"', "turns: 60"), "'turns' must be text, found `60`"),
    ):
        changed(tmp_path, *changes, more)
        with pytest.raises(ConfigurationError) as caught:
            load_bench(tmp_path / "fixtures" / "benches", "adcs", tmp_path, twin=check_twin)
        for part in (*twin[: 1 if "turns" in more[0] else None], said):
            assert part in str(caught.value)
