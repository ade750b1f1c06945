"""Magnetorquer polarity and strength: which way, how strong, how linear."""

from __future__ import annotations

import numpy as np
import pytest

from hil.analysis import direction, expected_field, field_ratio, line_residuals, linearity, odd_response, resistance
from hil.plan import Curve

BOARDS = ("x_plus", "x_minus", "y_plus", "y_minus", "z_plus", "z_minus")
OUTWARD_NORMAL = (0.0, 0.0, 1.0)
PHASES = ((+1, "forward"), (0, "without"), (-1, "reverse"))
COMPASS = ("outward", "inward", "unclear")


def named(board):
    """Return a board as the report calls it: `board x+`."""
    axis, side = board.split("_")
    return f"board {axis}{'+' if side == 'plus' else '-'}"


def attach(operator, board):
    """Ask for one outer board on the jig."""
    operator.connect(
        board,
        f"Connect the coil of board {board}: ADCS pin to relay a, VCC_MAG pin to relay b, outer face to the sensor",
        name="outer-board",
        options=BOARDS,
    )


def three_phases(coil, field, record, step, current, *, duration, rate):
    """Record the field at +I, 0 and -I; return the recordings, and voltage and current with each direction."""
    recordings, readings = [], []
    for sign, word in PHASES:
        with step(f"Record the field {word} current"):
            coil.drive(sign * current)
            recordings.append(record("field", field, duration=duration, rate=rate))
            if sign:
                readings.append(coil.reading(sign))
    return recordings, readings


def response_of(repetitions):
    """Return what the coil adds to the field, from the recordings of several repetitions."""
    vectors = [[np.column_stack([one[axis] for axis in "xyz"]) for one in phases] for phases in repetitions]
    times = [[one.time.mean() for one in phases] for phases in repetitions]
    plus, zero, minus = zip(*vectors, strict=True)
    return odd_response(plus, zero, minus, times=times, unit=repetitions[0][0].unit("z"))


def scale_uncertainty(recording):
    """Return the relative standard uncertainty of the magnetometer's scale, from its certificate."""
    return recording.uncertainty("z") / np.abs(recording["z"]).max()


@pytest.mark.requirement("ADCS-MTQ-010", "ADCS-MTQ-020", "ADCS-MTQ-030", "ADCS-MTQ-050")
@pytest.mark.max_duration(600)
@pytest.mark.parametrize("board", BOARDS)
def test_polarity(board, operator, coil, field, record, check, step, iterations, parameters):
    """The coil's field leaves the outer face, with the size that its geometry gives."""
    with step("Put the outer board on the jig"):
        attach(operator, board)
    repetitions, readings = [], []
    for _ in iterations("Repetition", int(parameters.repetitions)):
        phases, measured = three_phases(
            coil, field, record, step, parameters.current, duration=parameters.phase, rate=parameters.rate
        )
        repetitions.append(phases)
        readings += measured
    with step("Switch the coil off"):
        coil.drive(0)

    found = direction(response_of(repetitions), OUTWARD_NORMAL, alignment=parameters.alignment)
    where = named(board)
    check("ADCS-MTQ-010", "sense", found.sense, at=where)
    check("ADCS-MTQ-010", "significance", found.significance, at=where)
    check("ADCS-MTQ-010", "angle", found.angle, at=where, headline="Field from the outward normal")

    voltages, currents = zip(*readings, strict=True)
    expected = expected_field(
        parameters.turns,
        parameters.figure("side_a", uncertainty="side_uncertainty"),
        parameters.figure("side_b", uncertainty="side_uncertainty"),
        parameters.figure("distance", uncertainty="distance_uncertainty"),
        currents[0],
    )
    gain = scale_uncertainty(repetitions[0][0])
    ratio = field_ratio(found.projection, expected, gain=gain)
    check("ADCS-MTQ-020", "field_ratio", ratio, at=where, headline="Field over what the geometry gives")
    check("ADCS-MTQ-030", "resistance", resistance(voltages, currents), at=where, headline="Resistance of the coil")


@pytest.mark.requirement("ADCS-MTQ-040")
@pytest.mark.max_duration(1800)
@pytest.mark.parametrize("board", BOARDS)
def test_linearity(board, operator, coil, field, record, check, chart, step, iterations, parameters):
    """The field follows the current in a straight line."""
    with step("Put the outer board on the jig"):
        attach(operator, board)
    currents, fields = [], []
    for nominal in parameters.currents:
        with step(f"Measure at {nominal * 1e3:g} mA"):
            repetitions, readings = [], []
            for _ in iterations("Repetition", int(parameters.repetitions)):
                phases, measured = three_phases(
                    coil, field, record, step, nominal, duration=parameters.linearity_phase, rate=parameters.rate
                )
                repetitions.append(phases)
                readings += measured
            currents.append(readings[0][1])
            fields.append(direction(response_of(repetitions), OUTWARD_NORMAL).projection)
    with step("Switch the coil off"):
        coil.drive(0)
    residuals = line_residuals(currents, fields)
    line = [each.value - residual for each, residual in zip(fields, residuals, strict=True)]
    chart(
        "Field over current",
        Curve(name=named(board), x=currents, y=fields, model=(currents, line), residual=residuals),
        x=("coil current", "mA"),
        y=("field along the normal", "uT"),
        lines="the straight lines that fit best",
    )
    check("ADCS-MTQ-040", "nonlinearity", linearity(currents, fields), at=named(board), headline="Non-linearity")


@pytest.mark.requirement("ADCS-MTQ-060")
@pytest.mark.max_duration(600)
@pytest.mark.parametrize("board", BOARDS)
def test_direction_by_compass(board, operator, coil, check, step, parameters):
    """A phone's compass at the outer face shows the direction, where no magnetometer is at hand."""
    with step("Put the outer board on the jig"):
        attach(operator, board)
    for sign, word in ((+1, "forward"), (-1, "reverse")):
        with step(f"Look at the compass with {word} current"):
            coil.drive(sign * parameters.current)
            seen = operator.choose(
                "Hold the phone to the outer face: which way does the field point?", COMPASS, name="phone-direction"
            )
            check("ADCS-MTQ-060", word, seen, at=named(board))
    with step("Switch the coil off"):
        coil.drive(0)
