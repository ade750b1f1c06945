"""Logs of a magnetometer in somebody's hand, by what is wrong with them: readings [uT] from a seed."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

__all__ = ["BIAS", "FIELD", "GAIN", "KINDS", "Kind"]

FIELD = 48.7  # uT
BIAS = np.array([-21.4, 35.2, 8.9])
_GAIN = np.array([[1.08, 0.03, -0.02], [0.03, 0.93, 0.04], [-0.02, 0.04, 1.01]])
GAIN = _GAIN / np.cbrt(np.linalg.det(_GAIN))
NOISE = 0.4

Kind = Callable[[np.random.Generator], np.ndarray]
KINDS: dict[str, Kind] = {}
"""What is wrong, and what makes readings (n, 3) of it."""


def kind(title):
    """Register what makes such a log."""

    def register(made):
        KINDS[title] = made
        return made

    return register


def turned(vector):
    """Rotation matrix of a vector [rad]."""
    angle = np.linalg.norm(vector)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def tumbled(generator, count=3000, rate=50.0, speed=90.0):
    """Directions of a hand that turns smoothly about axes that wander, at a speed in deg/s rms."""
    attitude, spin, found = np.eye(3), generator.standard_normal(3), np.empty((count, 3))
    fades = np.exp(-1.0 / (1.5 * rate))
    for place in range(count):
        spin = fades * spin + np.sqrt(1.0 - fades**2) * generator.standard_normal(3)
        attitude = attitude @ turned(np.radians(speed) * spin / rate / np.sqrt(3.0))
        found[place] = attitude[2]
    return found


def eights(count=3000, rate=100.0):
    """Directions of figures of eight, each in 2 s, by somebody who turns round slowly."""
    dip, found = np.radians(65.0), np.empty((count, 3))
    down = np.array([np.cos(dip), 0.0, -np.sin(dip)])
    for place in range(count):
        turn = 2.0 * np.pi * (place + 1) / rate
        heading, twist = turned(np.array([0.0, 0.0, turn / 17.0])), turned(np.array([0.0, 0.0, turn / 29.0]))
        pitch, roll = np.array([1e-9, 1.2 * np.sin(turn), 0.0]), np.array([1.9 * np.sin(turn / 2.0), 1e-9, 0.0])
        found[place] = (heading @ turned(pitch) @ turned(roll) @ twist).T @ down
    return found


def about_each_axis(count=3000):
    """Directions of two turns about each axis, one after the other, not quite level."""
    dip, parts = np.radians(65.0), []
    down = np.array([np.cos(dip), 0.0, -np.sin(dip)])
    for axis in range(3):
        base = np.eye(3)[:, [(axis + place) % 3 for place in range(3)]]
        for turn in np.linspace(0.0, 4.0 * np.pi, count // 3, endpoint=False):
            sway = turned(0.15 * np.array([np.sin(1.7 * turn), np.cos(1.1 * turn), 1e-9]))
            parts.append((base @ turned(np.array([1e-9, 1e-9, turn])) @ sway).T @ down)
    return np.array(parts)


def paused(generator, count=6000, rate=50.0, slow=3.0):
    """Directions of turns of a second, with pauses of some seconds in which the hand drifts by so many deg/s."""
    path, parts, left = tumbled(generator, count, rate, 160.0), [], count
    while left > 0:
        begin = len(parts) * int(rate)
        move = path[begin % (count - int(rate)) :][: int(rate)]
        axis = np.cross(move[-1], generator.standard_normal(3))
        turn = np.radians(slow) / rate * axis / np.linalg.norm(axis) + 1e-12
        steps = range(1, int(rate * generator.uniform(1.0, 3.0)))
        rests = [turned(each * turn) @ move[-1] for each in steps]
        parts.append(np.vstack([move, rests]))
        left -= len(parts[-1])
    return np.vstack(parts)[:count]


def read(generator, directions, noise=NOISE, field=FIELD):
    """Readings of directions."""
    size = np.broadcast_to(field, len(directions))[:, None]
    return size * directions @ np.linalg.inv(GAIN) + BIAS + noise * generator.standard_normal((len(directions), 3))


def healthy(generator, **how):
    """Readings of a tumbling hand."""
    return read(generator, tumbled(generator, **how))


@kind("a hand that tumbles it")
def _tumbled(generator):
    return healthy(generator)


@kind("figures of eight")
def _eights(generator):
    return read(generator, eights())


@kind("turns about each axis")
def _about_each_axis(generator):
    return read(generator, about_each_axis())


@kind("pauses, in steps of 0.15 uT")
def _paused(generator):
    return 0.15 * np.rint(read(generator, paused(generator), noise=0.35) / 0.15)


@kind("pauses at rest, with less noise than a step")
def _resting(generator):
    return 0.15 * np.rint(read(generator, paused(generator, slow=0.0), noise=0.1) / 0.15)


@kind("half a minute at half the speed")
def _short(generator):
    return healthy(generator, count=1500, speed=60.0)


@kind("ten minutes at 100 Hz")
def _long(generator):
    return (
        np.tile(tumbled(generator, 20_000, 100.0), (3, 1)) @ np.linalg.inv(GAIN) * FIELD
        + BIAS
        + (NOISE * generator.standard_normal((60_000, 3)))
    )


@kind("half of the sphere")
def _half(generator):
    directions = tumbled(generator, 6000)
    return read(generator, directions[directions[:, 2] > 0.0])


@kind("a cone of 70 deg")
def _cone(generator):
    directions = tumbled(generator, 9000)
    return read(generator, directions[directions[:, 1] > np.cos(np.radians(70.0))])


@kind("turns about the vertical alone")
def _level(generator):
    turn = np.linspace(0.0, 40.0, 3000)
    return read(generator, np.stack([0.45 * np.cos(turn), 0.45 * np.sin(turn), np.full(3000, -0.893)], axis=1))


@kind("two thirds of it lying on a table")
def _lying(generator):
    directions = tumbled(generator)
    return read(generator, np.vstack([np.repeat(directions[:1], 6000, axis=0), directions]))


@kind("rows that are lost")
def _lost(generator):
    kept = np.ones(3000, dtype=bool)
    for begin in generator.integers(0, 2900, 20):
        kept[begin : begin + generator.integers(3, 80)] = False
    return healthy(generator)[kept]


@kind("cells that are no numbers")
def _nan(generator):
    readings = healthy(generator)
    readings[generator.integers(0, 3000, 100), generator.integers(0, 3, 100)] = np.nan
    return readings


@kind("rows of zeros")
def _zeros(generator):
    readings = healthy(generator)
    readings[generator.random(3000) < 0.06] = 0.0
    return readings


@kind("rows that hold the last ones")
def _held(generator):
    readings = healthy(generator)
    for begin in generator.integers(1, 2900, 30):
        readings[begin : begin + generator.integers(2, 12)] = readings[begin - 1]
    return readings


@kind("every row twice")
def _twice(generator):
    return np.repeat(healthy(generator, count=1500), 2, axis=0)


@kind("spikes on one axis")
def _spikes(generator):
    readings = healthy(generator)
    wrong = generator.integers(0, 3000, 60), generator.integers(0, 3, 60)
    readings[wrong] += generator.choice([-1.0, 1.0], 60) * generator.uniform(5.0, 300.0, 60)
    return readings


@kind("broken words of 4789 uT")
def _words(generator):
    readings = healthy(generator)
    readings[generator.integers(0, 3000, 30)] = 32767 / 6.842
    return readings


@kind("broken words on one axis")
def _words_on_one_axis(generator):
    readings = healthy(generator)
    readings[generator.integers(0, 3000, 90), generator.integers(0, 3, 90)] = -32768 / 6.842
    return readings


@kind("a quarter of it disturbed")
def _disturbed(generator):
    readings = healthy(generator)
    wrong = generator.random(3000) < 0.25
    return readings + wrong[:, None] * 20.0 * generator.standard_normal((3000, 3))


@kind("an axis at its end")
def _clipped(generator):
    return np.minimum(healthy(generator), 80.0)


@kind("a motor that runs half of the time, 2 uT")
def _motor(generator):
    return healthy(generator) + (np.arange(3000) % 500 < 250)[:, None] * [1.2, -1.0, 1.2]


@kind("a motor that runs half of the time, 6 uT")
def _strong_motor(generator):
    return healthy(generator) + (np.arange(3000) % 500 < 250)[:, None] * [4.0, -3.0, 3.0]


@kind("a motor that runs in the second half")
def _late_motor(generator):
    return healthy(generator) + (np.arange(3000) >= 1500)[:, None] * [4.0, -3.0, 3.0]


@kind("a motor that runs for a second at times, 20 uT")
def _brief_motor(generator):
    return healthy(generator) + (np.arange(3000) % 600 < 50)[:, None] * [14.0, -10.0, 10.0]


@kind("a motor of 20 uT for a third of the time")
def _long_motor(generator):
    return healthy(generator) + (np.arange(3000) % 500 < 167)[:, None] * [14.0, -10.0, 10.0]


@kind("iron nearby at the beginning")
def _iron(generator):
    return healthy(generator) + 30.0 * np.exp(-np.arange(3000) / 100.0)[:, None] * [0.8, -0.4, 0.5]


@kind("a bias that drifts by 4 uT")
def _drifts(generator):
    return healthy(generator) + np.linspace(-2.0, 2.0, 3000)[:, None] * [1.0, 0.5, -1.0]


@kind("a field that comes and goes by 5 %")
def _comes_and_goes(generator):
    return read(generator, tumbled(generator), field=FIELD * (1.0 + 0.05 * np.sin(np.arange(3000) / 160.0)))


@kind("a field of another place in the second half")
def _another_place(generator):
    return read(generator, tumbled(generator), field=FIELD * (1.0 + 0.09 * np.tanh(np.arange(3000) / 300.0 - 5.0)))


@kind("a line of the mains")
def _mains(generator):
    return healthy(generator) + 2.0 * np.sin(2.0 * np.pi * 50.3 / 50.0 * np.arange(3000))[:, None] * [1.0, 0.0, 0.5]


@kind("noise that is filtered")
def _filtered(generator):
    readings, noise = read(generator, tumbled(generator), noise=0.0), np.zeros((3000, 3))
    for place in range(1, 3000):
        noise[place] = 0.98 * noise[place - 1] + 0.08 * generator.standard_normal(3)
    return readings + noise


@kind("an axis that lags by three samples")
def _lags(generator):
    readings = healthy(generator)
    readings[3:, 2] = readings[:-3, 2].copy()
    return readings


@kind("an axis that changes its sign")
def _sign(generator):
    return healthy(generator) * np.where(np.arange(3000) >= 1500, -1.0, 1.0)[:, None] ** [0.0, 1.0, 0.0]


@kind("two axes that are swapped half way")
def _swapped(generator):
    readings = healthy(generator)
    readings[1500:] = readings[1500:][:, [1, 0, 2]]
    return readings
