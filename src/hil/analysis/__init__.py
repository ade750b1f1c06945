"""Analyses of arrays: noise, calibration, batteries, magnetics and statistics, usable from any notebook.

Everything that plans use is available here under one name: `from hil.analysis import characterise`. Names are imported
lazily, so that unused modules cost no start-up time.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from hil.analysis.allan.averaging import MovingAverage, best_average, rest_mean
    from hil.analysis.allan.deviation import deviation
    from hil.analysis.allan.noise import characterise
    from hil.analysis.battery.certainty import Certainty
    from hil.analysis.battery.cycles import cycles
    from hil.analysis.battery.fade import fade
    from hil.analysis.battery.gates import Declared
    from hil.analysis.battery.half_cycle import Limits, end_uncertainty
    from hil.analysis.battery.series import series
    from hil.analysis.battery.steps import StepKind
    from hil.analysis.battery.summary import incremental_capacities, summarise
    from hil.analysis.coil import expected_field, field_ratio, line_residuals, linearity, resistance
    from hil.analysis.comparison import normalised_error, rank, relative_deviation
    from hil.analysis.drift import drift_of, fragments
    from hil.analysis.flight import flight_phases
    from hil.analysis.gates import Facts
    from hil.analysis.gyroscope.calibrate import calibrate
    from hil.analysis.gyroscope.interchange import as_c_header, as_json, from_json
    from hil.analysis.gyroscope.readings import Reading, Slow, reading, rippling
    from hil.analysis.gyroscope.self_check import export_disagreements, reproduction
    from hil.analysis.magnetics import direction, odd_response
    from hil.analysis.magnetometer.attitudes import (
        coil_survey,
        fields_in_board,
        orientation,
        positive_factor,
        remaining_errors,
        set_apart,
        table_angles,
    )
    from hil.analysis.magnetometer.calibrate import calibrate_magnetometer
    from hil.analysis.magnetometer.interchange import (
        magnetometer_as_c_header,
        magnetometer_as_json,
        magnetometer_from_json,
        magnetometer_reproduction,
        sample_disagreement,
    )
    from hil.analysis.noise.rate_noise import NoiseLevels
    from hil.analysis.noise.sensor import SensorModel, SimulatedSensor, simulate
    from hil.analysis.photodiode.calibrate import calibrate_photodiode
    from hil.analysis.photodiode.interchange import (
        photodiode_as_c_header,
        photodiode_as_json,
        photodiode_from_json,
        photodiode_reproduction,
    )
    from hil.analysis.photodiode.readings import Known, volts
    from hil.analysis.quality import tripped
    from hil.analysis.repeated import drift_change
    from hil.analysis.sampling import assess
    from hil.analysis.solar.correction import IvConditions, reference_irradiance
    from hil.analysis.solar.curve import IvSweep, curve_difference, iv_curve
    from hil.analysis.solar.gates import IvFacts
    from hil.analysis.spectra.coefficients import agreement, psd
    from hil.analysis.spectra.welch import Welch, spectrum
    from hil.analysis.statistics import (
        magnitude,
        mean,
        not_observable,
        observed,
        share_known,
        standard_deviation,
        widened,
    )
    from hil.analysis.tables import Column, as_csv
    from hil.analysis.transients import charge, crossing, joule_integral, peak, rise_time, time_above, time_below

__all__ = [
    "Certainty",
    "Column",
    "Declared",
    "Facts",
    "IvConditions",
    "IvFacts",
    "IvSweep",
    "Known",
    "Limits",
    "MovingAverage",
    "NoiseLevels",
    "Reading",
    "SensorModel",
    "SimulatedSensor",
    "Slow",
    "StepKind",
    "Welch",
    "agreement",
    "as_c_header",
    "as_csv",
    "as_json",
    "assess",
    "best_average",
    "calibrate",
    "calibrate_magnetometer",
    "calibrate_photodiode",
    "characterise",
    "charge",
    "coil_survey",
    "crossing",
    "curve_difference",
    "cycles",
    "deviation",
    "direction",
    "drift_change",
    "drift_of",
    "end_uncertainty",
    "expected_field",
    "export_disagreements",
    "fade",
    "field_ratio",
    "fields_in_board",
    "flight_phases",
    "fragments",
    "from_json",
    "incremental_capacities",
    "iv_curve",
    "joule_integral",
    "line_residuals",
    "linearity",
    "magnetometer_as_c_header",
    "magnetometer_as_json",
    "magnetometer_from_json",
    "magnetometer_reproduction",
    "magnitude",
    "mean",
    "normalised_error",
    "not_observable",
    "observed",
    "odd_response",
    "orientation",
    "peak",
    "photodiode_as_c_header",
    "photodiode_as_json",
    "photodiode_from_json",
    "photodiode_reproduction",
    "positive_factor",
    "psd",
    "rank",
    "reading",
    "reference_irradiance",
    "relative_deviation",
    "remaining_errors",
    "reproduction",
    "resistance",
    "rest_mean",
    "rippling",
    "rise_time",
    "sample_disagreement",
    "series",
    "set_apart",
    "share_known",
    "simulate",
    "spectrum",
    "standard_deviation",
    "summarise",
    "table_angles",
    "time_above",
    "time_below",
    "tripped",
    "volts",
    "widened",
]

_MODULES = {
    "allan.deviation": ("deviation",),
    "allan.averaging": ("MovingAverage", "best_average", "rest_mean"),
    "allan.noise": ("characterise",),
    "battery.certainty": ("Certainty",),
    "battery.cycles": ("cycles",),
    "battery.fade": ("fade",),
    "battery.gates": ("Declared",),
    "battery.half_cycle": ("Limits", "end_uncertainty"),
    "battery.series": ("series",),
    "battery.steps": ("StepKind",),
    "battery.summary": ("incremental_capacities", "summarise"),
    "coil": ("expected_field", "field_ratio", "line_residuals", "linearity", "resistance"),
    "comparison": ("normalised_error", "rank", "relative_deviation"),
    "drift": ("drift_of", "fragments"),
    "flight": ("flight_phases",),
    "gates": ("Facts",),
    "gyroscope.calibrate": ("calibrate",),
    "gyroscope.interchange": ("as_c_header", "as_json", "from_json"),
    "gyroscope.readings": ("Reading", "Slow", "reading", "rippling"),
    "gyroscope.self_check": ("export_disagreements", "reproduction"),
    "magnetics": ("direction", "odd_response"),
    "magnetometer.attitudes": (
        "coil_survey",
        "fields_in_board",
        "orientation",
        "positive_factor",
        "remaining_errors",
        "set_apart",
        "table_angles",
    ),
    "magnetometer.calibrate": ("calibrate_magnetometer",),
    "magnetometer.interchange": (
        "magnetometer_as_c_header",
        "magnetometer_as_json",
        "magnetometer_from_json",
        "magnetometer_reproduction",
        "sample_disagreement",
    ),
    "noise.rate_noise": ("NoiseLevels",),
    "noise.sensor": ("SensorModel", "SimulatedSensor", "simulate"),
    "photodiode.calibrate": ("calibrate_photodiode",),
    "photodiode.interchange": (
        "photodiode_as_c_header",
        "photodiode_as_json",
        "photodiode_from_json",
        "photodiode_reproduction",
    ),
    "photodiode.readings": ("Known", "volts"),
    "quality": ("tripped",),
    "repeated": ("drift_change",),
    "sampling": ("assess",),
    "solar.correction": ("IvConditions", "reference_irradiance"),
    "solar.curve": ("IvSweep", "curve_difference", "iv_curve"),
    "solar.gates": ("IvFacts",),
    "spectra.coefficients": ("agreement", "psd"),
    "spectra.welch": ("Welch", "spectrum"),
    "statistics": ("magnitude", "mean", "not_observable", "observed", "share_known", "standard_deviation", "widened"),
    "tables": ("Column", "as_csv"),
    "transients": ("charge", "crossing", "joule_integral", "peak", "rise_time", "time_above", "time_below"),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> object:
    if name not in _HOMES:
        raise AttributeError(f"module 'hil.analysis' has no attribute '{name}'")
    return getattr(import_module(f"hil.analysis.{_HOMES[name]}"), name)
