"""A temperature controller in a bench file: what must be said of it, and what arm makes of it."""

from __future__ import annotations

from pathlib import Path

import pytest
from adcs_bench import bound, changed, found
from chamber_wiring import chamber_changes

from hil.bench.binding import check_twin
from hil.bench.file.reading import load_bench
from hil.bench.readiness import energised_gates, unpowered_gates
from hil.bench.safe_off import make_safe
from hil.model.errors import ConfigurationError


def wired(root: Path, *changes, **truth):
    """Lay the bench with the chamber into a workspace, with more texts changed; return the bench's name and folder."""
    changed(root, *chamber_changes(**truth).items())
    file = root / "fixtures/benches/adcs/bench.yaml"
    text = file.read_text(encoding="utf-8")
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    file.write_text(text, encoding="utf-8")
    return file


def loaded(root: Path):
    """Return the bench of the workspace, its twin checked."""
    return load_bench(root / "fixtures/benches", "adcs", root, twin=check_twin)


def test_the_chamber_fits_the_bench(tmp_path):
    """File and twin are clean, and a bench with it is ready, with the controller in standby."""
    wired(tmp_path)
    spec = loaded(tmp_path)
    with bound(spec) as bench:
        gates = [*unpowered_gates(bench), *energised_gates(bench, None)]
        assert [gate for gate in gates if not gate.ok] == []
        assert "envelope plate-temperature" in {gate.name for gate in gates}


def test_a_controller_found_regulating_is_made_safe(tmp_path):
    """It is reported at arm, and the safe-off puts it into standby and proves that by its output."""
    wired(tmp_path, ('sensor_offset: "0.15"', 'sensor_offset: "0.15", mode: operating, setpoint: "40"'))
    with bound(loaded(tmp_path)) as bench:
        bench.clock.sleep(5)
        assert "found on: channel 0" in next(
            gate.detail for gate in unpowered_gates(bench) if gate.name == "outputs of tec1"
        )
        results = []
        assert make_safe(bench.spec.safe_off, bench.roles, bench.clock, results.append)
        assert results[0].detail == "thermal output 0 %"
        assert bench.world.plants["chamber"].inputs["tec"] == 0


SAFE_LINE = """\
safe_off:
- {output: thermal, state: standby, within: 6 s,
   proof: {output: thermal, quantity: output, unit: "%", min: "-0.05", max: "0.05"}}
"""
CLAMP = '- {output: thermal, quantity: temperature, unit: degC, min: "-20", max: "45"}\n'


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ((SAFE_LINE, "safe_off:\n"), "thermal is missing from safe_off"),
        ((CLAMP, ""), "thermal needs clamps for temperature"),
        ((CLAMP, CLAMP.replace("degC", "K")), "temperature is given in degC here, not in 'K'"),
        ((CLAMP, CLAMP.replace("thermal", "relays")), "relays has no temperature"),
    ],
)
def test_what_must_be_said_of_it(tmp_path, change, message):
    """A cooler can do harm: it is clamped, and made safe."""
    wired(tmp_path, change)
    assert any(message in line for line in found(tmp_path)), found(tmp_path)


def test_a_wrong_setting_of_its_wire_is_told_with_its_place(tmp_path):
    """What only the driver understands is asked of the driver."""
    wired(tmp_path, ('decimals: "1"', 'decimals: "7"'))
    with pytest.raises(
        ConfigurationError,
        match=r"bench.yaml:\d+:\d+: wiring thermal: 'decimals' must be at most 2",
    ):
        loaded(tmp_path)
