"""Ugly logs: generated files with a known truth, and what the commands say to them.

To add a kind, write a function that returns its text, with `@kind(title, command, truth, figure)`. The command runs on
FILE. The truth is the value of each figure that `figure` takes from the JSON document, None where only a flag or an
error will do. `python tests/support/ugly_logs.py` writes the page.
"""

from __future__ import annotations

import gzip
import json
import math
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import flights
import numpy as np
import photodiode_readings
from click.testing import CliRunner

from hil.cli.commands.analyse import command
from hil.model.errors import HilError

__all__ = ["KINDS", "PAGE", "Kind", "Said", "page", "said"]

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "ugly-logs.md"

WITHIN = 4.0  # standard uncertainties: beyond it a value is wrong
COUNT, RATE, SIGMA = 4000, 100.0, 0.1
TRUTH = SIGMA / math.sqrt(RATE)  # white noise in deg/s/sqrt(Hz)
ALLAN = ("allan", "FILE", "--time", "1", "--unit", "deg/s")
PSD = ("psd", *ALLAN[1:])
UNTIMED = ("allan", "FILE", "--rate", "100", "--unit", "deg/s")


@dataclass(frozen=True, kw_only=True)
class Kind:
    """One kind of ugly log.

    Attributes:
        title: what is ugly.
        command: arguments of `hil analyse`, with FILE for the log.
        truth: value of the figures by path in the JSON document, such as `white`; None: nothing can be known.
        write: returns the log's text or bytes.
    """

    title: str
    command: tuple[str, ...]
    truth: float | None
    write: Callable[[], str | bytes]
    figure: Callable[[dict], list[dict]]


@dataclass(frozen=True, kw_only=True)
class Said:
    """What a command said: `value`, `flag` or `error`, and the sentence."""

    outcome: str
    sentence: str
    document: dict | None = None
    figures: tuple[dict, ...] = ()


KINDS: dict[str, Kind] = {}


def white(document):
    """Return the white noise of every axis."""
    return [axis["white"] for axis in document["axes"]]


def kind(title, command=ALLAN, truth=TRUTH, figure=white):
    """Register a function that writes a log, by its name."""

    def register(write):
        KINDS[write.__name__] = Kind(title=title, command=command, truth=truth, write=write, figure=figure)
        return write

    return register


def said(ugly: Kind, folder: Path) -> Said:
    """Write a log, run the command on it, and return what it said; an exception other than HilError is raised."""
    made = ugly.write()
    path = folder / "ugly.csv"
    path.write_bytes(made if isinstance(made, bytes) else made.encode())
    arguments = [str(path) if each == "FILE" else each for each in ugly.command]
    for place, each in enumerate(ugly.command):
        if each.startswith("schema:"):
            (folder / "mapping.yaml").write_text(each)
            arguments[place] = str(folder / "mapping.yaml")
    try:
        result = CliRunner().invoke(command, [*arguments, "--json"], catch_exceptions=False, standalone_mode=False)
    except HilError as error:
        told = error.message.replace(f"{path}", "FILE").replace(f"{folder / 'mapping.yaml'}", "MAPPING")
        return Said(outcome="error", sentence=told)
    document = json.loads(result.stdout)
    figures = tuple(ugly.figure(document))
    flagged = document.get("status") == "inconclusive"
    assert result.return_value == int(flagged), "the exit code is 1 if a gate trips, else 0"
    gates = [gate for gate in document.get("gates", ()) if gate["ok"] is False]
    told = [f"{gate['name']}: {gate['reason']}" for gate in gates] + list(document.get("remarks", ()))
    for phase in document.get("phases", ()):
        told += [f"{gate['name']}: {gate['reason']}" for gate in phase["gates"] if gate["ok"] is False]
        told += [phase["remark"]] if phase["remark"] else []
    if not flagged and all(figure["status"] in {"measured", "upper limit"} for figure in figures):
        return Said(outcome="value", sentence="; ".join(told), document=document, figures=figures)
    told += [axis["remark"] for axis in document.get("axes", ()) if axis.get("remark")]
    axes = [axis for fragment in document.get("fragments", ())[:1] for axis in fragment["axes"]]
    told += dict.fromkeys(reason for axis in axes for reason in axis["reasons"].values() if not flagged)
    return Said(outcome="flag", sentence="; ".join(told), document=document, figures=figures)


def noise(count=COUNT, seed=1, sigma=SIGMA):
    """Return white noise around a bias."""
    return 0.05 + sigma * np.random.default_rng(seed).standard_normal(count)


def times(count=COUNT, rate=RATE):
    """Return even times in s."""
    return np.arange(count) / rate


def table(*columns, form="%.10g", head="t,x"):
    """Return columns as text."""
    rows = zip(*(np.asarray(each).tolist() for each in columns), strict=True)
    text = "\n".join(",".join(each if isinstance(each, str) else form % each for each in row) for row in rows)
    return f"{head}\n{text}\n"


# Times


@kind("even timestamps in s, no damage")
def even():
    return table(times(), noise())


@kind("a 32-bit counter of microseconds that wraps", (*ALLAN, "--time-unit", "us"))
def wraps_us():
    return table((4.28e9 + times() * 1e6) % 2**32, noise(), form="%.12g")


@kind("a 32-bit counter of microseconds, written in ms, that wraps", (*ALLAN, "--time-unit", "ms"))
def wraps_us_in_ms():
    return table(((4.28e9 + times() * 1e6) % 2**32) / 1e3, noise(), form="%.12g")


@kind("a 32-bit counter of milliseconds that wraps", (*ALLAN, "--time-unit", "ms"))
def wraps_ms():
    return table((2**32 - 15000 + times() * 1e3) % 2**32, noise(), form="%.12g")


@kind("a signed 32-bit counter of microseconds that wraps", (*ALLAN, "--time-unit", "us"))
def wraps_signed():
    return table((2**31 - 2e7 + times() * 1e6 + 2**31) % 2**32 - 2**31, noise(), form="%.12g")


@kind("a 16-bit counter of milliseconds that wraps often", (*ALLAN, "--time-unit", "ms"))
def wraps_16():
    return table((times(20000) * 1e3) % 65536, noise(20000))


@kind("milliseconds taken for seconds, without --time-unit")
def milliseconds_untold():
    return table(times() * 1e3, noise())


@kind("microseconds taken for seconds, without --time-unit")
def microseconds_untold():
    return table(times() * 1e6, noise())


@kind("milliseconds, as the column's name says")
def milliseconds_named():
    return table(times() * 1e3, noise(), head="t_ms,x")


@kind("milliseconds, with --time-unit", (*ALLAN, "--time-unit", "ms"))
def milliseconds_typed():
    return table(times() * 1e3, noise())


@kind("hours, taken for seconds")
def hours_untold():
    return table(times() / 3600, noise(), form="%.15g")


@kind("days as a fraction", (*ALLAN, "--time-unit", "d"))
def days():
    return table(45000 + times() / 86400, noise(), form="%.17g")


@kind("bursts of ten under one timestamp")
def bursts():
    return table(np.floor(times() * 10) / 10, noise())


@kind("bursts of ten, a tenth of a millisecond apart within")
def bursts_spread():
    return table(np.repeat(np.arange(COUNT // 10) / 10, 10) + np.tile(np.arange(10) * 1e-4, COUNT // 10), noise())


@kind("bursts of changing length, with a second missing")
def bursts_gap():
    kept = np.r_[0:1500, 1600:COUNT]
    return table(np.floor(times()[kept] / 0.087) * 0.087, noise()[kept])


@kind("952 Hz in whole milliseconds", truth=SIGMA / math.sqrt(952))
def rounded():
    return table(np.floor(times(rate=952) * 1e3) / 1e3, noise())


@kind("952 Hz in whole milliseconds, and 300 samples missing", truth=SIGMA / math.sqrt(952))
def rounded_gap():
    kept = np.r_[0:1500, 1800:COUNT]
    return table((np.floor(times(rate=952) * 1e3) / 1e3)[kept], noise()[kept])


@kind("5 kHz in whole milliseconds", truth=SIGMA / math.sqrt(5000))
def rounded_fast():
    return table(np.floor(times(rate=5000) * 1e3) / 1e3, noise())


@kind("100 Hz in hundredths of a second, 5 % of the samples missing", truth=TRUTH)
def lossy():
    kept = np.random.default_rng(7).random(COUNT) > 0.05
    return table(times()[kept], noise()[kept])


@kind("jitter of a third of an interval, of the host's clock")
def jitter_host():
    return table(times() + np.random.default_rng(3).uniform(-1, 1, COUNT) / 300, noise())


@kind("jitter of a third of an interval, adding up")
def jitter_walk():
    return table(np.cumsum(np.abs(1 + np.random.default_rng(3).standard_normal(COUNT) / 3)) / RATE, noise())


@kind("jitter of a whole interval: the order is unknown", truth=TRUTH)
def jitter_wild():
    return table(times() + np.random.default_rng(3).standard_normal(COUNT) / 100, noise())


@kind("three timestamps that repeat the one before, with other values")
def repeats():
    time = times()
    time[[100, 2000, 3000]] = time[[99, 1999, 2999]]
    return table(time, noise())


@kind("duplicated rows")
def rows_twice():
    kept = np.sort(np.r_[0:COUNT, 100, 2000, 3000])
    return table(times()[kept], noise()[kept])


@kind("neighbouring rows swapped")
def rows_swapped():
    order = np.arange(COUNT)
    order[[100, 101, 2000, 2001]] = order[[101, 100, 2001, 2000]]
    return table(times()[order], noise()[order])


@kind("a clock set back by two seconds")
def set_back():
    return table(times() - 2.0 * (np.arange(COUNT) > 1500), noise())


@kind("the same log twice, one after the other")
def log_twice():
    return table(np.tile(times(2000), 2), np.tile(noise(2000), 2))


@kind("the same samples twice, without times", UNTIMED)
def samples_twice():
    return table(np.tile(noise(2000), 2), head="x")


@kind("a log of two starts: time restarts at zero")
def restarts():
    return table(np.concatenate([times(1700), times(2300)]), noise())


@kind("time of day through midnight")
def midnight():
    seconds = (86390 + times()) % 86400
    return table([_clock(each) for each in seconds], noise())


@kind("hh:mm:ss.sss with days")
def elapsed_days():
    return table([f"{3 + int(s // 86400)} days {_clock(s % 86400)}" for s in 86390 + times()], noise())


@kind("dates of ISO 8601, in UTC")
def iso():
    return table([f"2026-01-3{int(s // 86400)}T{_clock(s % 86400)}Z" for s in 86390 + times()], noise())


@kind("seconds since 1970")
def epoch():
    return table(1.7e9 + times(), noise(), form="%.13g")


@kind("milliseconds since 1970, undeclared")
def epoch_ms():
    return table(1.7e12 + times() * 1e3, noise(), form="%.15g")


@kind("nanoseconds since 1970, undeclared")
def epoch_ns():
    return table([f"{1700000000 * 10**9 + n * 10**7}" for n in range(COUNT)], noise())


@kind("a timestamp that is not a number")
def time_nan():
    time = times()
    time[700] = np.nan
    return table(time, noise())


@kind("a gap as long as the record")
def long_gap():
    return table(times() + 40.0 * (np.arange(COUNT) >= 2000), noise())


@kind("timestamps that do not advance", truth=None)
def still():
    return table(np.zeros(COUNT), noise())


def _clock(seconds):
    ms = round(seconds * 1000) % 86_400_000
    return f"{ms // 3_600_000:02d}:{ms // 60_000 % 60:02d}:{ms // 1000 % 60:02d}.{ms % 1000:03d}"


# Samples


@kind("noise of a fifth of a count: quantised away", truth=0.02 * TRUTH / SIGMA)
def quantised_away():
    return table(times(), np.rint(noise(sigma=0.02) / 0.1 + 0.3) * 0.1)


@kind("noise of one count", truth=0.1 * math.sqrt(1 + 1 / 12) / math.sqrt(RATE))
def one_count():
    return table(times(), np.rint(noise() / 0.1) * 0.1)


@kind("one spike of a thousand standard deviations")
def one_spike():
    values = noise()
    values[1234] = 100.0
    return table(times(), values)


@kind("ten spikes of ten standard deviations")
def ten_spikes():
    values = noise()
    values[np.arange(10) * 371 + 100] += 1.0
    return table(times(), values)


@kind("clipped at one standard deviation on both sides")
def clipped():
    return table(times(), np.clip(noise(), -0.05, 0.15))


@kind("clipped at two standard deviations on one side")
def clipped_above():
    return table(times(), np.minimum(noise(), 0.25))


@kind("at full scale, with --full-scale", (*ALLAN, "--full-scale", "0.3"))
def full_scale():
    return table(times(), np.clip(noise(), -0.3, 0.3))


@kind("a fifth of the samples repeats the one before")
def repeated_fifth():
    values = noise()
    for place in np.flatnonzero(np.random.default_rng(5).random(COUNT - 1) < 0.2) + 1:
        values[place] = values[place - 1]
    return table(times(), values)


@kind("stuck for the last fifth")
def stuck_end():
    values = noise()
    values[3200:] = values[3199]
    return table(times(), values)


@kind("read at twice the sensor's rate: every sample twice")
def read_twice():
    return table(times(), np.repeat(noise(COUNT // 2), 2))


@kind("a column that never changes", truth=None)
def constant():
    return table(times(), np.full(COUNT, 17.937))


@kind("a bandwidth beyond half of the rate", (*ALLAN, "--bandwidth", "300"))
def aliased():
    return table(times(), noise())


@kind("rad/s where the data sheet has deg/s", (*ALLAN, "--noise-density", "0.0141"), TRUTH)
def radians():
    return table(times(), noise() * math.pi / 180)


@kind("m/s^2 where the data sheet has g", ("allan", "FILE", "--time", "1", "--unit", "g", "--noise-density", "0.0141"))
def metres():
    return table(times(), noise() * 9.80665)


@kind("mdeg/s where the data sheet has deg/s", (*ALLAN, "--noise-density", "0.0141"))
def milli():
    return table(times(), noise() * 1000)


@kind("one axis of three in rad/s")
def one_axis():
    return table(times(), noise(seed=1), noise(seed=2), noise(seed=3) * math.pi / 180, head="t,x,y,z")


@kind("samples that are NaN")
def nan_samples():
    values = noise()
    values[[5, 900, 901]] = np.nan
    return table(times(), values)


@kind("an infinite sample")
def infinite():
    values = noise()
    values[900] = np.inf
    return table(times(), values)


@kind("a column of NaN only", truth=None)
def all_nan():
    return table(times(), np.full(COUNT, np.nan))


def slow_noise(document):
    """Return flicker and random walk of every axis."""
    return [axis[name] for axis in document["axes"] for name in ("flicker", "random_walk")]


@kind("a warm-up, which is not a random walk", truth=0.0, figure=slow_noise)
def warm_up():
    return table(times(), noise() + 0.5 * np.exp(-times() / 5.0))


@kind("a slow sine, which is not a random walk", truth=0.0, figure=slow_noise)
def slow_sine():
    return table(times(), noise() + 0.1 * np.sin(times() / 3.0))


@kind("a ramp, which is not a random walk", truth=0.0, figure=slow_noise)
def ramp():
    return table(times(), noise() + 0.01 * times())


@kind("white noise beneath a ramp")
def beneath_ramp():
    return table(times(), noise() + 0.01 * times())


@kind("a ramp", truth=0.01, figure=lambda document: [axis["ramp"] for axis in document["axes"]])
def ramp_itself():
    return table(times(), noise() + 0.01 * times())


@kind("a straight line without noise", truth=None)
def line():
    return table(times(), 0.01 * times())


@kind("an undeclared first-order filter", truth=TRUTH)
def filtered():
    values = noise(COUNT + 50, sigma=SIGMA) - 0.05
    for place in range(1, values.size):
        values[place] = 0.7 * values[place - 1] + 0.3 * values[place]
    return table(times(), values[50:])


@kind("an undeclared moving average of four samples")
def averaged():
    return table(times(), np.convolve(noise(COUNT + 3), np.ones(4) / 4, "valid"))


@kind("a counted angle: quantisation", truth=0.001, figure=lambda document: [document["axes"][0]["quantisation"]])
def counted_angle():
    errors = np.random.default_rng(4).uniform(-1, 1, COUNT + 1) * math.sqrt(3) * 0.001
    return table(times(), noise(sigma=0.02) + np.diff(errors) * RATE)


# Numbers near the ends


@kind("values of 1e300", truth=None)
def huge():
    return table(times(), noise() * 1e300)


@kind("values of 1e-200", truth=None)
def tiny():
    return table(times(), noise() * 1e-200)


@kind("an offset of 1e12 standard deviations", truth=None)
def offset():
    return table(times(), noise() + 1e11, form="%.17g")


@kind("an empty file", truth=None)
def empty():
    return ""


@kind("a header without rows", truth=None)
def header_only():
    return "t,x\n"


@kind("two samples", truth=None)
def two():
    return "t,x\n0,1\n0.01,2\n"


@kind("two samples without times", UNTIMED, truth=None)
def two_untimed():
    return "x\n1\n2\n"


@kind("one sample without times", UNTIMED, truth=None)
def one_untimed():
    return "x\n1\n"


@kind("a truncated last line")
def torn():
    return table(times(), noise()) + "40.00,-"


@kind("a truncated last line that is still a row of numbers")
def torn_row():
    return table(times(), noise()) + "40.00,0."


@kind("a row with one cell too many", truth=None)
def ragged():
    return table(times(), noise()) + "40.00,0.1,7\n40.01,0.1\n"


# Disturbances that last


@kind("a knock of ten samples, twenty standard deviations high")
def knock():
    values = noise()
    values[1300:1310] += 2.0
    return table(times(), values)


@kind("half of the record with three times the noise")
def noise_triples():
    values = noise()
    values[2000:] = 0.05 + 3.0 * (values[2000:] - 0.05)
    return table(times(), values)


@kind("one reading in two hundred lost to zero, far from the mean")
def zeros():
    values = noise() + 5.0
    values[::200] = 0.0
    return table(times(), values)


@kind("clipped at one standard deviation, counts of half of one")
def clipped_counts():
    return table(times(20000), np.rint(np.clip(noise(20000) - 0.05, -0.1, 0.1) / 0.05) * 0.05)


@kind("clipped at 1.5 standard deviations, counts of half of one")
def clipped_half_counts():
    return table(times(), np.clip(np.rint((noise() - 0.05) / 0.05), -3, 3) * 0.05)


@kind("clipped at one standard deviation above, counts of one")
def clipped_whole_counts():
    return table(times(), np.minimum(np.rint(noise() / 0.1), 1) * 0.1)


@kind("counts of half a standard deviation, clipped on one side, on a drift twice as large")
def clipped_drift():
    return table(times(), np.minimum(np.rint((noise() + 0.2 * times() / 40.0) / 0.05), 5) * 0.05)


@kind("one sample in two hundred is 4 to 6 standard deviations off")
def heavy_tails():
    generator, values = np.random.default_rng(8), noise()
    places = generator.choice(COUNT, COUNT // 200, replace=False)
    values[places] += SIGMA * generator.uniform(4, 6, places.size) * generator.choice([-1, 1], places.size)
    return table(times(), values)


# What changes on the way


@kind("a reset: the bias jumps by three standard deviations", truth=0.0, figure=slow_noise)
def jump():
    return table(times(), noise() + 0.3 * (np.arange(COUNT) > 1500))


@kind("the bias jumps by 0.4 standard deviations", truth=0.0, figure=slow_noise)
def small_jump():
    return table(times(16000), noise(16000) + 0.04 * (np.arange(16000) > 6000))


@kind("noise 1.4 times as large from the middle on")
def louder():
    values = noise()
    values[2000:] = 0.05 + 1.4 * (values[2000:] - 0.05)
    return table(times(), values)


@kind("a resolution that changes half way")
def coarser():
    values = noise()
    values[2000:] = np.rint(values[2000:] / 0.3) * 0.3
    return table(times(), values)


@kind("100 Hz, and 110 Hz from the middle on", truth=None)
def two_rates():
    return table(np.r_[times(2000), 20 + times(2000, 110)], noise())


@kind("two rates with different noise, swapped half way", (*ALLAN, "--columns", "x"))
def swapped_rates():
    first, second = noise(), 5.0 + 3.0 * noise(seed=2)
    late = np.arange(COUNT) >= 2000
    return table(times(), np.where(late, second, first), np.where(late, first, second), head="t,x,y")


@kind("time and rate swapped half way")
def swapped_columns():
    late = np.arange(COUNT) >= 2000
    return table(np.where(late, noise(), times()), np.where(late, times(), noise()))


@kind("one axis of three that saturates")
def one_axis_saturates():
    return table(times(), noise(), np.clip(noise(seed=2), -0.1, 0.1), noise(seed=3), head="t,x,y,z")


@kind("signed counts of 16 bits read as unsigned", truth=1000 * TRUTH)
def unsigned():
    return table(times(), np.rint(1000 * noise() - 50).astype(int) % 65536)


@kind("counts of 16 bits that overflow now and then", truth=1000 * TRUTH)
def overflowing():
    return table(times(), (np.rint(1000 * noise() + 32500).astype(int) + 32768) % 65536 - 32768)


@kind("counts of 16 bits with their bytes swapped", truth=1000 * TRUTH)
def other_order():
    return table(times(), np.rint(1000 * noise()).astype(">i2").view("<i2"))


@kind("-999 where a sample is missing")
def minus_999():
    return table(times(), np.where(np.arange(COUNT) % 97 == 5, -999.0, noise()))


# How it is written


@kind("zero bytes after the last row")
def zeros_behind():
    return even().encode() + bytes(4096)


@kind("a block of zero bytes in the middle")
def zeros_within():
    whole = even().encode()
    return whole[:60000] + bytes(512) + whole[60000:]


@kind("a UTF-8 byte order mark")
def marked():
    return b"\xef\xbb\xbf" + even().encode()


@kind("UTF-16")
def utf_16():
    return even().encode("utf-16")


@kind("microseconds in a Windows character set")
def windows():
    return table(times() * 1e6, noise(), head="t [µs],x [°/s]").encode("cp1252")


@kind("decimal commas from the middle on", truth=None)
def mixed_signs():
    lines = even().replace(",", ";").splitlines(keepends=True)
    return "".join(lines[:2000]) + "".join(lines[2000:]).replace(".", ",")


@kind("two columns with the same name", (*ALLAN, "--columns", "x"), truth=None)
def two_names():
    return table(times(), noise(), noise(seed=2), head="t,x,x")


@kind("two logs in one file, each with a header")
def two_logs():
    return even() + even()


@kind("time that runs backwards throughout")
def backwards():
    return table(times()[::-1], noise())


@kind("a line of units that contradicts --unit")
def contradicting_units():
    return table(times() * 1e3, 1e3 * noise(), head="t,x\nms,mdps")


@kind("comments between the rows, and one below the names")
def comments():
    lines = table(times(), noise()).splitlines(keepends=True)
    return lines[0] + "# written, by hand\n" + "# still, at rest\n".join(lines[1:])


@kind("a message of the logger between the rows")
def remark():
    lines = even().splitlines(keepends=True)
    return "".join(lines[:1500]) + "sensor reset\n" + "".join(lines[1500:])


@kind("an axis without a single value")
def axis_empty():
    return table(times(), noise(), [""] * COUNT, head="t,x,y")


@kind("an axis missing from the middle on", truth=None)
def axis_ends():
    lines = table(times(), noise(), noise(seed=2), head="t,x,y").splitlines()
    return "\n".join(lines[:2000] + [line.rpartition(",")[0] for line in lines[2000:]])


@kind("occasional empty cells", truth=None)
def cells_empty():
    lines = even().splitlines()
    return "\n".join(line.partition(",")[0] + "," if place % 97 == 5 else line for place, line in enumerate(lines))


@kind("a trailing separator in each row, but not in the header")
def separator_behind():
    return even().replace("\n", ",\n").replace("t,x,", "t,x", 1)


@kind("numbers in quotes")
def quoted():
    return "".join(f'"{line.replace(",", chr(34) + "," + chr(34))}"\n' for line in even().splitlines())


@kind("thousands with a comma, in quotes", truth=None)
def thousands():
    return table([f'"{each * 1e3:,.0f}"' for each in times()], noise(), head="t_ms,x")


@kind("lines of 20,000 characters", (*ALLAN, "--columns", "x"))
def long_lines():
    return table(times(), noise(), ["z" * 20_000 if n % 400 == 3 else "a" for n in range(COUNT)], head="t,x,note")


@kind("the repeated hour at the end of summer time")
def summer_ends():
    return table([f"2026-10-25T{_clock(10790 + s - 3600 * (s >= 10))}" for s in times()], noise())


@kind("the skipped hour at the start of summer time")
def summer_begins():
    return table([f"2026-03-29T{_clock(7190 + s + 3600 * (s >= 10))}" for s in times()], noise())


@kind("a leap second")
def leap_second():
    def told(since):
        if 10 <= since < 11:
            return f"2016-12-31T23:59:60{since - 10:.3f}".replace("600.", "60.")
        return f"2016-12-31T{_clock(86390 + since)}" if since < 10 else f"2017-01-01T{_clock(since - 11)}"

    return table([told(each) for each in times()], noise())


@kind("12-hour clock with AM and PM")
def twelve_hours():
    return table([_clock((43190 + s) % 43200) + (" AM" if s < 10 else " PM") for s in times()], noise())


@kind("spreadsheet day numbers, undeclared")
def spreadsheet_days():
    return table(46349 + times() / 86400, noise(), form="%.15g")


@kind("nanoseconds since a telephone was switched on, similar in size to ms since 1970")
def nanoseconds_since_boot():
    return table([f"{1700000000000 + n * 10**7}" for n in range(COUNT)], noise())


@kind("seconds in a column whose name says ms")
def seconds_named_ms():
    return table(times(), noise(), head="time_ms,x")


@kind("a sample counter given as the time, with a telling name", (*ALLAN[:3], "PacketCounter", *ALLAN[4:]))
def counted_as_time():
    return table(np.arange(65000.0, 65000.0 + COUNT) % 65536, noise(), head="PacketCounter,x")


@kind("day, month and year with points, decimal commas")
def points_and_commas():
    rows = zip(times().tolist(), noise().tolist(), strict=True)
    cells = ((_clock(36000 + second), f"{value:.6f}") for second, value in rows)
    return "t;x\n" + "".join(
        f"23.11.2026 {clock};{value}\n".replace(".", ",").replace(",", ".", 2) for clock, value in cells
    )


@kind("month, day and year with slashes, which may be day first")
def slashes():
    return table([f"11/12/2026 {_clock(36000 + second)}" for second in times()], noise())


@kind("five rows of 1970 before a receiver had the time")
def before_the_fix():
    return table(np.where(np.arange(COUNT) < 5, times(), 1.7e9 + times()), noise(), form="%.14g")


@kind("a log of ROS: a mark before the names, nanoseconds, a column of words", (*ALLAN, "--columns", "velocity.x"))
def of_ros():
    return table(
        [f"{1700000000 * 10**9 + n * 10**7}" for n in range(COUNT)],
        ["imu"] * COUNT,
        noise(),
        head="%time,frame_id,velocity.x",
    )


@kind("a log compressed with gzip", truth=None)
def packed():
    return gzip.compress(even().encode())


@kind("two sensors alternating in one column")
def two_sensors():
    return table(times(2 * COUNT) / 2.0, noise(2 * COUNT) + np.tile([0.0, 0.7], COUNT))


@kind("three sensors alternating in one column, under one timestamp")
def three_sensors():
    return table(np.repeat(times(), 3), noise(3 * COUNT) + np.tile([0.0, 0.3, -0.5], COUNT))


@kind("a vibration near a third of the rate, three times the noise")
def vibrating():
    return table(times(), noise() + 0.3 * np.sin(2.0 * np.pi * 33.3 * times() + 1.0))


@kind("mains at half of the rate")
def mains_folded():
    return table(times(), noise() + 0.3 * np.sin(2.0 * np.pi * 50.0 * times() + 1.0))


# Spectra


@kind("a spectrum of a vibration near a third of the rate, three times the noise", PSD)
def psd_vibrating():
    return vibrating()


@kind("a spectrum of two sensors alternating in one column", PSD)
def psd_two_sensors():
    return two_sensors()


@kind("a spectrum of even timestamps", PSD)
def psd_even():
    return table(times(), noise())


@kind("a spectrum with 952 Hz in whole milliseconds", PSD, SIGMA / math.sqrt(952.0))
def psd_rounded():
    return table(np.round(times(rate=952.0), 3), noise())


@kind("a spectrum with a sine of ten times the noise, and its harmonic", PSD)
def psd_lines():
    angle = 2.0 * np.pi * 7.03 * times()
    return table(times(), noise() + np.sin(angle) + 0.3 * np.sin(2.0 * angle))


@kind("a spectrum with a drift of five times the noise", PSD)
def psd_drift():
    return table(times(), noise() + 0.5 * times() / times()[-1])


@kind("a spectrum after an undeclared 20 Hz filter", PSD)
def psd_filtered():
    from scipy import signal  # noqa: PLC0415 - slow to import

    return table(times(40_000), signal.lfilter(*signal.butter(2, 20.0, fs=RATE), noise(40_000)))


@kind("a spectrum with 4 % of the samples NaN", PSD)
def psd_nan():
    return table(times(), np.where(np.random.default_rng(3).random(COUNT) < 0.04, np.nan, noise()))


@kind("a spectrum with a gap as long as the record", PSD)
def psd_gap():
    return table(times() + 40.0 * (np.arange(COUNT) >= 2000), noise())


@kind("a spectrum with an eighth of the samples missing: no segment is whole", PSD)
def psd_sparse():
    kept = np.random.default_rng(4).random(COUNT) > 0.125
    return table(times()[kept], noise()[kept])


@kind("a spectrum of milliseconds taken for seconds, without --time-unit", PSD)
def psd_ms():
    return table(times() * 1e3, noise())


@kind("a spectrum with one spike of a thousand standard deviations", PSD)
def psd_spike():
    values = noise()
    values[1234] = 100.0
    return table(times(), values)


@kind("a spectrum of a column that never changes", PSD, truth=None)
def psd_constant():
    return table(times(), np.full(COUNT, 17.937))


@kind("a spectrum of twenty samples", PSD, truth=None)
def psd_short():
    return table(times(20), noise(20))


@kind("a spectrum of numbers near 1e60", PSD, 1e60 * TRUTH)
def psd_huge():
    return table(times(), noise() * 1e60)


@kind("a spectrum with a bandwidth beyond half of the rate", (*PSD, "--bandwidth", "300"))
def psd_aliased():
    return table(times(), noise())


@kind(
    "a spectrum in rad/s where the data sheet has deg/s",
    (*PSD, "--density", "14.1", "mdeg/s/sqrt(Hz)"),
    TRUTH,
)
def psd_radians():
    return table(times(), noise() * math.pi / 180)


# Flights

FLIGHT = ("flight", "FILE", "--time", "t", "--columns", "gx,gy,gz", "--unit", "deg/s")
BOTH = (*FLIGHT, "--field", "mx,my,mz", "--field-unit", "uT")
TURNING = 12.0  # deg/s, for 120 s between two minutes at rest


def turning(document):
    """Return the rate of each rotation that no gate speaks against, one of nothing where there is none."""
    doubted = [gate["reason"] for each in document["phases"] for gate in each["gates"] if gate["ok"] is False]
    found = [each["turning"] for each in document["phases"] if each["kind"] == "rotation"]
    return [{**each, "status": "inconclusive"} if doubted else each for each in found] or [{"value": 0.0}]


def flown(*, units=1.0, iron=0.0, seconds=1.0):
    """Return times, rates and fields of a flight."""
    still, spin = flights.turning(120, 10.0), flights.turning(120, 10.0, (0.0, 0.0, TURNING))
    rates, field = flights.made([still, spin, still], 10.0, iron=(iron, 0.0, 0.0))
    return [np.arange(len(rates)) * 0.1 * seconds, *(rates * units).T, *field.T]


def flight(columns):
    return table(*columns, head="t,gx,gy,gz,mx,my,mz")


@kind("a flight with one rotation, no damage", BOTH, TURNING, turning)
def plain_flight():
    return flight(flown())


@kind("a flight's rates in rad/s", BOTH, TURNING, turning)
def flight_in_radians():
    return flight(flown(units=math.pi / 180.0))


@kind("a flight's rates with the sign of one axis wrong", BOTH, TURNING, turning)
def flight_mirrored():
    return flight(flown(units=np.array([1.0, 1.0, -1.0])))


@kind("a flight's times in milliseconds, taken for seconds", BOTH, TURNING, turning)
def flight_in_milliseconds():
    return flight(flown(seconds=1000.0))


@kind("a flight with iron near its magnetometer", BOTH, TURNING, turning)
def flight_with_iron():
    return flight(flown(iron=15.0))


@kind("a flight with a power cut of 30 s during its rotation", BOTH, TURNING, turning)
def flight_cut():
    columns = flown()
    keep = (columns[0] < 170.0) | (columns[0] > 200.0)
    return flight([each[keep] for each in columns])


@kind("a flight's rotation beyond the full scale, with --full-scale", (*BOTH, "--full-scale", "10"), TURNING, turning)
def flight_saturated():
    time, *rest = flown()
    return flight([time, *(each.clip(-10.0, 10.0) for each in rest[:3]), *rest[3:]])


@kind("a flight whose magnetometer hangs during the rotation", BOTH, TURNING, turning)
def flight_hung():
    columns = flown()
    for each in columns[4:]:
        each[1500:2000] = each[1500]
    return flight(columns)


def slower(fill):
    """Return a flight whose magnetometer has every fifth of its readings; `fill` says what stands in the other rows."""
    columns = flown()
    for each in columns[4:]:
        each[:] = fill(each, np.arange(each.size) // 5 * 5)
    return flight(columns)


@kind("a flight whose magnetometer is slower, its readings held", BOTH, TURNING, turning)
def flight_held():
    return slower(lambda values, row: values[row])


@kind("a flight whose magnetometer is slower, empty cells between its readings", BOTH, TURNING, turning)
def flight_sparse():
    return slower(lambda values, row: np.where(row == np.arange(row.size), values, np.nan)).replace("nan", "")


# Gyroscope over temperature

GYROSCOPE = ("gyroscope-temperature", "FILE", "--temperature", "T", "--means", "x", "--axes", "x", "--unit", "deg/s")
SLOPE = 0.012  # deg/s/K


def slope(document):
    """Return the first coefficient of the bias."""
    bias = document["calibration"]["axes"]["x"]["bias"]
    if len(bias["coefficients"]) < 2:
        return [{"value": 0.0, "uncertainty": 0.0, "status": "measured"}]
    uncertainty = math.sqrt(bias["covariance"][1][1])
    return [{"value": bias["coefficients"][1], "uncertainty": uncertainty, "status": "measured"}]


def temperatures():
    """Return temperatures in degC and the means at them."""
    celsius = np.repeat([-15.0, 0.0, 10.0, 25.0, 43.0], 4)
    return celsius, 0.3 + SLOPE * (celsius - 25.0) + 0.002 * np.random.default_rng(4).standard_normal(celsius.size)


@kind("temperatures in degC, no damage", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def celsius():
    return table(*temperatures(), head="T,x")


@kind("temperatures in kelvin", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def kelvin():
    warm, means = temperatures()
    return table(warm + 273.15, means, head="T,x")


@kind("temperatures in counts", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def counts():
    warm, means = temperatures()
    return table(np.rint(warm * 340 + 12420), means, head="T,x")


@kind("temperatures in Fahrenheit, as the column's name says", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def fahrenheit():
    warm, means = temperatures()
    return table(1.8 * warm + 32, means, head="T,x\n°F,deg/s")


@kind("temperatures in Fahrenheit, undeclared", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def fahrenheit_untold():
    warm, means = temperatures()
    return table(1.8 * warm + 32, means, head="T,x")


@kind("the same table twice", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def table_twice():
    return celsius() + celsius().removeprefix("T,x\n")


@kind("means in mdeg/s, as a line of units says", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def means_milli():
    warm, means = temperatures()
    return table(warm, 1e3 * means, head="T,x\ndegC,mdeg/s")


@kind("temperature and means swapped", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def mixed_up():
    warm, means = temperatures()
    return table(means, warm, head="T,x")


@kind("a last row truncated within its mean", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def torn_mean():
    return celsius()[:-6]


@kind("a mean of 1e300", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def mean_huge():
    warm, means = temperatures()
    return table(warm, np.where(np.arange(means.size) == 9, 1e300, means), head="T,x")


@kind("an axis that never changes", (*GYROSCOPE, "--uncertainty", "0.002"), None, slope)
def axis_still():
    warm, means = temperatures()
    return table(warm, np.full(means.size, 0.3), head="T,x")


TURNED = (*GYROSCOPE[:4], "--means", "x,y,z", "--unit", "deg/s", "--uncertainty", "0.002", "--rates", "rx,ry,rz")


def gains(document):
    """Return the scale of x at the reference temperature."""
    scale = document["calibration"]["axes"]["x"]["scale"]
    spread = math.sqrt(scale["covariance"][0][0])
    return [{"value": scale["coefficients"][0], "uncertainty": spread, "status": "measured"}]


def turned(*, readings=1.0, rates=1.0, still=1.0, ways=(1.0, -1.0)):
    """Return a table with rates of 20 deg/s about x; a scale of 1.01, and what is wrong as a factor."""
    generator, rows = np.random.default_rng(6), []
    for warm in (-15.0, 0.0, 10.0, 25.0, 43.0):
        for rate in (0.0, *(20.0 * way for way in ways)):
            means = 0.3 + SLOPE * (warm - 25.0) + 0.002 * generator.standard_normal(3)
            means[0] += still * rate / 1.01
            rows.append([warm, *means * readings, rates * rate, 0.0, 0.0])
    return table(*np.array(rows).T, head="T,x,y,z,rx,ry,rz")


@kind("rates in both directions, no damage", TURNED, 1.01, gains)
def rates_both():
    return turned()


@kind("rates of the table in rad/s", TURNED, 1.01, gains)
def rates_radians():
    return turned(rates=math.pi / 180.0)


@kind("readings in rad/s", TURNED, 1.01, gains)
def readings_radians():
    return turned(readings=math.pi / 180.0)


@kind("readings scaled for half the selected range", TURNED, 1.01, gains)
def half_range():
    return turned(readings=2.0)


@kind("rates with the wrong sign", TURNED, 1.01, gains)
def rates_sign():
    return turned(rates=-1.0)


@kind("an axis that does not turn with the table", TURNED, None, gains)
def axis_unturned():
    return turned(still=0.0)


@kind("rates in one direction only, with readings at rest", TURNED, 1.01, gains)
def rates_one_way():
    return turned(ways=(1.0,))


@kind("an outlier among the means", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def mean_outlier():
    warm, means = temperatures()
    means[7] += 0.1
    return table(warm, means, head="T,x")


@kind("a mean of NaN", (*GYROSCOPE, "--uncertainty", "0.002"), SLOPE, slope)
def mean_nan():
    warm, means = temperatures()
    means[3] = np.nan
    return table(warm, means, head="T,x")


# Batteries

BATTERY = (
    *("battery", "FILE", "--time", "t", "--voltage", "U", "--current", "I", "--temperature", "T"),
    *("--capacity", "1.0", "--upper", "4.2", "--lower", "3.0"),
)
AH = 1.0


def capacity(document):
    """Return the discharged charge of every cycle with the uncertainty that is told."""
    return [
        {
            "value": each["discharge"]["charge"] if each["discharge"] else 0.0,
            "uncertainty": each["uncertainty"].get("discharge_Ah", 0.0),
            "status": "measured",
        }
        for each in document["cycles"]
    ] or [{"value": 0.0, "uncertainty": 0.0, "status": "measured"}]


def cell():
    """Return two cycles at 1 A, an hour each way and rests between: s, V, A, degC."""
    parts = [(600, 0.0), (3600, 1.0), (600, 0.0), (3600, -1.0)] * 2 + [(600, 0.0)]
    current = np.concatenate([np.full(int(seconds / 10), amps) for seconds, amps in parts])
    time = 10.0 * np.arange(current.size)
    full = np.cumsum(current) * 10.0 / 3600.0
    voltage = 3.25 + 0.8 * full + 0.1 * current
    return time, voltage, current, 25.0 + 0.5 * np.abs(current) + 0.01 * np.sin(time / 100.0)


HEAD = "t,U,I,T"


@kind("two cycles of a cell, no damage", BATTERY, AH, capacity)
def battery_even():
    return table(*cell(), head=HEAD)


@kind("a cell's times in hh:mm:ss", BATTERY, AH, capacity)
def battery_clock():
    time, *others = cell()
    return table([_clock(each) for each in time], *others, head=HEAD)


@kind("a cell's times in ms that wrap at 32 bits", (*BATTERY, "--time-unit", "ms"), AH, capacity)
def battery_wraps():
    time, *others = cell()
    return table((time * 1e3 + 2**32 - 5_000_000) % 2**32, *others, form="%.12g", head=HEAD)


@kind("a cell's times in hours, taken for seconds", BATTERY, AH, capacity)
def battery_hours():
    time, *others = cell()
    return table(time / 3600, *others, form="%.12g", head=HEAD)


@kind("a cell's current in mA", BATTERY, AH, capacity)
def battery_milli():
    time, voltage, current, warm = cell()
    return table(time, voltage, current * 1e3, warm, head=HEAD)


@kind("a cell's temperature in kelvin", BATTERY, AH, capacity)
def battery_kelvin():
    time, voltage, current, warm = cell()
    return table(time, voltage, current, warm + 273.15, head=HEAD)


@kind("a cell's temperature in Fahrenheit, undeclared", BATTERY, AH, capacity)
def battery_fahrenheit():
    time, voltage, current, warm = cell()
    return table(time, voltage, current, 1.8 * warm + 32.0, head=HEAD)


@kind("a cell's current 5 % too large, with a bound of 6 %", (*BATTERY, "--current-gain", "0.06"), AH, capacity)
def battery_gain_told():
    time, voltage, current, warm = cell()
    return table(time, voltage, 1.05 * current, warm, head=HEAD)


@kind("a cell's time that runs backwards", BATTERY, AH, capacity)
def battery_back():
    time, *others = cell()
    return table(np.where(time > 9000, time - 5000, time), *others, head=HEAD)


@kind("a cell's log of two rows", BATTERY, None, capacity)
def battery_two():
    return f"{HEAD}\n0,3.5,1,25\n1,3.5,1,25\n"


def of_steps(time, current):
    """Return the time since the step that each row belongs to began, where the row before it ended."""
    first = np.append(True, np.diff(np.sign(current)) != 0)
    begins = np.maximum.accumulate(np.where(first, np.append(0.0, time[:-1]), 0.0))
    return time - begins


def mapping(more=""):
    """Return a mapping of the columns of a cell, and of what stands below them."""
    return (
        "schema: hil/battery-log/1\ncolumns: {time: t, voltage: U, current: I, temperature: T, state: S}\n"
        'cell: {capacity: "1.0", lower: "3.0"}\n' + more
    )


STATES = "states: {charge: [C], discharge: [D], rest: [R]}\n"
MAPPED = ("battery", "FILE", "--mapping", mapping(STATES))
RUNS = (*BATTERY, "--time-restarts", "run")


def letters(current):
    """Return the states of a cell as letters."""
    return np.select([current > 0, current < 0], ["C", "D"], "R")


@kind("a cell's time per step", BATTERY, AH, capacity)
def battery_steps():
    time, voltage, current, warm = cell()
    return table(of_steps(time, current), voltage, current, warm, head=HEAD)


@kind("a cell's time per step, with --time-restarts", (*BATTERY, "--time-restarts", "step"), AH, capacity)
def battery_steps_said():
    return battery_steps()


@kind("two runs of a cell, one after the other, each from zero", RUNS, AH, capacity)
def battery_runs():
    return battery_even() + battery_even().removeprefix(f"{HEAD}\n")


@kind("a cell's current without a sign", BATTERY, AH, capacity)
def battery_unsigned():
    time, voltage, current, warm = cell()
    return table(time, voltage, np.abs(current), warm, head=HEAD)


@kind("a cell's current without a sign, with states", MAPPED, AH, capacity)
def battery_states():
    time, voltage, current, warm = cell()
    return table(time, voltage, np.abs(current), warm, letters(current), head=f"{HEAD},S")


@kind("a cell's states, one of them unknown to the mapping", MAPPED, AH, capacity)
def battery_unknown_state():
    return battery_states().replace(",R\n", ",P\n")


@kind(
    "a cell's states, charge and discharge swapped",
    (*MAPPED[:3], mapping("states: {charge: [D], discharge: [C], rest: [R]}\n")), AH, capacity,
)  # fmt: skip
def battery_mixed_states():
    return battery_states()


@kind(
    "a cell's states, the discharge labelled as a rest",
    (*MAPPED[:3], mapping("states: {charge: [C], rest: [R, D]}\n")), AH, capacity,
)  # fmt: skip
def battery_rest_flows():
    return battery_states()


@kind("a cell's voltage in mV", BATTERY, AH, capacity)
def battery_millivolts():
    time, voltage, current, warm = cell()
    return table(time, 1e3 * voltage, current, warm, head=HEAD)


@kind(
    "a cell's voltage in mV and current in mA, as the columns' names say",
    tuple({"U": "U_mV", "I": "I/mA"}.get(each, each) for each in BATTERY), AH, capacity,
)  # fmt: skip
def battery_named_units():
    time, voltage, current, warm = cell()
    return table(time, 1e3 * voltage, 1e3 * current, warm, head="t,U_mV,I/mA,T")


@kind("a cell's rest at 4.35 V, where 4.2 V is the limit", BATTERY, AH, capacity)
def battery_rest():
    time, voltage, current, warm = cell()
    return table(time, np.where((current == 0) & (voltage > 4.0), 4.35, voltage), current, warm, head=HEAD)


@kind("a cell whose voltage falls as its charge begins", BATTERY, AH, capacity)
def battery_negative():
    time, voltage, current, warm = cell()
    return table(time, voltage - 0.15 * np.abs(current), current, warm, head=HEAD)


@kind("a cell's discharges only", BATTERY, AH, capacity)
def battery_discharges():
    time, voltage, current, warm = cell()
    kept = current <= 0
    return table(*(each[kept] for each in (time, voltage, current, warm)), head=HEAD)


@kind("a cell's current with an offset of 30 mA", BATTERY, AH, capacity)
def battery_offset():
    time, voltage, current, warm = cell()
    return table(time, voltage, current + 0.03, warm, head=HEAD)


@kind("a cell's current 30 % too large", BATTERY, AH, capacity)
def battery_gain():
    time, voltage, current, warm = cell()
    return table(time, voltage, 1.3 * current, warm, head=HEAD)


@kind("a cell's voltage of 1e300 in one row", BATTERY, AH, capacity)
def battery_huge():
    time, voltage, current, warm = cell()
    return table(time, np.where(time == 3000, 1e300, voltage), current, warm, head=HEAD)


@kind("a cell's current of 1e-200 A", BATTERY, AH, capacity)
def battery_tiny():
    time, voltage, current, warm = cell()
    return table(time, voltage, 1e-200 * current, warm, head=HEAD)


@kind("a cell's voltage that never changes", BATTERY, AH, capacity)
def battery_still():
    time, _, current, warm = cell()
    return table(time, np.full(time.size, 3.7), current, warm, head=HEAD)


@kind("a cell's current that is always zero", BATTERY, AH, capacity)
def battery_idle():
    time, voltage, current, warm = cell()
    return table(time, voltage, 0.0 * current, warm, head=HEAD)


@kind("a cell's log with decimal commas, and a line of units", BATTERY, AH, capacity)
def battery_commas():
    return battery_even().replace(",", ";").replace(".", ",").replace("T\n", "T\ns;V;A;\n", 1)


@kind("a cell's last row truncated within its voltage", BATTERY, AH, capacity)
def battery_torn():
    return battery_even() + "17400,3.2"


@kind("a cell's log followed by zero bytes", BATTERY, AH, capacity)
def battery_zeros():
    return battery_even().encode() + bytes(300)


@kind("a cell's rows duplicated", BATTERY, AH, capacity)
def battery_twice():
    return f"{HEAD}\n" + "".join(2 * line for line in battery_even().splitlines(keepends=True)[1:])


@kind("a cell's voltage and current swapped", BATTERY, AH, capacity)
def battery_mixed_up():
    time, voltage, current, warm = cell()
    return table(time, current, voltage, warm, head=HEAD)


@kind("a cell's voltage and current swapped half way", BATTERY, AH, capacity)
def battery_swaps():
    time, voltage, current, warm = cell()
    late = time >= 9000
    return table(time, np.where(late, current, voltage), np.where(late, voltage, current), warm, head=HEAD)


@kind("a cell's repeated hour at the end of summer time", BATTERY, AH, capacity)
def battery_summer():
    time, *others = cell()
    return table([f"2026-10-25T{_clock(3600 + s - 3600 * (s >= 7200))}" for s in time], *others, head=HEAD)


@kind("a cell's current clipped at 0.6 A", BATTERY, AH, capacity)
def battery_clipped():
    time, voltage, current, warm = cell()
    return table(time, voltage, np.clip(current, -0.6, 0.6), warm, head=HEAD)


@kind("a cell's temperature missing", BATTERY, AH, capacity)
def battery_cold():
    return "".join(line.rpartition(",")[0] + ",\n" for line in battery_even().splitlines()).replace("I,", "I,T", 1)


DRIFT = ("drift", "FILE", "--time", "1", "--temperature", "2", "--columns", "3", "--unit", "deg/s")
PER_KELVIN = 0.01


def slope(document):
    """Return the drift of every axis in the first fragment."""
    return [axis["slope"] for axis in document["fragments"][0]["axes"]]


def warmed():
    """Return time, temperature and rate of a sensor that heats by 30 K in 10 min, and cools again."""
    time = times(1200, 2.0)
    warm = 25.0 + 30.0 * np.sin(np.pi * time / 600.0)
    return time, warm, PER_KELVIN * (warm - 25.0) + noise(1200, sigma=0.01)


@kind("a drift of 0.01 deg/s/K, no damage", DRIFT, PER_KELVIN, slope)
def drift_even():
    return table(*warmed(), head="t,T,x")


@kind("a drift over kelvin", DRIFT, None, slope)
def drift_kelvin():
    time, warm, values = warmed()
    return table(time, warm + 273.15, values, head="t,T,x")


@kind("a drift over Fahrenheit, as the column's name says", DRIFT, None, slope)
def drift_fahrenheit():
    time, warm, values = warmed()
    return table(time, 1.8 * warm + 32.0, values, head="t,temp_F,x")


@kind("a drift over raw counts of a thermometer", DRIFT, None, slope)
def drift_counts():
    time, warm, values = warmed()
    return table(time, np.round(333.87 * (warm - 21.0)), values, head="t,T,x")


@kind("a drift over a thermometer that froze after two minutes", DRIFT, None, slope)
def drift_frozen():
    time, warm, values = warmed()
    return table(time, np.where(time < 120.0, warm, warm[240]), values, head="t,T,x")


@kind("a drift of a stuck axis", DRIFT, None, slope)
def drift_stuck():
    time, warm, values = warmed()
    return table(time, warm, 0.0 * values + 0.25, head="t,T,x")


@kind("a drift log truncated after a minute at one temperature", DRIFT, None, slope)
def drift_torn():
    time, warm, values = warmed()
    return table(time[:120], warm[:120] * 0.01 + 24.0, values[:120], head="t,T,x")


@kind("a drift with two gaps; the first fragment", DRIFT, PER_KELVIN, slope)
def drift_gaps():
    keep = np.r_[0:300, 420:800, 820:1200]
    return table(*(each[keep] for each in warmed()), head="t,T,x")


@kind("a drift with one reading of 25 deg/s", DRIFT, None, slope)
def drift_spike():
    time, warm, values = warmed()
    values[700] = 25.0
    return table(time, warm, values, head="t,T,x")


LAMP = ("photodiode", "FILE", "--reading", "reading", "--unit", "V", "--temperature", "temp", "--load-column", "load")
MONITORED = (*LAMP, "--light", "light")
IDEALITY = 1.25


def lamp_readings(**truth):
    """Return readings [V], temperatures [degC], loads [ohm] and light of a photodiode over temperature."""
    volts, degrees, loads, light, _ = photodiode_readings.campaign(17, count=450, **truth)
    return volts, degrees, loads, light


def lamp_table(volts, degrees, loads, light, head="reading,temp,load,light"):
    return table(volts, degrees, loads, light, head=head)


def ideality(document):
    """Return the ideality factor."""
    return [document["ideality"]]


@kind("a photodiode over temperature, no damage", MONITORED, IDEALITY, ideality)
def lamp_good():
    return lamp_table(*lamp_readings())


@kind("a photodiode whose lamp wanders by 4 %, with a monitor", MONITORED, IDEALITY, ideality)
def lamp_monitored():
    return lamp_table(*lamp_readings(monitor=0.02))


@kind("a photodiode whose lamp wanders by 4 %, without one", LAMP, IDEALITY, ideality)
def lamp_unmonitored():
    return lamp_table(*lamp_readings(monitor=0.02))


@kind("a photodiode whose lamp loses a tenth of its light", MONITORED, IDEALITY, ideality)
def lamp_droops():
    volts, degrees, loads, light = lamp_readings()
    return lamp_table(volts, degrees, loads, light * np.linspace(1.0, 0.9, light.size))


@kind("a photodiode over kelvin", MONITORED, IDEALITY, ideality)
def lamp_kelvin():
    volts, degrees, loads, light = lamp_readings()
    return lamp_table(volts, degrees + 273.15, loads, light)


@kind("a photodiode over Fahrenheit", MONITORED, IDEALITY, ideality)
def lamp_fahrenheit():
    volts, degrees, loads, light = lamp_readings()
    return lamp_table(volts, 1.8 * degrees + 32.0, loads, light)


@kind("a photodiode in mV, labelled V", MONITORED, IDEALITY, ideality)
def lamp_millivolts():
    volts, degrees, loads, light = lamp_readings()
    return lamp_table(1e3 * volts, degrees, loads, light)


@kind("a shorted photodiode", MONITORED, IDEALITY, ideality)
def lamp_shorted():
    volts, degrees, loads, light = lamp_readings()
    return lamp_table(1e-4 * volts, degrees, loads, light)


@kind("a photodiode whose thermometer lags by 50 readings", MONITORED, IDEALITY, ideality)
def lamp_lags():
    volts, degrees, loads, light = lamp_readings()
    return lamp_table(volts, np.roll(degrees, 50), loads, light)


@kind("a photodiode at one load", MONITORED, IDEALITY, ideality)
def lamp_one_load():
    parts = lamp_readings()
    return lamp_table(*(each[parts[2] == photodiode_readings.LOADS[0]] for each in parts))


@kind("a photodiode with a reading that is not a number", MONITORED, IDEALITY, ideality)
def lamp_torn():
    volts, degrees, loads, light = lamp_readings()
    volts[700] = math.nan
    return lamp_table(volts, degrees, loads, light)


def all_said() -> dict[str, Said]:
    """Return what the commands say to every kind."""
    with tempfile.TemporaryDirectory() as folder:
        return {name: said(ugly, Path(folder)) for name, ugly in KINDS.items()}


def page(everything: dict[str, Said]) -> str:
    """Return the page: a row for each kind, with what the command says."""
    lines = [
        "# Ugly logs",
        "",
        "The findings of `hil analyse` on damaged logs, and on logs that are not what they seem. Each kind is a",
        "generated file with a known truth: white noise of 0.01 deg/s/sqrt(Hz) at 100 Hz unless stated otherwise.",
        "There are three outcomes: a *value* within its uncertainty of the truth; a *flag*: the coefficients are",
        "inconclusive, not observable or rejected; or an *error*. A test runs every kind and compares it with",
        "this table, which `python tests/support/ugly_logs.py` writes.",
        "",
        "Some errors leave no trace in a log:",
        "",
        "- A gain between 0.93 and 1.1. Capacities, sensitivities and noise of good parts differ by as much. Only",
        "  a calibration of the instrument shows it: give its bound with `--current-gain`, or the uncertainty of",
        "  the rates with `--rate-uncertainty`, and the interval includes it.",
        "- Fahrenheit below 85 in a table of temperatures, or below 65 in a log of a cell, if no column name says",
        "  so: these are plausible temperatures in degC as well.",
        "- Outliers of 4 to 6 standard deviations, fewer than one in 200, in a record of a few thousand samples:",
        "  pure noise occasionally has such heavy tails. White noise reads up to 9 % too high.",
        "- A sample counter given as the time, in a table without column names: one sample per second is just as",
        "  likely. A note says so.",
        "- Sensors with the same offset that alternate in one column: white noise is too small by the square root",
        "  of their number.",
        "- A converter's reference voltage that is wrong by 5 %: voltages and currents of a photodiode are wrong",
        "  together. Measure it, and give `--reference-uncertainty`.",
        "",
        "| log | command | outcome | findings |",
        "|---|---|---|---|",
    ]
    for name, found in everything.items():
        options = " ".join(
            "MAPPING" if each.startswith("schema:") else each for each in KINDS[name].command if each != "FILE"
        )
        sentence = found.sentence.replace("|", "\\|") or "nothing"
        lines.append(f"| {KINDS[name].title} | `{options}` | {found.outcome} | {sentence} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(all_said()), encoding="utf-8")
