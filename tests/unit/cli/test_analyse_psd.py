"""The command `hil analyse psd`."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import HilError, Refused

pytestmark = pytest.mark.usefixtures("in_the_checkout")

SLICE = "docs/data/gyroscope-xsens-rest.txt"
REST = (SLICE, "--time", "1", "--columns", "2", "--unit", "LSB", "--to", "50")
UNTIMED = ("--rate", "100", "--unit", "deg/s")


def run(*arguments):
    """Run the command; what it raises is raised here."""
    return CliRunner().invoke(command, ["psd", *arguments], catch_exceptions=False, standalone_mode=False)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """White noise of 0.01 deg/s/sqrt(Hz), two-sided, with a sine at 3 Hz."""
    path = tmp_path_factory.mktemp("log") / "rest.csv"
    time = np.arange(8000) / 100.0
    values = 0.1 * np.random.default_rng(1).standard_normal(8000) + 0.1 * np.sin(2.0 * np.pi * 3.0 * time)
    path.write_text("gx\n" + "\n".join(f"{value:.8f}" for value in values.tolist()) + "\n", encoding="utf-8")
    return str(path)


def test_a_real_gyroscope_at_rest(tmp_path):
    """The rate of the log's own times; density one-sided and named, coefficients, and agreement with Allan."""
    result = run(*REST)
    lines = result.stdout.splitlines()
    assert max(map(len, lines)) <= 80
    assert lines[1].startswith("sampling: 100.0105 ± 0.0013 Hz")
    assert "column 2: one-sided power spectral density in LSB^2/Hz; two-sided: half" in lines
    text = " ".join(result.stdout.split())
    assert "18 segments of 512 samples (5.119 s), overlap 50%, window hann, mean taken off each" in text
    assert "equivalent noise bandwidth 0.293 Hz, 34.2 degrees of freedom a point; intervals at 0.68" in text
    assert sum(line.startswith("white noise") and line.endswith(" measured") for line in lines) == 2
    assert any(line.startswith("over those of the Allan deviation: white ") for line in lines)
    assert result.return_value == 0


def test_json_is_one_document_with_everything(log):
    """Rate, sides, Welch's settings, figures, lines, agreement and bands; every point only if it is asked for."""
    axis = json.loads(run(log, *UNTIMED, "--segment", "1024", "--json").stdout)["axes"][0]
    assert axis["density_unit"] == "(deg/s)^2/Hz"
    assert axis["sided"] == "one-sided"
    assert (axis["rate"], axis["segment"], axis["segments"], axis["overlap"]) == (100.0, 1024, 14, 0.5)
    assert axis["equivalent_noise_bandwidth"] == pytest.approx(1.5 * 100.0 / 1024)
    assert axis["white"]["value"] == pytest.approx(0.01, abs=4.0 * axis["white"]["uncertainty"])
    assert axis["density"]["unit"] == "deg/s/sqrt(Hz)"
    (line,) = axis["lines"]
    assert line["frequency"]["value"] == pytest.approx(3.0, abs=0.01)
    assert line["amplitude"]["value"] == pytest.approx(0.1, rel=0.1)
    assert set(axis["agreement"]) == {"quantisation", "white", "flicker", "random_walk"}
    assert set(axis["curve"][0]) == {"frequency", "density", "edf", "low", "high", "fitted"}
    every = json.loads(run(log, *UNTIMED, "--segment", "1024", "--json", "--points").stdout)["axes"][0]["points"]
    assert len(every) == 513
    assert every[100]["low"] < every[100]["density"] < every[100]["high"]


def test_what_was_chosen_is_told(log):
    """Window, overlap and detrending; a line by the table's rotation."""
    arguments = ("--window", "blackmanharris", "--overlap", "0.75", "--detrend", "linear", "--rotation", "1.5")
    text = " ".join(run(log, *UNTIMED, *arguments).stdout.split())
    assert "overlap 75%, window blackmanharris, straight line taken off each" in text
    assert "harmonic 2 of the table's rotation" in text


@pytest.mark.parametrize(
    ("sheet", "suspicious", "said"),
    [
        (("14.1", "mdeg/s/sqrt(Hz)"), False, "data sheet: 0.0141 deg/s/sqrt(Hz), one-sided; ratio "),
        (("0.81", "deg/s/sqrt(Hz)"), True, "near 1/57.3, as when degrees and radians are mixed up"),
        (("0.01", "deg/s/sqrt(Hz)"), False, ": as expected"),
        (("14.1", "deg/s/sqrt(Hz)"), True, "near 1/1000"),
    ],
)
def test_the_data_sheet_is_compared_one_sided(log, sheet, suspicious, said):
    """With a unit that is converted; outside 0.5 to 3 it is suspicious, and the factor is named."""
    result = run(log, *UNTIMED, "--density", *sheet)
    assert said in " ".join(result.stdout.split())
    assert result.return_value == int(suspicious)
    compared = json.loads(run(log, *UNTIMED, "--density", *sheet, "--json").stdout)["axes"][0]
    assert compared["data_sheet"]["suspicious"] is suspicious
    ratio = compared["data_sheet"]["ratio"]
    assert compared["data_sheet"]["low"] < ratio["value"] < compared["data_sheet"]["high"]
    assert (compared["white"]["status"] == "inconclusive") is suspicious


def test_the_allan_deviation_compares_with_the_data_sheet_as_the_spectrum_does(log):
    """Both one-sided: the gate `density` of one finds the ratio of the other."""
    compared = json.loads(run(log, *UNTIMED, "--density", "0.0141", "deg/s/sqrt(Hz)", "--json").stdout)["axes"][0]
    allan = CliRunner().invoke(command, ["allan", log, *UNTIMED, "--noise-density", "0.0141", "--json"])
    (gate,) = [each for each in json.loads(allan.stdout)["gates"] if each["name"] == "density"]
    ratio = float(gate["reason"].partition("hertz, ")[2].partition(" times")[0])
    assert ratio == pytest.approx(compared["data_sheet"]["ratio"]["value"], rel=0.15)


def test_a_spectrum_leaves_out_segments(tmp_path):
    """And no averages, of which it has none."""
    times = np.delete(np.arange(4000) / 100.0, np.s_[1000:1100])
    path = tmp_path / "gap.txt"
    np.savetxt(path, np.column_stack([times, np.random.default_rng(0).standard_normal(3900)]))
    text = " ".join(run(str(path), "--time", "1", "--unit", "deg/s").stdout.split())
    assert "100 samples are missing; segments that miss more than 5 % of their samples are left out" in text


def test_the_density_needs_a_unit_that_fits(log):
    """And only one of the two options."""
    with pytest.raises(HilError):
        run(log, *UNTIMED, "--density", "3", "ug/sqrt(Hz)")
    with pytest.raises(Refused, match="mean the same"):
        run(log, *UNTIMED, "--density", "3", "deg/s/sqrt(Hz)", "--noise-density", "3")


def test_a_bandwidth_beyond_half_of_the_rate_is_told(log):
    """What is folded in makes every coefficient inconclusive."""
    result = run(log, *UNTIMED, "--bandwidth", "300")
    assert result.return_value == 1
    assert "INCONCLUSIVE: aliased: the bandwidth, 300 Hz, is beyond half of the rate" in result.stdout


@pytest.mark.system
def test_the_spectra_are_drawn(log, tmp_path):
    """As the ending says; another ending is refused."""
    run(log, *UNTIMED, "--plot", str(tmp_path / "spectrum.svg"))
    drawn = (tmp_path / "spectrum.svg").read_text(encoding="utf-8")
    assert drawn.startswith("<?xml")
    assert "one-sided power spectral density" in drawn
    with pytest.raises(Refused, match=r"\.svg or \.png"):
        run(log, *UNTIMED, "--plot", str(tmp_path / "spectrum.pdf"))


def test_a_short_axis_has_plain_numbers():
    """20 and 30 between powers of ten where the axis is shorter than a decade; powers alone on a longer one."""
    from matplotlib.figure import Figure  # noqa: PLC0415 - the drawing library takes long to load

    from hil.cli.analyses.plots import _plain  # noqa: PLC0415 - the drawing library takes long to load

    axes = Figure().add_subplot()
    axes.set_yscale("log")
    for top, told in ((60.0, "20"), (6000.0, "")):
        axes.set_ylim(8.0, top)
        _plain(axes)
        assert axes.yaxis.get_minor_formatter().format_ticks([20.0]) == [told]


def test_a_density_in_a_unit_of_something_else_is_refused():
    """The message names the option, and the unit that is wanted."""
    with pytest.raises(
        Refused, match=r"--density: 'deg/s' does not convert to 'deg/s/sqrt\(Hz\)'; give it in deg/s/sq"
    ):
        run("none.csv", *UNTIMED, "--density", "0.01", "deg/s")


def test_points_without_json_are_refused():
    """They would be dropped without a word."""
    with pytest.raises(Refused, match="--points changes nothing without --json; add --json, or leave --points out"):
        run("none.csv", *UNTIMED, "--points")
