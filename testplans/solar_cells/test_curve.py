"""The current-voltage curve of a solar panel: in the dark, under the lamp, there and back, and again."""

from __future__ import annotations

import pytest

from hil.analysis import Column, IvConditions, IvFacts, as_csv, curve_difference, iv_curve
from hil.plan import Curve

FIGURES = (
    ("EPS-SOL-020", "short_circuit_current", "Short-circuit current"),
    ("EPS-SOL-021", "open_circuit_voltage", "Open-circuit voltage"),
    ("EPS-SOL-022", "maximum_power", "Maximum power"),
    ("EPS-SOL-023", "fill_factor", "Fill factor"),
    ("EPS-SOL-030", "series_resistance", "Series resistance"),
    ("EPS-SOL-030", "shunt_conductance", "Shunt conductance"),
)
CORRECTED = ("short_circuit_current", "open_circuit_voltage", "maximum_power", "fill_factor")
"""The others are those of the panel as it was under the lamp."""
COEFFICIENTS = {"alpha": "alpha", "beta": "beta", "kappa": "kappa", "light": "light", "resistance": "series_resistance"}
COLUMNS = (
    Column("sweep"),
    Column("voltage", "V", ".6f"),
    Column("current", "A", ".6f"),
    Column("irradiance", "W/m^2", ".2f"),
    Column("temperature", "degC", ".3f"),
)


def conditions_of(parameters):
    """Return what is corrected to, by procedure 2."""
    coefficients = {
        key: parameters.figure(name, uncertainty=f"{name}_uncertainty") for key, name in COEFFICIENTS.items()
    }
    return IvConditions(irradiance=parameters.irradiance, temperature=parameters.temperature, **coefficients)


def rows_of(name, sweep):
    """Return what was measured, as rows of a table."""
    columns = (sweep.voltage, sweep.current, sweep.irradiance, sweep.temperature)
    return [(name, *(each.value for each in row)) for row in zip(*columns, strict=True)]


def draw(own, forward, dark, chart):
    """Draw current and power as measured and as corrected, with the maximum."""
    volts, amperes = (forward.figures[f"{name}_at_maximum"] for name in ("voltage", "current"))
    chart(
        "Current-voltage curve",
        Curve(name="as measured", x=list(own.voltage), y=list(own.current)),
        Curve(name="corrected", x=list(forward.voltage), y=list(forward.current)),
        Curve(name="maximum power, corrected", x=[volts], y=[amperes]),
        Curve(name="dark", x=[dark[0]], y=[dark[1]]),
        x=("voltage", "V"),
        y=("current", "A"),
    )
    chart(
        "Power",
        Curve(name="as measured", x=list(own.voltage), y=list(own.voltage * own.current)),
        Curve(name="corrected", x=list(forward.voltage), y=list(forward.voltage * forward.current)),
        Curve(name="maximum, corrected", x=[volts], y=[forward.figures["maximum_power"]]),
        x=("voltage", "V"),
        y=("power", "W"),
    )


def loose_thermometer(warming, parameters):
    """Return why the panel's temperature cannot be believed: the lamp warms whatever it lights."""
    if warming.value >= parameters.least_warming:
        return []
    return [f"the lamp warmed the panel's thermometer by {warming.value:.1f} K only: look whether it sits on the panel"]


@pytest.mark.requirement(
    *(f"EPS-SOL-{number}" for number in ("010", "011", "020", "021", "022", "023", "030", "040", "050"))
)
@pytest.mark.max_duration(3600)
@pytest.mark.repeatable("light and load leave a solar cell as it was")
def test_curve(
    operator, solar, electronic_load, thermometer, multimeter, record, check, chart, step, artifact, parameters
):
    """Short circuit, open circuit, maximum power, fill factor and resistances at stated conditions."""
    with step("Put the panel into the box"):
        operator.confirm(
            "The panel lies on its plate under the lamp, its leads are connected, the box is closed", name="box"
        )
    with step("Measure in the dark"):
        solar.darken()
        electronic_load.constant_voltage(0.0)
        electronic_load.enable()
        check("EPS-SOL-010", "irradiance", solar.irradiance())
        check("EPS-SOL-010", "current", electronic_load.current())
        dark = (electronic_load.voltage(), electronic_load.current())
        cold = thermometer.panel.temperature()
    with step("Switch the lamp on, and wait until the panel is warm"):
        electronic_load.disable()
        solar.light()
    with step("Measure the open-circuit voltage"):
        open_voltage = solar.open_voltage()
        check.require("EPS-SOL-011", "voltage", open_voltage)
        loose = loose_thermometer(thermometer.panel.temperature() - cold, parameters)
        places = solar.places(open_voltage.value)
    sweeps = {}
    with record.during("sweeps", thermometer.panel, thermometer.reference, multimeter.reference, rate=1.0):
        for name, order in (("forward", places), ("reverse", places[::-1]), ("repeat", places)):
            with step(f"Sweep: {name}"):
                sweeps[name] = solar.sweep(order)
    facts = IvFacts(
        current=parameters.nominal_current,
        voltage=parameters.nominal_voltage,
        irradiance=parameters.lamp_irradiance,
    )
    own = iv_curve(sweeps["forward"])
    curves = {name: iv_curve(sweep, conditions_of(parameters), facts) for name, sweep in sweeps.items()}
    stated = f"{parameters.irradiance:g} W/m^2 and {parameters.temperature:g} degC"
    for name, curve in curves.items():
        measured = f"{curve.irradiance:.0f} W/m^2 and {curve.temperature:.1f} degC under the lamp"
        for requirement, parameter, headline in FIGURES:
            check(
                requirement,
                parameter,
                curve.figures[parameter],
                of=name,
                doubts=[*curve.doubts, *loose],
                at=f"{name}, {stated if parameter in CORRECTED else measured}",
                headline=headline if name == "forward" else "",
            )
    for name, other in (("hysteresis", "reverse"), ("repetition", "repeat")):
        difference = curve_difference(curves["forward"], curves[other], "maximum_power")
        check("EPS-SOL-040", "power_difference", difference, of=name, doubts=curves[other].doubts)
    draw(own, curves["forward"], dark, chart)
    rows = [row for name, sweep in sweeps.items() for row in rows_of(name, sweep)]
    artifact("current-voltage.csv", as_csv(COLUMNS, rows))
