"""What a calibration of a photodiode says of itself: gates, what it refuses, and what it exports."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from photodiode_readings import FULL_SCALE, LOADS, campaign

from hil.analysis.photodiode.calibrate import calibrate_photodiode
from hil.analysis.photodiode.interchange import (
    photodiode_as_c_header,
    photodiode_as_json,
    photodiode_from_json,
    photodiode_reproduction,
)
from hil.analysis.photodiode.readings import Known
from hil.model.errors import Refused

VOLTS, DEGREES, OHMS, LIGHT, FITTED = campaign(0, count=400)
TIME = np.arange(VOLTS.size)


def calibrated(volts=VOLTS, degrees=DEGREES, ohms=OHMS, light=LIGHT, fitted=FITTED):
    """Calibrate with a converter of 3.3 V."""
    return calibrate_photodiode(volts, degrees, ohms, light=light, fitted=fitted, known=Known(full_scale=FULL_SCALE))


REPORT = calibrated()


def test_good_readings_are_conclusive():
    """Every gate is well, the order of the gates' reasons is told, and heating agrees with cooling."""
    assert (REPORT.conclusive, REPORT.doubts) == (True, [])
    assert {figure.status.value for name, figure in REPORT.figures.items() if name not in {"shunt", "series"}} == {
        "measured"
    }
    assert abs(REPORT.hysteresis) < 1e-3
    assert (REPORT.coldest, REPORT.hottest) == pytest.approx((15.0, 35.0))
    assert "separate photocurrent" in REPORT.identifiability
    assert re.search(r"; they do not show .*a series resistance below \S+ ohm$", REPORT.identifiability)


@pytest.mark.parametrize(
    ("changed", "gate"),
    [
        ({"volts": np.where(TIME == 700, np.nan, VOLTS)}, "finite"),
        ({"volts": np.minimum(VOLTS * 12, FULL_SCALE)}, "saturated"),
        ({"volts": 0.0004 * np.abs(np.sin(TIME))}, "lit"),
        ({"light": np.where(TIME > 900, 0.0, LIGHT)}, "lit"),
        ({"degrees": DEGREES + 273.15}, "celsius"),
        ({"degrees": 1.8 * DEGREES + 32.0}, "scatter"),
        ({"volts": VOLTS * 1e3}, "saturated"),
        ({"volts": np.minimum(VOLTS * 4.0, 3.0)}, "forward"),
        ({"degrees": np.full(VOLTS.size, 24.9)}, "stuck"),
        ({"degrees": 22.0 + (DEGREES - 22.0) / 4.0}, "span"),
        ({"ohms": np.full(VOLTS.size, LOADS[0])}, "plausible"),
        ({"light": LIGHT * (1.0 - 0.1 * TIME / TIME[-1])}, "steady"),
        ({"volts": VOLTS * (1.0 - 0.03 * (TIME > 1000)), "fitted": True}, "hysteresis"),
        ({"volts": VOLTS * (1.0 + 0.02 * np.sin(TIME / 5.0))}, "scatter"),
    ],
)
def test_what_speaks_against_the_readings(changed, gate):
    """The gate trips, no figure passes for measured, and nothing is exported."""
    report = calibrated(**changed)
    assert gate in {each.name for each in report.gates if each.ok is False}
    assert {figure.status.value for figure in report.figures.values()} <= {"not observable", "model rejected"}
    with pytest.raises(Refused, match="do not show this calibration"):
        photodiode_as_json(report)


def test_a_lamp_that_droops_without_a_monitor_is_seen():
    """Cooling then is darker than heating at the same temperature."""
    volts = calibrated().diode.voltage_of(1.0 - 0.1 * TIME / TIME[-1], DEGREES, OHMS)
    report = calibrated(volts=volts, light=1.0, fitted=True)
    assert not report.conclusive
    assert report.hysteresis > 0.003


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ((VOLTS[:, None], DEGREES, OHMS), "not \\(n,\\)"),
        ((VOLTS, DEGREES[:-1], OHMS), "different shapes"),
        ((VOLTS, DEGREES, 0.0), "above zero ohm"),
        ((VOLTS[:40], DEGREES[:40], 20e3), "40 readings are fewer than the 50"),
    ],
)
def test_what_is_refused(given, told):
    """Errors say what is missing."""
    with pytest.raises(Refused, match=told):
        calibrate_photodiode(*given)


def test_the_export_gives_back_the_samples():
    """Through JSON and back every reading has the same light; a changed number is seen, and a changed text refused."""
    text = photodiode_as_json(REPORT)
    found = photodiode_from_json(text)
    assert photodiode_reproduction(found, REPORT, VOLTS, DEGREES, OHMS) == "reproduced"
    moved = replace(found, ideality=found.ideality + 1e-4)
    assert "gives reading" in photodiode_reproduction(moved, REPORT, VOLTS, DEGREES, OHMS)
    with pytest.raises(Refused, match="fingerprint"):
        photodiode_from_json(text.replace('"nominal": 25.0', '"nominal": 20.0'))
    document = json.loads(text)
    del document["numbers"]["gap"]
    with pytest.raises(Refused, match="fingerprint"):
        photodiode_from_json(json.dumps(document))
    assert document["temperatures"] == [15.0, 35.0]


def test_an_export_has_no_digit_that_a_machine_decides():
    """How sums are ordered changes the last digits of a covariance, and would change the fingerprint."""
    document = json.loads(photodiode_as_json(REPORT))
    uncertain = [document["dof"], *(each for row in document["covariance"] for each in row)]
    for digits, found in ((9, list(document["numbers"].values())), (6, uncertain)):
        assert found == [float(f"{each:.{digits}g}") for each in found]
    assert document["covariance"] == [pytest.approx(row, rel=1e-5) for row in REPORT.covariance.tolist()]


@pytest.mark.skipif(shutil.which("cc") is None, reason="no compiler for C")
def test_the_c_header_computes_the_same(tmp_path):
    """The formula of its comment, compiled, gives the light that the library gives, and the fingerprint of the JSON."""
    (tmp_path / "photodiode.h").write_text(photodiode_as_c_header(REPORT), encoding="utf-8")
    formula = """
    #include <math.h>
    #include <stdio.h>
    #include "photodiode.h"
    int main(void) {
        double V = 0.3, R = 20000, T = 30 + 273.15, T0 = PHOTODIODE_NOMINAL + 273.15;
        double J = V * (1 + PHOTODIODE_SERIES / R);
        double I_s = PHOTODIODE_SATURATION * pow(T / T0, 3 / PHOTODIODE_IDEALITY)
            * exp(PHOTODIODE_GAP / (PHOTODIODE_IDEALITY * PHOTODIODE_BOLTZMANN) * (1 / T0 - 1 / T));
        double light = (V / R + I_s * (exp(J / (PHOTODIODE_IDEALITY * PHOTODIODE_BOLTZMANN * T)) - 1)
            + PHOTODIODE_SHUNT * J) / (1 + PHOTODIODE_COEFFICIENT * (T - T0));
        printf("%s %.12g", PHOTODIODE_FINGERPRINT, light);
        return 0;
    }
    """
    (tmp_path / "light.c").write_text(formula, encoding="utf-8")
    subprocess.run(["cc", "-std=c99", "-o", tmp_path / "light", tmp_path / "light.c", "-lm"], check=True)
    told = subprocess.run([tmp_path / "light"], check=True, capture_output=True, text=True).stdout.split()
    assert told[0] == json.loads(photodiode_as_json(REPORT))["fingerprint"]
    assert float(told[1]) == pytest.approx(float(REPORT.diode.light_of(0.3, 30.0, 20e3)), rel=1e-7)
