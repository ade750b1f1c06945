"""A bench whose instruments name their entries in the register: their certificates are the register's."""

from __future__ import annotations

from dataclasses import replace

import pytest
from changed_benches import laid, loaded
from workspaces import ROOT

from hil.bench.file.reading import load_bench
from hil.bench.readiness import _other_serial
from hil.model.errors import ConfigurationError
from hil.model.identity import Identity

REGISTER = "fixtures/instruments.yaml"
CERTIFICATE = "fixtures/certificates/psu-01-2026.txt"
NAMED = "    register: PSU-01\n"


def said(root, changes=None, *, register=None, certificate=None, spoil=None):
    """Return what is said of the battery bench with its files changed."""
    laid(root, changes or {})
    if register:
        text = (root / REGISTER).read_text(encoding="utf-8")
        assert register[0] in text
        (root / REGISTER).write_text(text.replace(*register), encoding="utf-8")
    if certificate is not None:
        (root / CERTIFICATE).write_bytes(certificate)
    if spoil:
        spoil(root)
    with pytest.raises(ConfigurationError) as caught:
        load_bench(root / "fixtures/benches", "battery", root)
    return [str(finding) for finding in caught.value.findings]


def test_an_instrument_takes_its_calibration_from_the_register(tmp_path):
    """Certificate, due date, ranges and serial number are those of the entry that the bench file names."""
    psu1 = loaded(tmp_path, {}).instruments[0]
    assert psu1.calibration is not None
    assert psu1.calibration.registered is not None
    assert (psu1.calibration.due, len(psu1.calibration.ranges)) == ("2027-09-30", 2)
    assert psu1.calibration.registered.serial == "DP8C231402017"
    assert psu1.calibration.registered.date == "2026-09-30"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"changes": {NAMED: "    register: PSU-1\n"}}, "psu1: there is no instrument 'PSU-1' in fixtures/instruments"),
        ({"changes": {NAMED: "    register: PSU-1\n"}}, "did you mean 'PSU-01'?"),
        (
            {"changes": {NAMED: NAMED + '    calibration: {certificate: x, due: "2027-01-01", ranges: []}\n'}},
            "psu1: an instrument of the register has no calibration in the bench file; leave one of them out",
        ),
        (
            {"register": ("serial: DP8C231402017", "serial: DP8C000000000")},
            "psu1: its serial number is 'DP8C231402017' here, and 'DP8C000000000' in fixtures/instruments.yaml",
        ),
        ({"certificate": b""}, "file certificates/psu-01-2026.txt of certificate SPECIMEN-2026-1 is empty"),
        ({"certificate": b"another"}, "certificate SPECIMEN-2026-1 has another SHA-256 than the register says"),
        ({"spoil": lambda root: (root / CERTIFICATE).unlink()}, "certificate SPECIMEN-2026-1 is missing"),
        ({"register": ("due:", "deu:")}, "fixtures/instruments.yaml:14:7: unknown key 'deu', did you mean 'due'?"),
        ({"spoil": lambda root: (root / REGISTER).unlink()}, "psu1: there is no instrument 'PSU-01' in fixtures/instr"),
    ],
)
def test_what_does_not_fit_is_told(tmp_path, arguments, message):
    """A certificate that is another than the register says, or for another instrument, is refused before a run."""
    found = said(tmp_path, **arguments)
    assert any(message in line for line in found), found


def test_a_bench_without_registered_instruments_needs_no_register(tmp_path):
    """A mistake in the register does not keep another bench from working."""
    laid(tmp_path, {}, "adcs")
    (tmp_path / REGISTER).write_text("nonsense", encoding="utf-8")
    load_bench(tmp_path / "fixtures/benches", "adcs", tmp_path)


@pytest.mark.parametrize(
    ("serial", "detail"),
    [
        ("DP8C231402017", ""),
        ("", ""),
        ("SIM-DP8C1", ""),
        ("DP8C1", "the certificate of PSU-01 is for serial 'DP8C231402017', found 'DP8C1'"),
    ],
)
def test_the_certificate_of_another_instrument(serial, detail):
    """An instrument was exchanged for another of its model: its own serial number says so, where it tells one."""
    psu1 = load_bench(ROOT / "fixtures/benches", "battery", ROOT).instruments[0]
    psu1 = replace(psu1, identity=Identity(model="DP832"))
    assert _other_serial(psu1, Identity(model="DP832", serial=serial)) == detail
