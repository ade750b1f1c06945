"""What instruments can do beyond their roles."""

from __future__ import annotations

from hil.instruments.driver import OVER_VOLTAGE_LEVEL, offers
from hil.instruments.registry import DRIVERS


def test_a_supply_says_whether_its_protection_has_a_level():
    """A Korad's acts at the voltage that is set; who says nothing has none."""
    answers = {
        name: offers(DRIVERS[name], OVER_VOLTAGE_LEVEL)
        for name in ("keysight-e36300", "rigol-dp832", "korad-ka3005p", "siglent-spd3303x", "waveshare-relay")
    }
    assert answers == {
        "keysight-e36300": True,
        "rigol-dp832": True,
        "korad-ka3005p": False,
        "siglent-spd3303x": False,
        "waveshare-relay": False,
    }
