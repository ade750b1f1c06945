"""Properties of the analysis of batteries that hold for any samples."""

from __future__ import annotations

import numpy as np
import pytest
import sweeps
from hypothesis import given, settings
from hypothesis import strategies as st

from hil.analysis.battery.cycles import cycles
from hil.analysis.battery.half_cycle import flow
from hil.analysis.battery.integration import one_way
from hil.analysis.battery.series import series
from hil.analysis.battery.steps import StepKind, segment
from hil.logs import cycler
from hil.model.errors import Refused

SAMPLES = st.lists(
    st.tuples(st.floats(0.5, 60.0), st.floats(2.0, 4.5), st.floats(-3.0, 3.0) | st.just(0.0)), min_size=3, max_size=60
)


def data_of(samples):
    """Samples as a series."""
    steps, voltage, current = np.array(samples).T
    return series(np.cumsum(steps), voltage, current)


@settings(max_examples=sweeps.examples(60))
@given(SAMPLES)
def test_steps_part_the_samples_and_no_charge_is_lost(samples):
    """Steps follow each other without gap or overlap; in less out is the trapezoid where no gap is."""
    data = data_of(samples)
    steps = segment(data)
    assert [step.first for step in steps] == [0, *(step.last + 1 for step in steps[:-1])]
    assert steps[-1].last == data.time.size - 1
    flows = flow(data, steps)
    if not flows.lost.any():
        net = flows.charge[StepKind.CHARGE].sum() - flows.charge[StepKind.DISCHARGE].sum()
        assert net == pytest.approx(np.trapezoid(data.current, data.time) / 3600.0, abs=1e-9)


@settings(max_examples=sweeps.examples(60))
@given(SAMPLES, st.floats(-1e4, 1e4))
def test_when_a_test_began_does_not_matter(samples, shift):
    """The same samples later give the same cycles, only later."""
    data = data_of(samples)
    later = series(data.time + shift, data.voltage, data.current)
    for one, other in zip(cycles(data), cycles(later), strict=True):
        assert one.number == other.number
        assert one.start + shift == pytest.approx(other.start, abs=1e-6)
        assert (one.charge is None) == (other.charge is None)


@settings(max_examples=sweeps.examples(60))
@given(SAMPLES)
def test_what_flows_one_way_is_never_negative(samples):
    """Both sides are not below zero, and turning the sign exchanges them."""
    data = data_of(samples)
    assert (one_way(data.time, data.current, 1) >= 0).all()
    assert np.array_equal(one_way(data.time, data.current, 1), one_way(data.time, -data.current, -1))


@settings(max_examples=sweeps.examples(60))
@given(st.text(alphabet="0123456789;,.-+eE \r\nTESTND", max_size=300))
def test_any_text_is_a_log_or_is_refused(tmp_path_factory, text):
    """Whatever bytes a terminal wrote: rows with a time that does not go back, or a plain refusal."""
    path = tmp_path_factory.mktemp("log") / "putty.log"
    path.write_text(text, encoding="ascii", newline="")
    try:
        log = cycler.read(path)
    except Refused:
        return
    assert (np.diff(log.time) > 0).all()
