"""Logs of 35 kinds as hands make them, with `hil analyse magnetometer` and with fits of our own by scipy.

What is conclusive agrees with a robust fit of distances to the ellipsoid, which starts from the direct fit of Q. Li and
J. G. Griffiths, Least Squares Ellipsoid Specific Fitting, Geometric Modeling and Processing 2004, p. 335; and what
is no noise is told.
"""

from __future__ import annotations

import json

import numpy as np
import pytest
import sweeps
from click.testing import CliRunner
from hand_held import BIAS, GAIN, KINDS
from scipy.optimize import least_squares

from hil.cli.commands.analyse import command

FORMS = (
    ("uT", 1.0, "t,mx,my,mz", ",", "mx,my,mz"),
    ("nT", 1e3, "# fw 1.2\n# sensor MMC5983\nt mx my mz", " ", "mx,my,mz"),
    ("mG", 10.0, "t [s];mx [mG];my [mG];mz [mG]", ";", "2,3,4"),
    ("gauss", 1e-2, "", "\t", "2,3,4"),
    ("LSB", 6.842, "\ufefft, mx, my, mz", ", ", "mx,my,mz"),
    ("uT", 1.0, '"Time (s)","Magnetic field x (µT)","Magnetic field y (µT)","Magnetic field z (µT)"', ",", "2,3,4"),
)
"""Units with what one uT is in them, lines above the numbers, what stands between them, and how columns are named."""

INCONCLUSIVE = {
    "a cone of 70 deg": "condition",
    "turns about the vertical alone": "condition",
    "rows that hold the last ones": "repeated",
    "every row twice": "repeated",
    "a quarter of it disturbed": "outliers",
    "an axis at its end": "stuck",
    "a motor of 20 uT for a third of the time": "scatter",
    "a field of another place in the second half": "scatter",
    "an axis that changes its sign": "scatter",
    "two axes that are swapped half way": "scatter",
}
"""Which gate says so."""

CHANGING = {
    "a motor that runs half of the time, 2 uT",
    "a motor that runs half of the time, 6 uT",
    "a motor that runs in the second half",
    "iron nearby at the beginning",
    "a bias that drifts by 4 uT",
    "a field that comes and goes by 5 %",
    "a line of the mains",
    "noise that is filtered",
    "an axis that lags by three samples",
}
"""What is conclusive, but the residuals are no noise: it is told, and the uncertainties are larger."""

OUTLIERS = {
    "rows of zeros": 182,
    "spikes on one axis": 59,
    "broken words of 4789 uT": 30,
    "broken words on one axis": 90,
}
"""How many readings of these are named."""


def log(title):
    """Return the log of a kind as text, its readings in uT, and how it is to be read."""
    place = list(KINDS).index(title)
    readings = KINDS[title](np.random.default_rng(place))
    unit, each, head, between, columns = FORMS[place % len(FORMS)]
    rows = [
        between.join([f"{0.02 * number:.2f}", *(f"{each * value:.7g}" for value in row)])
        for number, row in enumerate(readings)
    ]
    scale = ("--scale", f"{1.0 / each!r}", "--scaled-unit", "uT") if unit == "LSB" else ()
    return "\n".join([head, *rows] if head else rows) + "\n", readings, ("--columns", columns, "--unit", unit, *scale)


def analysed(tmp_path, title):
    """Return readings, the document of the command, and what one uT is in it."""
    text, readings, how = log(title)
    (tmp_path / "hand.csv").write_text(text, encoding="utf-8")
    asked = ("magnetometer", str(tmp_path / "hand.csv"), *how, "--json")
    ran = CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)
    unit = 1.0 if "--scale" in how else FORMS[list(KINDS).index(title) % len(FORMS)][1]
    return readings[np.isfinite(readings).all(axis=1)], json.loads(ran.stdout), unit


def directly(readings):
    """Return centre and gain of the ellipsoid after Li and Griffiths: least squares under 4 J - I^2 = 1."""
    middle, size = readings.mean(axis=0), readings.std()
    x, y, z = ((readings - middle) / size).T
    rows = np.stack([x * x, y * y, z * z, 2 * y * z, 2 * x * z, 2 * x * y, 2 * x, 2 * y, 2 * z, np.ones_like(x)])
    scatter, bound = rows @ rows.T, np.diag([-1.0, -1.0, -1.0, -4.0, -4.0, -4.0])
    bound[:3, :3] += 1.0 - np.eye(3)
    rest = np.linalg.solve(scatter[6:, 6:], scatter[6:, :6])
    values, vectors = np.linalg.eig(np.linalg.solve(bound, scatter[:6, :6] - scatter[:6, 6:] @ rest))
    square = vectors[:, values.real.argmax()].real
    *slope, constant = -rest @ square
    a, b, c, f, g, h = square
    quadric = np.array([[a, h, g], [h, b, f], [g, f, c]])
    centre = -np.linalg.solve(quadric, slope)
    values, vectors = np.linalg.eigh(quadric / (centre @ quadric @ centre - constant))
    return size * centre + middle, (vectors * np.sqrt(values)) @ vectors.T / size


def by_distances(readings):
    """Return centre and gain of determinant 1 by the distances to the ellipsoid, with Cauchy's loss."""
    far = np.linalg.norm(readings - np.median(readings, axis=0), axis=1)
    readings = readings[far <= 4.0 * np.quantile(far, 0.95)]
    centre, gain = directly(readings)
    radius, upper = 1.0 / np.cbrt(np.linalg.det(gain)), np.triu_indices(3)

    def unpacked(theta):
        matrix = np.zeros((3, 3))
        matrix[upper] = theta[3:] / radius
        return theta[:3] * radius, matrix + matrix.T - np.diag(np.diag(matrix))

    def distances(theta):
        middle, matrix = unpacked(theta)
        field = (readings - middle) @ matrix
        length = np.linalg.norm(field, axis=1)
        return (length - 1.0) * length / np.linalg.norm(field @ matrix, axis=1)

    theta = np.concatenate([centre / radius, (gain * radius)[upper]])
    for _ in range(3):
        scale = 1.4826 * np.median(np.abs(distances(theta)))
        theta = least_squares(distances, theta, loss="cauchy", f_scale=2.0 * scale, max_nfev=50).x
    centre, gain = unpacked(theta)
    return centre, gain / np.cbrt(np.linalg.det(gain))


@pytest.mark.parametrize("title", sweeps.sample(list(KINDS), 12))
def test_it_agrees_with_other_fits_or_says_why_not(tmp_path, title):
    """Within two standard uncertainties; with the truth within four, where the log has one."""
    readings, document, unit = analysed(tmp_path, title)
    told = " ".join(document["remarks"])
    if title in INCONCLUSIVE:
        assert document["status"] == "inconclusive"
        assert INCONCLUSIVE[title] in {reason.split(" ")[0].rstrip(":") for reason in document["reasons"]}
        assert document["calibration"] is None
        return
    assert document["status"] == "conclusive", document["reasons"]
    assert ("residuals of neighbouring readings are alike" in told) == (title in CHANGING)
    assert (document["inflation"] > 2.0) == (title in CHANGING)
    bias, matrix = by_distances(readings[readings.any(axis=1)])
    for place, axis in enumerate("xyz"):
        figure = document["bias"][axis]
        assert abs(figure["value"] / unit - bias[place]) < 2.0 * figure["uncertainty"] / unit
        if title not in CHANGING:
            assert abs(figure["value"] / unit - BIAS[place]) < 4.0 * figure["uncertainty"] / unit
    for name, figure in document["matrix"].items():
        place = tuple("xyz".index(axis) for axis in name)
        assert abs(figure["value"] - matrix[place]) < 2.0 * figure["uncertainty"]
        if title not in CHANGING:
            assert abs(figure["value"] - GAIN[place]) < 4.0 * figure["uncertainty"]
    if title in OUTLIERS:
        assert len(document["outliers"]) == OUTLIERS[title]


def test_every_log_is_of_another_kind():
    """What is told of kinds names kinds."""
    assert len(KINDS) == 35
    assert {*INCONCLUSIVE, *CHANGING, *OUTLIERS} <= set(KINDS)
