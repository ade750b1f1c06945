"""Whether an instrument says that it is simulated, and how that is left out of a comparison."""

from __future__ import annotations

import pytest

from hil.bench.port_identity import difference_of
from hil.model.identity import Identity


@pytest.mark.parametrize(
    ("identity", "told"),
    [
        (Identity(manufacturer="Keysight", model="E36312A", serial="SIM-MY1"), "Keysight E36312A SIM-MY1"),
        (Identity(model="hil-cycler", serial="C1", firmware="SIM.0"), "hil-cycler C1, SIMULATED"),
        (Identity(model="3216", firmware="1.0+SIMULATED"), "3216, SIMULATED"),
        (Identity(model="S-LS-31 SIMULATED"), "S-LS-31 SIMULATED"),
    ],
)
def test_a_mark_is_seen_and_told(identity, told):
    """In serial number, firmware, or by the word."""
    assert (identity.simulated, str(identity)) == (True, told)


@pytest.mark.parametrize("identity", [Identity(), Identity(model="ESIM", serial="SIM1", firmware="1.0")])
def test_what_carries_no_mark_is_not_simulated(identity):
    """Neither an empty identity nor three letters that happen to be there."""
    assert not identity.simulated


def test_a_simulated_instrument_stands_for_the_one_of_the_bench_file():
    """The mark is left out of the comparison, and nothing else is."""
    expected = Identity(model="E36312A", serial="MY1", firmware="1.0")
    assert not difference_of(expected, Identity(model="E36312A", serial="SIM-MY1", firmware="1.0"))
    assert not difference_of(expected, Identity(model="E36312A", serial="SIM-MY1", firmware="SIM"))
    said = difference_of(expected, Identity(model="E36312A", serial="SIM-MY2", firmware="1.0"))
    assert said == "expected serial 'MY1', found 'MY2'"
    assert "firmware" in difference_of(expected, Identity(model="E36312A", serial="SIM-MY1", firmware="2.0"))
