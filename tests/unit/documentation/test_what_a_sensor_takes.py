"""What a sensor costs, as its guide tells it: lines of source and of tests for each chip, and their limits."""

from __future__ import annotations

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[3]
GUIDE = ROOT / "docs/how-to/write-a-driver.md"
MOST_SOURCE, MOST_TESTS = 700, 150
PEERS = {"icm20948": ("icm20948", "ak09916"), "iim42652": ("iim42652", "iim42652_registers")}
CHIPS = ("bno055", "lsm9ds1", "icm20948", "bmi088", "lis3mdl", "iim42652", "bme680")


def lines(path):
    """Return how long a file is."""
    return len((ROOT / path).read_text(encoding="utf-8").splitlines())


@pytest.fixture(scope="module")
def told():
    """What the guide says of each chip: lines of its driver, its peer and its tests."""
    rows = (line.strip("| ").split("|") for line in GUIDE.read_text(encoding="utf-8").splitlines())
    named = {row[0].split()[0].rstrip(",").replace("-", "").lower(): row[1:] for row in rows if len(row) == 4}
    return {chip: tuple(int(cell) for cell in named[chip]) for chip in CHIPS}


@pytest.mark.parametrize("chip", CHIPS)
def test_a_chip_takes_what_the_guide_says_and_no_more_than_a_chip_may(told, chip):
    """What grows beyond is shared by other chips, and belongs into the kit."""
    driver = lines(f"src/hil/instruments/{chip}.py")
    peer = sum(lines(f"src/hil/simulation/peers/{name}.py") for name in PEERS.get(chip, (chip,)))
    tests = lines(f"tests/contract/test_{chip}_against_peer.py")
    assert told[chip] == pytest.approx((driver, peer, tests), abs=5)
    assert driver + peer <= MOST_SOURCE
    assert tests <= MOST_TESTS
