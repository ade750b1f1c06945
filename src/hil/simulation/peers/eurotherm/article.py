"""One article of the controller, built from its truth."""

from __future__ import annotations

from hil.simulation.faults import Stuck
from hil.simulation.peers.eurotherm import memory as at
from hil.simulation.peers.eurotherm.controller import Eurotherm3216, Make, OtherType, Runaway
from hil.simulation.peers.eurotherm.memory import Memory
from hil.simulation.peers.eurotherm.sensor_input import SensorDetached, SensorInput, SensorOpen, SensorTruth
from hil.simulation.peers.model import PeerModel, PeerSetup
from hil.simulation.peers.power import Power
from hil.simulation.truth import Truth

__all__ = ["MODEL", "build"]

_USUAL_BAUD = 9600
_PERIOD_NS = 1_000_000_000
_MODES = {"operating": at.OPERATING, "standby": at.STANDBY}


def build(setup: PeerSetup) -> Eurotherm3216:
    """Build the controller; terminals are `sensor`, `ambient` and `power`, signals, and `drive`, an input.

    Raises:
        TruthError: with everything that is wrong in its truth or terminals.
    """
    truth = setup.truth
    make = _make(setup, truth)
    memory = _memory(make, truth)
    sensor = SensorInput(
        truth=SensorTruth(
            offset=truth.number("sensor_offset", 0.0),
            noise=truth.number("sensor_noise", 0.01, minimum=0),
            ambient=truth.number("ambient", 22.0, minimum=-60, maximum=80),
        ),
        place=setup.connections.signal("sensor"),
        room=setup.connections.signal("ambient"),
        faults=setup.faults,
        noise=setup.stream("sensor"),
    )
    drive, power = setup.connections.input("drive"), Power(setup.connections.signal("power"))
    setup.finish()
    return Eurotherm3216(make=make, memory=memory, sensor=sensor, drive=drive, power=power, faults=setup.faults)


def _make(setup: PeerSetup, truth: Truth) -> Make:
    period_ns = truth.duration_ns("period", _PERIOD_NS)
    if period_ns <= 0:
        truth.wrong("period", "expected a duration above 0 s")
    return Make(
        address=truth.integer("address", setup.instrument.address or 1, minimum=1, maximum=254),
        baud=setup.instrument.baud or _USUAL_BAUD,
        period_ns=max(period_ns, 1),
        decimals=truth.integer("decimals", 1, minimum=0, maximum=2),
        unit=truth.text("unit", "degC", choices=("K", "degC", "degF")),
        top=truth.number("range_high", 300.0, minimum=0, maximum=3000),
    )


def _memory(make: Make, truth: Truth) -> Memory:
    """Return the parameters as somebody left them."""
    setpoint = make.word(truth.number("setpoint", 22.0, minimum=-200, maximum=1000))
    return Memory(
        {
            **dict.fromkeys((at.PROCESS_VALUE, at.WORKING_OUTPUT, at.WORKING_SETPOINT, at.STATUS, at.SENSOR_BREAK), 0),
            **dict.fromkeys((at.TIMER_STATUS, at.SETPOINT_SELECT, at.SETPOINT_SOURCE, at.COMMS_SETPOINT), 0),
            **dict.fromkeys((at.MANUAL_OUTPUT, at.SAFE_OUTPUT, at.LOOP_MODE, at.INVERTED_STATUS), 0),
            **dict.fromkeys(at.SETPOINTS, setpoint),
            at.PROPORTIONAL_BAND: round(10 * truth.number("proportional_band", 10.0, minimum=0.1, maximum=3000)),
            at.INTEGRAL_TIME: truth.integer("integral_time", 60, minimum=0, maximum=9999),
            at.DERIVATIVE_TIME: truth.integer("derivative_time", 0, minimum=0, maximum=9999),
            at.COOL_GAIN: round(10 * truth.number("cool_gain", 2.0, minimum=0.1, maximum=10)),
            at.OUTPUT_HIGH: round(10 * truth.number("output_high", 100.0, minimum=0, maximum=100)),
            at.OUTPUT_LOW: round(10 * truth.number("output_low", -100.0, minimum=-100, maximum=0)),
            at.SETPOINT_HIGH: make.word(truth.number("setpoint_high", 60.0, minimum=-200, maximum=1000)),
            at.SETPOINT_LOW: make.word(truth.number("setpoint_low", -30.0, minimum=-200, maximum=1000)),
            at.INSTRUMENT_MODE: _MODES.get(truth.text("mode", "standby", choices=tuple(_MODES)), at.STANDBY),
            at.TYPE_CODE: _hexadecimal(truth, "model", "3216"),
            at.VERSION: _version(truth),
            at.UNIT_ADDRESS: make.address,
            at.UNITS: make.unit_code,
            at.DECIMALS: make.decimals,
        }
    )


def _version(truth: Truth) -> int:
    text = truth.text("firmware", "1.11")
    major, _, minor = text.partition(".")
    try:
        return int(major, 16) << 8 | int(minor, 16)
    except ValueError:
        truth.wrong("firmware", f"expected a version such as '1.11', not {text!r}")
        return 0


def _hexadecimal(truth: Truth, key: str, default: str) -> int:
    text = truth.text(key, default)
    try:
        return int(text, 16) & 0xFFFF
    except ValueError:
        truth.wrong(key, f"expected the four digits of a type code, such as '3216', not {text!r}")
        return 0


MODEL = PeerModel(
    link="serial",
    fault_kinds=(OtherType, Runaway, SensorDetached, SensorOpen, Stuck),
    build=build,
)
"""The model behind the driver `eurotherm-3216`."""
