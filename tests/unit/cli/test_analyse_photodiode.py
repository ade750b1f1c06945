"""The command `hil analyse photodiode`."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from hil.analysis.photodiode.interchange import photodiode_from_json
from hil.cli.commands.analyse import command
from hil.model.errors import Refused

ROOT = Path(__file__).parents[3]
TABLE = str(ROOT / "docs" / "data" / "photodiode-simulated.csv")
COUNTS = ("--reading", "photodiode", "--unit", "LSB", "--reference", "3.3", "--temperature", "temperature")
WHOLE = (*COUNTS, "--load-column", "load", "--light", "monitor", "--series", "20")
TRUTH = {"photocurrent": 45e-6, "coefficient": 1.2e-3, "saturation": 1e-9, "ideality": 1.25, "gap": 1.12}


def run(*arguments):
    """Run the command; what it raises is raised here."""
    asked = ["photodiode", *map(str, arguments)]
    return CliRunner().invoke(command, asked, standalone_mode=False, catch_exceptions=False)


def changed(folder, change):
    """Write a table whose columns photodiode, monitor, temperature and load were changed."""
    values = np.loadtxt(TABLE, delimiter=",", skiprows=1)
    file = folder / "changed.csv"
    np.savetxt(file, change(values), delimiter=",", header="photodiode,monitor,temperature,load", comments="")
    return file


def test_readings_become_a_calibration():
    """Figures, bounds, what is separated, and the self-check."""
    result = run(TABLE, *WHOLE)
    assert result.return_value == 0
    assert result.stdout.startswith(f"{TABLE}: 1500 readings\n\n  photocurrent  (4.50")
    assert "upper limit" in result.stdout
    assert "self-check: the exported numbers give the same light for every reading" in result.stdout


def test_json_holds_the_truth_of_the_simulation():
    """Within four standard uncertainties; declared ones widen them."""
    document = json.loads(run(TABLE, *WHOLE, "--json").stdout)
    assert document["status"] == "conclusive"
    for name, true in TRUTH.items():
        figure = document[name]
        assert abs(figure["value"] - true) < 4.0 * figure["uncertainty"], name
    wide = json.loads(run(TABLE, *WHOLE, "--load-uncertainty", "0.0005", "--json").stdout)
    assert wide["saturation"]["uncertainty"] > 2.0 * document["saturation"]["uncertainty"]
    volts = ("--reading", "photodiode", "--unit", "mV", *COUNTS[6:], *WHOLE[8:])
    assert json.loads(run(TABLE, *volts, "--json").stdout)["photocurrent"]["value"] > 2e-5


def test_exports_are_written_and_drawn(tmp_path):
    """One calibration in both forms, and a picture."""
    files = [tmp_path / name for name in ("c.json", "c.h", "c.svg")]
    result = run(TABLE, *WHOLE, "--export", files[0], "--c-header", files[1], "--plot", files[2])
    assert result.return_value == 0
    text = files[0].read_text(encoding="utf-8")
    assert photodiode_from_json(text).ideality == pytest.approx(1.25, abs=0.01)
    assert json.loads(text)["fingerprint"] in files[1].read_text(encoding="utf-8")
    assert "<svg" in files[2].read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda values: values * [1, 1, 1, 1] + [0, 0, 273.15, 0], "celsius of temperature"),
        (lambda values: values * [0, 1, 1, 1], "lit: 1500 readings show no light"),
        (lambda values: np.minimum(values * [20, 1, 1, 1], [4095, 1e9, 1e9, 1e9]), "saturated"),
        (lambda values: values * [1, 1, 0.2, 1] + [0, 0, 20, 0], "span: the temperatures span 4.0 K"),
        (lambda values: values[values[:, 3] == 20e3], "they do not show"),
    ],
)
def test_what_is_wrong_is_inconclusive_and_not_exported(tmp_path, change, told):
    """The gate says what, the exit code is 1, and nothing is written."""
    result = run(changed(tmp_path, change), *WHOLE, "--export", tmp_path / "c.json")
    assert result.return_value == 1
    assert "INCONCLUSIVE" in result.stdout
    assert told in " ".join(result.stdout.split())
    assert not (tmp_path / "c.json").exists()


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (COUNTS, "the load resistance is needed"),
        ((*WHOLE, "--load", "20000"), "the load resistance is needed, exactly once"),
        ((*COUNTS[:4], *COUNTS[6:], "--load", "20000"), "need the reference"),
        (("--reading", "1", "--unit", "A", "--temperature", "3", "--load", "20000"), "--unit: "),
    ],
)
def test_what_is_refused(arguments, told):
    """Errors say which option is missing."""
    with pytest.raises(Refused, match=told):
        run(TABLE, *arguments)


@pytest.mark.parametrize("size", [1e300, 1e-200])
def test_readings_that_cannot_be_squared_are_refused(tmp_path, size):
    """With the column that holds them."""
    far = changed(tmp_path, lambda values: values * [size, 1.0, 1.0, 1.0])
    with pytest.raises(Refused, match="column photodiode varies by .*, beyond what can be squared"):
        run(far, *WHOLE)
