"""Calibrations of the gyroscope by the plan's own case, on twins of the bench `adcs` whose truth differs by seed.

The bytes are those of a run: OBC link, gyroscope, temperature controller, relay board and rotation table through their
drivers and peers. What is left out is the executive.
"""

from __future__ import annotations

import importlib.util
import re
import sys
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
from workspaces import ROOT

from hil.analysis.gyroscope.calibration import Calibration
from hil.analysis.gyroscope.interchange import from_json
from hil.bench.binding import bind_simulated
from hil.bench.file.reading import load_bench
from hil.clock.port import NANOSECONDS
from hil.model.figure import Figure
from hil.requirements.parameters import load_parameters
from hil.wire.transcript import Transcript

__all__ = ["AXES", "PLAN", "Campaign", "GyroscopeTruth", "Parts", "RateError", "as_built", "campaign", "quiet"]

AXES = "xyz"
PLAN = ROOT / "testplans/gyroscope"

_REFERENCE = 25.0
_MIXED = ((0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1))
_SHORT = {"soak": 30.0, "static_duration": 10.5, "turning_duration": 13.3}
_BENCH_CLOCK = 1e-4
"""Standard uncertainty that `fixtures/rotation.py` states of the bench's clock, relative."""
_QUICK_CHAMBER = {"die_capacity": "1"}
"""A die that follows its board within seconds; the bench's takes minutes, and the case waits for it."""


@dataclass(frozen=True)
class GyroscopeTruth:
    """What one gyroscope really is, drawn by seed; every second one has a bias quadratic in temperature.

    Attributes:
        bias: coefficients over the die's temperature above 25 degC, by axis [deg/s, deg/s/K, deg/s/K^2].
        scale: relative error of the scale, likewise.
        misalignment: how much of the second axis' rate the first one sees [rad], xy, xz, yx, yz, zx, zy.
        temperature_offset: by how much the sensor's own thermometer is too high [K].
        odr_error: relative error of the oscillator.
    """

    bias: Mapping[str, tuple[float, float, float]]
    scale: Mapping[str, tuple[float, float, float]]
    misalignment: tuple[float, ...]
    temperature_offset: float
    odr_error: float

    @classmethod
    def drawn(cls, seed: int) -> GyroscopeTruth:
        """Return the truth of one seed; sizes are those of the bench file."""
        draw = np.random.default_rng([2021, seed])
        curved = seed % 2 == 0

        def signed(low: float, high: float) -> float:
            return float(draw.choice([-1.0, 1.0]) * draw.uniform(low, high))

        return cls(
            bias={
                axis: (signed(0, 0.5), signed(5e-4, 0.014), signed(1.5e-4, 3e-4) if curved else 0.0) for axis in AXES
            },
            scale={axis: (signed(0, 0.01), signed(0, 2e-4), 0.0) for axis in AXES},
            misalignment=tuple(draw.uniform(-0.004, 0.004, 6).tolist()),
            temperature_offset=signed(0, 0.5),
            odr_error=signed(0, 0.006),
        )

    @property
    def mixing(self) -> np.ndarray:
        """What each axis (row) sees of rates about the axes, shape (3, 3)."""
        mixing = np.eye(3)
        for place, share in zip(_MIXED, self.misalignment, strict=True):
            mixing[place] = share
        return mixing

    def bias_at(self, axis: str, told: float) -> float:
        """Return the bias [deg/s] where the sensor tells this temperature [degC]."""
        return self._at(self.bias[axis], told)

    def gain_at(self, axis: str, told: float) -> float:
        """Return reading per rate where the sensor tells this temperature [degC]."""
        return 1.0 + self._at(self.scale[axis], told)

    def remaining(self, found: Calibration, axis: str, rate: float, told: float) -> float:
        """Return by how much a calibration is off [deg/s] at a rate about one axis, without noise."""
        rates = np.zeros(3)
        rates[AXES.index(axis)] = rate
        return float(found.correct(self.reading(rates, told), told)[axis]) - rate

    def reading(self, rates: np.ndarray, told: float) -> dict[str, float]:
        """Return what the sensor says without noise, by axis [deg/s], for rates about its axes, shape (3,)."""
        seen = self.mixing @ rates
        return {
            axis: self.gain_at(axis, told) * float(seen[place]) + self.bias_at(axis, told)
            for place, axis in enumerate(AXES)
        }

    def as_peer(self) -> dict[str, object]:
        """Return it as the truth section of the peer."""
        polynomials = {f"bias_{axis}": self.bias[axis] for axis in AXES}
        polynomials |= {f"scale_{axis}": self.scale[axis] for axis in AXES} | {"misalignment": self.misalignment}
        numbers = {"temperature_offset": self.temperature_offset, "odr_error": self.odr_error}
        written: dict[str, object] = {name: [f"{each:.12f}" for each in row] for name, row in polynomials.items()}
        return written | {name: f"{number:.12f}" for name, number in numbers.items()}

    def _at(self, coefficients: tuple[float, float, float], told: float) -> float:
        warmer = told - self.temperature_offset - _REFERENCE
        return sum(each * warmer**power for power, each in enumerate(coefficients))


@dataclass(frozen=True)
class Parts:
    """The workspace's own case and fixtures, loaded by path as the executive does."""

    case: object
    noise: object
    chamber: object
    rotation: object

    @classmethod
    def loaded(cls, monkeypatch) -> Parts:
        """Load them, until the end of the tests that asked."""

        def load(name, path):
            spec = importlib.util.spec_from_file_location(f"closure_{name}", ROOT / path)
            module = importlib.util.module_from_spec(spec)
            monkeypatch.setitem(sys.modules, spec.name, module)
            spec.loader.exec_module(module)
            return module

        return cls(
            load("case", "testplans/gyroscope/test_calibration.py"),
            load("noise", "testplans/gyroscope/test_noise.py"),
            load("chamber", "fixtures/chamber.py"),
            load("rotation", "fixtures/rotation.py"),
        )


@dataclass(frozen=True)
class RateError:
    """One rate error that the case stated: of an axis, at a rate [deg/s] and the sensor's temperature [degC]."""

    figure: Figure
    axis: str
    rate: float
    told: float


@dataclass(frozen=True)
class Campaign:
    """One calibration and its truth.

    Attributes:
        truth: what the gyroscope is.
        found: the calibration that the case exported.
        errors: the rate errors that the case stated when it verified.
    """

    truth: GyroscopeTruth
    found: Calibration
    errors: tuple[RateError, ...]


def quiet(seed: int):
    """Return the bench with white noise alone, an Earth that does not turn, and a true mounting; and its parameters.

    So what is stated has to be exact, neither too small nor too large.
    """
    still = {"earth_rate": "0", "ripple": "0", "tilt": ["0", "0"]}
    bench = _bench(seed, {"flicker": ["0"] * 3, "random_walk": ["0"] * 3}, still)
    nothing = dict.fromkeys(("earth_rate", "bias_instability", "bias_random_walk", "mounting"), 0.0)
    return bench, {**nothing, "verification_rates": (), "turning_duration": 6.7}


def as_built(seed: int):
    """Return the bench with all that its file says of noise, and what nobody measures drawn by seed as it is stated.

    The mounting and the bench's clock from normal distributions of the standard uncertainties that the plan and the
    fixture state, the direction of the Earth's axis from all directions, the table's angle from a whole turn. What the
    certificate of the encoder leaves open is 5e-6 of the rate, and not drawn.
    """
    draw = np.random.default_rng([2022, seed])
    tilt = [f"{each:.9f}" for each in draw.normal(0.0, _plan()["mounting"], 2)]
    table = {
        "tilt": tilt,
        "angle": f"{draw.uniform(0, 360):.3f}",
        "latitude": f"{np.degrees(np.arcsin(draw.uniform(-1, 1))):.6f}",
        "slow_clock": f"{draw.normal(0.0, _BENCH_CLOCK):.9f}",
    }
    return _bench(seed, {}, table), {"verification_rates": (-20.0,)}


def _plan() -> dict[str, object]:
    return {each.name: each.value for each in load_parameters(ROOT, PLAN).rows()}


def campaign(seed: int, twin, parts: Parts) -> Campaign:
    """Run the case on the twin of one seed, `quiet` or `as_built`, with shortened recordings."""
    bench, changes = twin(seed)
    try:
        files, errors = _run(bench, parts, SimpleNamespace(**{**_plan(), **_SHORT, **changes}))
    finally:
        bench.close()
    return Campaign(GyroscopeTruth.drawn(seed), from_json(files["calibration.json"]), tuple(errors))


def _bench(seed: int, noise: Mapping[str, object], table: Mapping[str, object]):
    spec = load_bench(ROOT / "fixtures/benches", "adcs", ROOT)
    truths = {"gyro1": {**GyroscopeTruth.drawn(seed).as_peer(), **noise}, "table": table, "chamber": _QUICK_CHAMBER}

    def told(part, name):
        return replace(part, truth={**part.truth, **truths.get(name, {})})

    twin = spec.simulated
    plants = tuple(told(plant, plant.name) for plant in twin.plants)
    peers = tuple(told(peer, peer.device) for peer in twin.peers)
    return bind_simulated(
        replace(spec, simulated=replace(twin, seed=seed, plants=plants, peers=peers)), Transcript(None)
    )


def _run(bench, parts: Parts, parameters) -> tuple[dict[str, str], list[RateError]]:
    """Run the case; return its files and its rate errors."""
    files: dict[str, str] = {}
    errors: list[RateError] = []

    def check(_requirement, parameter, value, *, of="", at="", **_rest):
        if parameter == "rate_error":
            rate, told = re.search(r", (\S+) deg/s, (\S+) degC", at).groups()
            errors.append(RateError(value, of, float(rate), float(told)))

    def record(_name, role, *, duration, rate):
        return _Taken(role, bench.clock, duration, rate)

    gyroscope = bench.roles["gyroscope"]
    gyroscope.start()
    parts.case.test_calibration(
        chamber=parts.chamber.Chamber("tec1", bench.roles["thermal"], bench.roles["relays"], bench.clock),
        rotation=parts.rotation.Rotation(bench.roles["rotation_table"], _Operator(bench.person)),
        rate_sensor=gyroscope,
        doubts_of=lambda _recording: [],
        record=record,
        check=check,
        chart=lambda *_curves, **_axes: None,
        step=lambda _title: nullcontext(),
        artifact=files.__setitem__,
        parameters=parameters,
    )
    return files, errors


class _Operator:
    """Asks the simulated person."""

    def __init__(self, person) -> None:
        self._person = person

    def connect(self, what, text, *, name, options):
        """Let the person mount the board."""
        return self._person.answer("connect", name, text, (what, *(each for each in options if each != what)))

    def confirm(self, text, *, name):
        """Let the person agree."""
        return self._person.answer("confirm", name, text)


class _Taken(dict):
    """A streamed recording as the case sees it."""

    def __init__(self, role, clock, duration, rate) -> None:
        role.begin(rate)
        pause_ns = round(role.longest_pause * NANOSECONDS)
        blocks, first, enough = [], None, False
        while not enough:
            clock.wait_until(clock.now_ns() + pause_ns)
            block = role.drain()
            if len(block):
                first = block[0, 0] if first is None else first
                wanted = block[block[:, 0] - first <= duration + 0.5 / rate]
                blocks.append(wanted)
                enough = len(wanted) < len(block)
        self.stream = role.end()
        rows = np.concatenate(blocks)
        self.time, self.rate = rows[:, 0], rate
        super().__init__(zip((channel.name for channel in role.channels()), rows[:, 1:].T, strict=True))

    def unit(self, channel):
        """Return the channel's unit."""
        return "degC" if channel == "temperature" else "deg/s"
