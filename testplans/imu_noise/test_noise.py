"""Noise of gyroscopes and magnetometers at rest: every axis of two units of each model, and their ranking."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

from hil.analysis import Column, agreement, as_csv, characterise, not_observable, psd, rank, relative_deviation
from hil.plan import Curve

GYROSCOPES = {"bno": "BNO055", "lsm": "LSM9DS1", "icm": "ICM-20948", "bmi": "BMI088"}
MAGNETOMETERS = {"bno": "BNO055", "lsm": "LSM9DS1", "icm": "ICM-20948", "lis": "LIS3MDL"}
GYROSCOPE_WHITE = {"bno": "IMU-NOI-011", "lsm": "IMU-NOI-012", "icm": "IMU-NOI-013", "bmi": "IMU-NOI-014"}
MAGNETOMETER_WHITE = {"bno": "IMU-NOI-015", "lsm": "IMU-NOI-016", "icm": "IMU-NOI-017", "lis": "IMU-NOI-018"}


def characterised(samples, rested):
    """Return the coefficients of an axis by parameter, its Allan model, and why they cannot be trusted.

    Of a record in which samples are no numbers (at a rail, or marked invalid), nothing is concluded, and there is no
    model. The agreement is the deviation of the spectrum's white noise from that of the Allan deviation. Both are
    two-sided, as IEEE Std 952 has them, while the density of the spectrum is one-sided.
    """
    unit, doubts = rested.unit, list(rested.doubts)
    if not np.isfinite(samples).all():
        white, walk = f"{unit}/sqrt(Hz)", f"{unit}*sqrt(Hz)"
        units = {"white_noise": white, "flicker": unit, "random_walk": walk, "psd_agreement": "1"}
        return {name: not_observable(each) for name, each in units.items()}, None, doubts
    model = characterise(samples, rested.rate, unit, bandwidth=rested.filtered)
    spectrum = psd(samples, rested.rate, unit, bandwidth=rested.filtered)
    figures = {
        "white_noise": model.white,
        "flicker": model.flicker,
        "random_walk": model.random_walk,
        "psd_agreement": relative_deviation(model.white, spectrum.white).relative,
    }
    return figures, model, [*doubts, *agreement(spectrum, model).doubts()]


class Campaign:
    """What was found of one kind of sensor, by axis; its checks, and what stands on the first page of the report.

    Args:
        role: `gyroscope` or `magnetometer`.
        unit: of its axes.
        models: the models by the instance of their first unit.
        white: the requirement on the white noise of each model.
        others: the requirements on slow noise, deviation of the units' white noise, agreement with the spectrum, rank,
            and deviation of the units' flicker.
    """

    def __init__(self, role, unit, models, white, others):
        self.role, self.unit, self.models, self.white_of = role, unit, models, white
        self.slow, self.between, self.cross, self.ranked, self.slow_between = others
        self.white, self.flicker, self.doubts = {}, {}, {}

    def run(self, sensors, resting, check, chart, step, parameters):
        """Record and judge one model after the other; only figures stay of what was recorded."""
        with step(f"Put every {self.role} to sleep, so that only those that are recorded run"):
            for name in self.models:
                for unit in (name, f"{name}2"):
                    getattr(sensors, unit).stop()
        for name, model in self.models.items():
            with step(f"Record the {self.role} of two {model} at rest"):
                rested = resting.record(
                    [getattr(sensors, name), getattr(sensors, f"{name}2")],
                    rate=getattr(parameters, f"{self.role}_{name}_rate"),
                    density=parameters.in_unit(f"{self.role}_{name}_density", f"{self.unit}/sqrt(Hz)"),
                    settling=parameters.settling,
                    duration=parameters.rest_duration,
                )
            with step(f"Characterise each axis of the {model}"):
                for each in rested:
                    self.judge(each, name, check, chart)
            with step(f"Compare the two units of the {model}"):
                self.compare(name, check, chart)

    def judge(self, rested, name, check, chart):
        """Check what the record of one unit tells of its axes, and draw their deviations."""
        curves, model = [], self.models[name]
        asked = {
            "white_noise": (self.white_of[name], f"White noise, {self.role} of the {model}"),
            "flicker": (self.slow, ""),
            "random_walk": (self.slow, ""),
            "psd_agreement": (self.cross, "Spectrum against Allan deviation"),
        }
        for axis, samples in rested.axes():
            figures, found, doubts = characterised(samples, rested)
            self.white[axis], self.flicker[axis] = figures["white_noise"], figures["flicker"]
            self.doubts[axis] = doubts
            for parameter, (requirement, headline) in asked.items():
                told = f"{model}, {axis}"
                check(requirement, parameter, figures[parameter], of=axis, doubts=doubts, at=told, headline=headline)
            if found is not None:
                short = axis.removeprefix(f"{self.role}.")
                curves.append(Curve(name=short, x=found.curve.tau, y=found.curve.figures, model=found.line))
        if curves:
            chart(
                f"Allan deviation at rest: {self.role} of the {model}",
                *curves,
                x=("averaging time", "s"),
                y=("Allan deviation", rested.unit),
                log=True,
                limit=(self.white_of[name], "white_noise"),
                limit_power=-0.5,
            )

    def compare(self, name, check, chart):
        """Check by how much the second unit deviates from the first, and say whether that means anything."""
        found = []
        for axis in "xyz":
            first, second = f"{self.role}.{name}.{axis}", f"{self.role}.{name}2.{axis}"
            doubts = [*self.doubts[first], *self.doubts[second]]
            for parameter, figures, requirement, headline in (
                ("white_noise", self.white, self.between, "Second unit against the first"),
                ("flicker", self.flicker, self.slow_between, ""),
            ):
                deviation = relative_deviation(figures[first], figures[second])
                said = f"{self.models[name]}, axis {axis}: {deviation.remark}"
                unknown = [] if math.isfinite(deviation.relative.value) else [deviation.remark]
                check(
                    requirement,
                    f"{parameter}_unit_deviation",
                    deviation.relative,
                    of=first,
                    doubts=[*doubts, *unknown],
                    at=said,
                    headline=headline,
                )
                if parameter == "white_noise":
                    found.append(deviation.relative)
        places = [3.0 * list(self.models).index(name) + axis for axis in (0.7, 1.0, 1.3)]
        chart(
            f"White noise of the second units against the first: {self.role}",
            Curve(name=self.models[name], x=places, y=found),
            x=("axes x, y, z of each model", "1"),
            y=("relative deviation", "1"),
            limit=(self.between, "white_noise_unit_deviation"),
        )

    def order(self, check, chart, artifact):
        """Rank the axes of the first units by their white noise, and keep the table."""
        firsts = [f"{self.role}.{name}.{axis}" for name in self.models for axis in "xyz"]
        ranking = rank({axis: self.white[axis] for axis in firsts}, doubts={axis: self.doubts[axis] for axis in firsts})
        artifact(f"ranking-{self.role}.csv", self.table(ranking))
        artifact(f"ranking-{self.role}.json", json.dumps(self.document(ranking), indent=1) + "\n")
        places = {place.name: place for place in ranking.places}
        for axis in firsts:
            told, place = f"{self.models[axis.split('.')[1]]}, {axis}", places.get(axis)
            if place is None:
                why = [ranking.unranked[axis]]
                check(self.ranked, "white_noise_rank", not_observable("1"), of=axis, doubts=why, at=told)
                continue
            ties = f", tied with {' '.join(place.ties)}" if place.ties else ""
            said = f"{told}: place {place.said} of {len(places)}{ties}"
            check(self.ranked, "white_noise_rank", place.rank, of=axis, at=said)
        curves = [
            Curve(
                name=model,
                x=[float(number) for number, place in enumerate(ranking.places, 1) if place.name.split(".")[1] == name],
                y=[place.figure for place in ranking.places if place.name.split(".")[1] == name],
            )
            for name, model in self.models.items()
        ]
        if ranking.places:
            chart(
                f"White noise in order: {self.role}, first units",
                *curves,
                x=("place of the axis", "1"),
                y=("white noise", ranking.places[0].figure.unit),
            )

    def rows(self, ranking):
        """Give one row for each axis: place, model, axis, white noise and flicker with uncertainties, ties, remark."""
        places = {place.name: place for place in ranking.places}
        for axis in (*places, *ranking.unranked):
            white, flicker, place = self.white[axis], self.flicker[axis], places.get(axis)
            yield {
                "place": place.said if place else "",
                "model": self.models[axis.split(".")[1]],
                "axis": axis,
                "white_noise": white.value,
                "white_noise_uncertainty": white.uncertainty,
                "flicker": flicker.value,
                "flicker_uncertainty": flicker.uncertainty,
                "flicker_status": flicker.status.value,
                "ties": list(place.ties) if place else [],
                "remark": ranking.unranked.get(axis, ""),
            }

    def table(self, ranking):
        """Return the ranking as comma-separated text."""
        unit = next(iter(self.white.values())).unit
        plain = next(iter(self.flicker.values())).unit
        number = {"form": ".6g", "missing": ""}
        columns = [
            Column("place"),
            Column("model"),
            Column("axis"),
            Column("white noise", unit, **number),
            Column("standard uncertainty", unit, **number),
            Column("flicker", plain, **number),
            Column("standard uncertainty", plain, **number),
            Column("status of the flicker"),
            Column("tied with"),
            Column("remark"),
        ]
        rows = [
            [" ".join(value) if isinstance(value, list) else cleaned(value) for value in row.values()]
            for row in self.rows(ranking)
        ]
        return as_csv(columns, rows)

    def document(self, ranking):
        """Return the ranking for machines; numbers that are none are null."""
        rows = [{name: told(value) for name, value in row.items()} for row in self.rows(ranking)]
        units = {"white_noise": next(iter(self.white.values())).unit, "flicker": next(iter(self.flicker.values())).unit}
        return {"sensors": self.role, "confidence": ranking.confidence, "units": units, "rows": rows}


def cleaned(value):
    """Return what a cell of a table without quotes can hold."""
    if value is None:
        return math.nan
    return value.replace(",", ";").replace('"', "'") if isinstance(value, str) else value


def told(value):
    """Return what JSON can hold, and a number to digits that do not depend on the order of sums."""
    if not isinstance(value, float):
        return value
    return float(f"{value:.9g}") if math.isfinite(value) else None


@pytest.mark.requirement(
    "IMU-NOI-001", *GYROSCOPE_WHITE.values(), "IMU-NOI-021", "IMU-NOI-031", "IMU-NOI-041", "IMU-NOI-051", "IMU-NOI-061"
)
@pytest.mark.max_duration(100000)
@pytest.mark.repeatable("a sensor at rest is the same before and after an interruption")
def test_gyroscopes(gyroscope, resting, check, chart, step, artifact, parameters):
    """Allan deviation and spectrum of every gyroscope axis over four hours at rest, two units of each model."""
    others = ("IMU-NOI-021", "IMU-NOI-031", "IMU-NOI-041", "IMU-NOI-051", "IMU-NOI-061")
    campaign = Campaign("gyroscope", "deg/s", GYROSCOPES, GYROSCOPE_WHITE, others)
    campaign.run(gyroscope, resting, check, chart, step, parameters)
    with step("Put the axes in order"):
        campaign.order(check, chart, artifact)


@pytest.mark.requirement(
    "IMU-NOI-002",
    *MAGNETOMETER_WHITE.values(),
    "IMU-NOI-022",
    "IMU-NOI-032",
    "IMU-NOI-042",
    "IMU-NOI-052",
    "IMU-NOI-062",
)
@pytest.mark.max_duration(130000)
@pytest.mark.repeatable("a sensor at rest is the same before and after an interruption")
def test_magnetometers(magnetometer, resting, check, chart, step, artifact, parameters):
    """Allan deviation and spectrum of every magnetometer axis over four hours at rest, two units of each model."""
    others = ("IMU-NOI-022", "IMU-NOI-032", "IMU-NOI-042", "IMU-NOI-052", "IMU-NOI-062")
    campaign = Campaign("magnetometer", "uT", MAGNETOMETERS, MAGNETOMETER_WHITE, others)
    campaign.run(magnetometer, resting, check, chart, step, parameters)
    with step("Put the axes in order"):
        campaign.order(check, chart, artifact)
